//! `smaclite-pool record`: battles of a scripted policy as a replay file.

use super::{CommandResult, check_range, replay};
use clap::Args;
use smaclite_engine::Rules;
use smaclite_engine::policy::{Scripted, UnknownPolicy};
use smaclite_scenarios::ScenarioFiles;
use smaclite_view::{Recorder, SUFFIX, Setup};
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "\
Example: smaclite-pool record 2s3z --policy focus_fire --out 2s3z.smreplay
    `smaclite-pool replay 2s3z.smreplay --to 2s3z.html` makes a page of it.")]
pub(super) struct Record {
    /// A standard scenario or a scenario file; without an episode limit, its episodes end after 1000 steps
    scenario: String,
    /// The policy of the agents: random, nearest, focus_fire, kite or hold
    #[arg(long, default_value = "nearest", value_name = "NAME", value_parser = policy_name)]
    policy: String,
    /// Number of episodes, 1 to 10000
    #[arg(long, default_value_t = 1, value_name = "N")]
    episodes: usize,
    /// Seed of the battle and of the policy `random`
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Rules of the battles: smaclite (as the published environment plays) or paper (as its paper describes)
    #[arg(long, default_value = "smaclite")]
    rules: Rules,
    /// The replay file, NAME.smreplay; a file of that name is replaced
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Steps of an episode in a scenario without a limit: units that stay apart would never end it.
const DEFAULT_LIMIT: u32 = 1000;

impl Record {
    pub(super) fn run(self) -> CommandResult {
        check_range("--episodes", 1..=10_000, self.episodes)?;
        if self.out.extension().is_none_or(|suffix| suffix != SUFFIX) {
            return Err(format!("--out must end in .{SUFFIX}, got `{}`", self.out.display()).into());
        }
        let (scenario, files) = ScenarioFiles::resolve(&self.scenario)?;
        let episode_limit = Some(scenario.episode_limit.unwrap_or(DEFAULT_LIMIT));
        let setup = Setup { files, rules: self.rules, episode_limit };
        let mut recorder = Recorder::new(setup, self.seed)?;
        let mut policy = Scripted::from_name(&self.policy, self.seed)?;
        let mut actions = vec![0; scenario.n_agents()];
        for episode in 0..self.episodes {
            if episode > 0 {
                recorder.reset();
            }
            while !recorder.battle().is_over() {
                policy.act(recorder.battle(), &mut actions);
                recorder.step(&actions)?;
            }
        }
        let recorded = recorder.finish();
        recorded.write(&self.out)?;
        for (i, episode) in recorded.episodes().iter().enumerate() {
            out!("episode {i}: {}", replay::describe(&recorded, episode))?;
        }
        let bytes = std::fs::metadata(&self.out)?.len();
        out!("{}: {bytes} bytes", self.out.display())?;
        Ok(())
    }
}

fn policy_name(name: &str) -> Result<String, UnknownPolicy> {
    Scripted::from_name(name, 0).map(|_| name.to_owned())
}
