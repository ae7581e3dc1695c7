//! Returns and win rates of the scripted policies, the tables in `docs/reference/policies.md` and
//! `docs/reference/opponents.md`. Equal seeds give equal tables on every machine.

use smaclite_engine::policy::Scripted;
use smaclite_engine::{Arena, Battle, IllegalAction, Opponent, Rules, Scratch};
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
    /// Let this policy play against all opponents, instead of all policies against attack_move
    #[arg(long, value_name = "POLICY")]
    against_all: Option<String>,
    /// Names or files of scenarios [default: the standard scenarios]
    #[arg(value_name = "SCENARIO")]
    scenarios: Vec<String>,
}

/// A policy and its opponent: a column.
type Pairing<'a> = (&'a str, Opponent);

/// Means over episodes.
struct Score {
    episode_return: f64,
    win_rate: f64,
}

/// Prints a Markdown table.
pub(crate) fn measure(games: &Games) -> Result<(), Box<dyn Error>> {
    let standard = || Scenario::standard_names().map(str::to_owned).collect();
    let names: Vec<String> = if games.scenarios.is_empty() { standard() } else { games.scenarios.clone() };
    let heads = games.pairings().into_iter().map(|(policy, opponent)| match games.against_all {
        Some(_) => opponent.name(),
        None => policy,
    });
    let heads: Vec<&str> = heads.collect();
    println!("| scenario | {} |", heads.join(" | "));
    println!("| --- |{}", " ---: |".repeat(heads.len()));
    for name in &names {
        println!("{}", row(name, games)?);
    }
    Ok(())
}

impl Games {
    fn pairings(&self) -> Vec<Pairing<'_>> {
        match &self.against_all {
            Some(policy) => Opponent::scripts().map(|opponent| (policy.as_str(), opponent)).collect(),
            None => Scripted::NAMES.map(|policy| (policy, Opponent::AttackMove)).to_vec(),
        }
    }
}

/// The scores of every pairing in a scenario.
fn row(name: &str, games: &Games) -> Result<String, Box<dyn Error>> {
    let scenario = Scenario::resolve(name)?;
    if scenario.episode_limit.is_none() {
        return Err(format!("{name}: `episode_limit` must be a number of steps, got none").into());
    }
    let cell = |(policy, opponent): Pairing<'_>| -> Result<String, Box<dyn Error>> {
        let arena = Arena::new(&scenario, Rules::default()).with_opponents(opponent.into());
        let score = play(Arc::new(arena), Scripted::from_name(policy, games.seed)?, games)?;
        Ok(format!("{:.1} / {:.0} %", score.episode_return, score.win_rate * 100.0))
    };
    let cells = games.pairings().into_iter().map(cell).collect::<Result<Vec<_>, _>>()?;
    Ok(format!("| {} | {} |", scenario.name, cells.join(" | ")))
}

fn play(arena: Arc<Arena>, mut policy: Scripted, games: &Games) -> Result<Score, IllegalAction> {
    let mut actions = vec![0; arena.sizes().n_agents];
    let mut battle = Battle::new(arena, games.seed);
    let mut scratch = Scratch::new();
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

    fn check(page: &str, against_all: Option<&str>, names: &[&str]) {
        let (episodes, against_all) = (NonZeroU32::new(200).unwrap(), against_all.map(str::to_owned));
        let games = Games { episodes, seed: 1, against_all, scenarios: Vec::new() };
        for name in names {
            let row = row(name, &games).unwrap();
            assert!(page.lines().any(|line| line == row), "not in the page: {row}");
        }
    }

    #[test]
    fn the_tables_of_the_documentation_are_current() {
        check(include_str!("../../docs/reference/policies.md"), None, &["3m", "3s_vs_3z", "MMM"]);
        let page = include_str!("../../docs/reference/opponents.md");
        check(page, Some("focus_fire"), &["3m", "3s_vs_3z", "MMM"]);
    }
}
