//! A policy against itself in the mirror: if neither the rules nor the encoders favour a side, the agents win
//! half of the decided battles. Both sides see the whole state, so nothing but the side differs.
//!
//! Positions are f32, whose spacing is not the same in the west and in the east. In a scenario in which
//! episodes of a deterministic policy hardly differ, rounding decides all of them alike: `--shift` makes them
//! differ.

use smaclite_engine::policy::Scripted;
use smaclite_engine::{Arena, Battle, Faction, Generator, IllegalAction, Rules, Scratch, Sides};
use smaclite_scenarios::{Placement, Scenario};
use std::error::Error;
use std::num::NonZeroU32;
use std::sync::Arc;

/// What is played.
#[derive(clap::Args)]
pub(crate) struct Games {
    /// Episodes per scenario and policy
    #[arg(long, default_value = "20000")]
    episodes: NonZeroU32,
    /// Episode i is seeded with SEED + i; the policy `random` and the shifts draw from the seed too
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Move the start of each unit by up to so many squares in each direction, other ones in each episode,
    /// and the unit of the same number of the other side by as much in the mirror
    #[arg(long, default_value_t = 0.0, value_name = "SQUARES")]
    shift: f64,
    /// Policies, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "nearest,focus_fire,spread")]
    policies: Vec<String>,
    /// Names or files of scenarios [default: the symmetric ones of the standard scenarios]
    #[arg(value_name = "SCENARIO")]
    scenarios: Vec<String>,
}

/// Battles that the agents won, that nobody won, and that the enemies won.
#[derive(Clone, Copy, Debug, Default)]
struct Outcomes {
    wins: u32,
    draws: u32,
    losses: u32,
}

impl Outcomes {
    /// The agents' share of the decided battles and the half width of its 95 % interval, in per cent.
    fn share(self) -> (f64, f64) {
        let decided = f64::from(self.wins + self.losses).max(1.0);
        let share = f64::from(self.wins) / decided;
        (100.0 * share, 196.0 * (share * (1.0 - share) / decided).sqrt())
    }
}

/// Prints a Markdown table.
pub(crate) fn measure(games: &Games) -> Result<(), Box<dyn Error>> {
    let scenarios = if games.scenarios.is_empty() {
        let standard = Scenario::standard_names().map(Scenario::standard);
        standard.flatten().filter(is_symmetric).collect()
    } else {
        games.scenarios.iter().map(|name| symmetric(name)).collect::<Result<Vec<_>, _>>()?
    };
    println!("| scenario | {} |", games.policies.join(" | "));
    println!("| --- |{}", " ---: |".repeat(games.policies.len()));
    for scenario in &scenarios {
        let cell = |policy: &String| -> Result<String, Box<dyn Error>> {
            let outcomes = play(scenario, Scripted::from_name(policy, games.seed)?, games)?;
            let (share, half_width) = outcomes.share();
            Ok(format!("{share:.1} % ± {half_width:.1}"))
        };
        let cells = games.policies.iter().map(cell).collect::<Result<Vec<_>, _>>()?;
        println!("| {} | {} |", scenario.name, cells.join(" | "));
    }
    Ok(())
}

fn symmetric(name: &str) -> Result<Scenario, Box<dyn Error>> {
    let scenario = Scenario::resolve(name)?;
    let error = || format!("{name}: after half a turn of the map, one side must stand where the other does");
    if is_symmetric(&scenario) { Ok(scenario) } else { Err(error().into()) }
}

/// Whether each unit has the type and the start of that of the same number of the other side after half a
/// turn of the map, to within the rounding of formations.
fn is_symmetric(scenario: &Scenario) -> bool {
    let agents = |scenario: &Scenario| {
        let units = scenario.units.iter().filter(|unit| unit.faction == Faction::Ally);
        units.copied().collect::<Vec<Placement>>()
    };
    let (own, others) = (agents(scenario), agents(&scenario.exchanged().turned()));
    let is_near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-9;
    own.len() == others.len()
        && own.iter().zip(&others).all(|(a, b)| a.unit_type == b.unit_type && is_near(a.position, b.position))
}

fn play(scenario: &Scenario, mut policy: Scripted, games: &Games) -> Result<Outcomes, IllegalAction> {
    let arena =
        |scenario: &Scenario| Arc::new(Arena::new(scenario, Rules::default()).with_sides(Sides::Mirrored));
    let (common, mut shifts) = (arena(scenario), Generator::new(games.seed));
    let (mut outcomes, mut scratch) = (Outcomes::default(), Scratch::new());
    for i in 0..games.episodes.get() {
        let arena = match games.shift {
            0.0 => Arc::clone(&common),
            shift => arena(&shifted(scenario, shift, &mut shifts)),
        };
        let mut battle = Battle::new(arena, games.seed + u64::from(i));
        play_episode(&mut battle, &mut policy, &mut scratch)?;
        match [Faction::Ally, Faction::Enemy].map(|side| battle.is_won_by(side)) {
            [true, false] => outcomes.wins += 1,
            [false, true] => outcomes.losses += 1,
            _ => outcomes.draws += 1,
        }
    }
    Ok(outcomes)
}

/// Both sides play the policy by what their learners see.
fn play_episode(
    battle: &mut Battle,
    policy: &mut Scripted,
    scratch: &mut Scratch,
) -> Result<(), IllegalAction> {
    let arena = Arc::clone(battle.arena());
    let sizes = arena.sizes();
    let (mut state, mut available) = (vec![0.0; sizes.state_size], vec![0; sizes.n_agents * sizes.n_actions]);
    let mut actions = vec![0; sizes.n_actors()];
    while !battle.is_over() {
        let of_sides = actions.chunks_exact_mut(sizes.n_agents);
        for (side, actions) in [Faction::Ally, Faction::Enemy].into_iter().zip(of_sides) {
            battle.write_state(side, &mut state);
            battle.write_avail_actions(side, &mut available);
            policy.act_batch_of(side, &arena, &state, &available, actions);
        }
        battle.step(&actions, scratch)?;
    }
    Ok(())
}

/// The scenario with other starts, which are mirror images as before.
fn shifted(scenario: &Scenario, shift: f64, generator: &mut Generator) -> Scenario {
    let mut draw = || (2.0 * f64::from(generator.next_word()) / f64::from(u32::MAX) - 1.0) * shift;
    let shifts: Vec<[f64; 2]> = (0..scenario.n_agents()).map(|_| [draw(), draw()]).collect();
    let mut shifted = scenario.clone();
    for unit in &mut shifted.units {
        let sign = if unit.faction == Faction::Ally { 1.0 } else { -1.0 };
        let by = shifts[unit.id_in_faction];
        unit.position = [0, 1].map(|axis| unit.position[axis] + sign * by[axis]);
    }
    shifted
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Within four standard deviations. An action that was not reflected, or a feature, favoured a side.
    #[test]
    fn a_policy_wins_half_of_its_battles_against_itself_in_the_mirror() {
        for (name, shift, episodes) in
            [("3m", 0.0, 3000), ("2s3z", 0.0, 1000), ("MMM", 0.0, 300), ("1c3s5z", 0.01, 300)]
        {
            for policy in ["nearest", "focus_fire", "spread"] {
                let episodes = NonZeroU32::new(episodes).unwrap();
                let (policies, scenarios) = (Vec::new(), Vec::new());
                let games = Games { episodes, seed: 1, shift, policies, scenarios };
                let scenario = Scenario::standard(name).unwrap();
                assert!(is_symmetric(&scenario), "{name}");
                let outcomes = play(&scenario, Scripted::from_name(policy, 1).unwrap(), &games).unwrap();
                let (share, half_width) = outcomes.share();
                assert!(
                    outcomes.wins + outcomes.losses > episodes.get() / 2,
                    "{name} {policy}: {outcomes:?}"
                );
                assert!((share - 50.0).abs() < 4.0 / 1.96 * half_width, "{name} {policy}: {outcomes:?}");
            }
        }
    }
}
