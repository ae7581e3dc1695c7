//! Returns and win rates of the scripted policies, the table in `docs/reference/policies.md`. Equal seeds
//! give equal tables on every machine.

use smaclite_engine::policy::Scripted;
use smaclite_engine::{Arena, Battle, IllegalAction, Rules, Scratch};
use smaclite_scenarios::Scenario;
use std::error::Error;
use std::num::NonZeroU32;
use std::sync::Arc;

/// What is played.
#[derive(clap::Args)]
pub(crate) struct Games {
    /// Episodes per scenario and policy
    #[arg(long, default_value = "200")]
    episodes: NonZeroU32,
    /// Seed of every battle, whose episodes follow each other, and of the policy `random`
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Names or files of scenarios [default: the standard scenarios]
    #[arg(value_name = "SCENARIO")]
    scenarios: Vec<String>,
}

/// Means over episodes.
struct Score {
    episode_return: f64,
    win_rate: f64,
}

/// Prints a Markdown table.
pub(crate) fn measure(games: &Games) -> Result<(), Box<dyn Error>> {
    let standard = || Scenario::standard_names().map(str::to_owned).collect();
    let names: Vec<String> = if games.scenarios.is_empty() { standard() } else { games.scenarios.clone() };
    println!("| scenario | {} |", Scripted::NAMES.join(" | "));
    println!("| --- |{}", " ---: |".repeat(Scripted::NAMES.len()));
    for name in &names {
        println!("{}", row(name, games)?);
    }
    Ok(())
}

/// The scores of every policy in a scenario.
fn row(name: &str, games: &Games) -> Result<String, Box<dyn Error>> {
    let scenario = Scenario::resolve(name)?;
    if scenario.episode_limit.is_none() {
        return Err(format!("{name}: `episode_limit` must be a number of steps, got none").into());
    }
    let arena = Arc::new(Arena::new(&scenario, Rules::default()));
    let cell = |policy| -> Result<String, Box<dyn Error>> {
        let score = play(&arena, Scripted::from_name(policy, games.seed)?, games)?;
        Ok(format!("{:.1} / {:.0} %", score.episode_return, score.win_rate * 100.0))
    };
    let cells = Scripted::NAMES.into_iter().map(cell).collect::<Result<Vec<_>, _>>()?;
    Ok(format!("| {} | {} |", scenario.name, cells.join(" | ")))
}

fn play(arena: &Arc<Arena>, mut policy: Scripted, games: &Games) -> Result<Score, IllegalAction> {
    let mut battle = Battle::new(Arc::clone(arena), games.seed);
    let mut scratch = Scratch::new();
    let mut actions = vec![0; arena.sizes().n_agents];
    let (mut returns, mut wins) = (0.0, 0);
    for _ in 0..games.episodes.get() {
        battle.reset();
        while !battle.is_over() {
            policy.act(&battle, &mut actions);
            wins += u32::from(battle.step(&actions, &mut scratch)?.battle_won);
        }
        returns += battle.episode_return();
    }
    let episodes = f64::from(games.episodes.get());
    Ok(Score { episode_return: returns / episodes, win_rate: f64::from(wins) / episodes })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_the_documentation_is_current() {
        let games = Games { episodes: NonZeroU32::new(200).unwrap(), seed: 1, scenarios: Vec::new() };
        let page = include_str!("../../docs/reference/policies.md");
        for name in ["3m", "3s_vs_3z", "MMM"] {
            let row = row(name, &games).unwrap();
            assert!(page.lines().any(|line| line == row), "not in docs/reference/policies.md: {row}");
        }
    }
}
