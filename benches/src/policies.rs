//! Returns and win rates of the scripted policies: the table in `docs/reference/policies.md`, and the file
//! `docs/reference/opponents.csv`. Equal seeds give equal numbers on every machine.

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

/// Prints a Markdown table of policies, or CSV of opponents.
pub(crate) fn measure(games: &Games) -> Result<(), Box<dyn Error>> {
    let standard = || Scenario::standard_names().map(str::to_owned).collect();
    let names: Vec<String> = if games.scenarios.is_empty() { standard() } else { games.scenarios.clone() };
    if games.against_all.is_some() {
        println!("opponent,scenario,mean_return,win_rate");
        for pairing in games.pairings() {
            for name in &names {
                println!("{}", record(name, &pairing, games)?);
            }
        }
        return Ok(());
    }
    println!("| scenario | {} |", Scripted::NAMES.join(" | "));
    println!("| --- |{}", " ---: |".repeat(Scripted::NAMES.len()));
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

/// The scores of every policy in a scenario, in Markdown.
fn row(name: &str, games: &Games) -> Result<String, Box<dyn Error>> {
    let cell = |pairing: &Pairing<'_>| -> Result<String, Box<dyn Error>> {
        let score = score(name, pairing, games)?;
        Ok(format!("{:.1} / {:.0} %", score.episode_return, score.win_rate * 100.0))
    };
    let cells = games.pairings().iter().map(cell).collect::<Result<Vec<_>, _>>()?;
    Ok(format!("| {name} | {} |", cells.join(" | ")))
}

/// The score of one pairing in a scenario, in CSV.
fn record(name: &str, pairing: &Pairing<'_>, games: &Games) -> Result<String, Box<dyn Error>> {
    let score = score(name, pairing, games)?;
    let win_rate = score.win_rate * 100.0;
    Ok(format!("{},{name},{:.1},{win_rate:.0}", pairing.1.name(), score.episode_return))
}

fn score(name: &str, &(policy, opponent): &Pairing<'_>, games: &Games) -> Result<Score, Box<dyn Error>> {
    let scenario = Scenario::resolve(name)?;
    if scenario.episode_limit.is_none() {
        return Err(format!("{name}: `episode_limit` must be a number of steps, got none").into());
    }
    let arena = Arena::new(&scenario, Rules::default()).with_opponents(opponent.into());
    Ok(play(Arc::new(arena), Scripted::from_name(policy, games.seed)?, games)?)
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

    const MAPS: [&str; 3] = ["3m", "3s_vs_3z", "MMM"];

    fn games(against_all: Option<&str>) -> Games {
        let episodes = NonZeroU32::new(200).unwrap();
        Games { episodes, seed: 1, against_all: against_all.map(str::to_owned), scenarios: Vec::new() }
    }

    fn check(file: &str, line: &str) {
        assert!(file.lines().any(|other| other == line), "not in the file: {line}");
    }

    #[test]
    fn the_numbers_of_the_documentation_are_current() {
        for name in MAPS {
            let row = row(name, &games(None)).unwrap();
            check(include_str!("../../docs/reference/policies.md"), &row);
            let games = games(Some("focus_fire"));
            for pairing in games.pairings() {
                let record = record(name, &pairing, &games).unwrap();
                check(include_str!("../../docs/reference/opponents.csv"), &record);
            }
        }
    }
}
