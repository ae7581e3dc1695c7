//! A pool described so briefly that a test can write it down and a child process can read it.

use super::games;
use serde::{Deserialize, Serialize};
use smaclite_engine::{Arena, Battle, Rules};
use smaclite_ipc::{LaneConfig, LaneEnvs, RuntimeDir, SupervisorConfig, WaitStrategy};
use smaclite_pool::environment::Environment;
use smaclite_pool::fields::FieldSet;
use smaclite_pool::{Autoreset, PoolOptions};
use smaclite_scenarios::Scenario;
use std::sync::Arc;

/// A pool.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PoolPlan {
    /// Its name.
    pub name: String,
    /// Worker threads.
    pub threads: usize,
    /// Its lanes.
    pub lanes: Vec<LanePlan>,
}

/// A lane.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LanePlan {
    /// Its name.
    pub name: String,
    /// A standard scenario.
    pub scenario: String,
    /// Environments.
    pub num_envs: usize,
    /// Slots of a frame.
    pub batch_size: usize,
    /// Seed of environment 0.
    pub seed: u64,
    /// What happens at an episode's end.
    pub autoreset: Autoreset,
    /// Steps of an episode at most.
    pub episode_limit: Option<u32>,
    /// Names of the fields, if not all.
    pub fields: Option<Vec<String>>,
    /// Frames a learner may hold.
    pub max_held_batches: usize,
    /// Spectators at once.
    pub spectators: usize,
    /// What is odd about its environments.
    pub oddity: games::Oddity,
}

impl PoolPlan {
    /// The pool `train` with these lanes and one worker.
    pub fn new(lanes: impl IntoIterator<Item = LanePlan>) -> PoolPlan {
        PoolPlan { name: "train".into(), threads: 1, lanes: lanes.into_iter().collect() }
    }

    /// The same with so many worker threads.
    pub fn threads(self, threads: usize) -> PoolPlan {
        PoolPlan { threads, ..self }
    }

    /// What a supervisor at `place` is started with.
    pub fn config(&self, runtime_dir: &RuntimeDir) -> SupervisorConfig {
        let options = PoolOptions { threads: self.threads, wait: WaitStrategy::default() };
        let lanes = self.lanes.iter().map(LanePlan::config).collect();
        SupervisorConfig { name: self.name.clone(), lanes, options, runtime_dir: runtime_dir.clone() }
    }
}

impl LanePlan {
    /// A synchronous lane named after its scenario.
    pub fn new(scenario: &str, num_envs: usize) -> LanePlan {
        LanePlan {
            name: scenario.to_owned(),
            scenario: scenario.to_owned(),
            num_envs,
            batch_size: num_envs,
            seed: 7,
            autoreset: Autoreset::NextStep,
            episode_limit: Some(30),
            fields: None,
            max_held_batches: 4,
            spectators: 2,
            oddity: games::Oddity::None,
        }
    }

    /// What all its environments share.
    pub fn arena(&self) -> Arc<Arena> {
        let scenario = Scenario::resolve(&self.scenario).expect("a standard scenario");
        Arc::new(Arena::new(&scenario, Rules::Smaclite).with_episode_limit(self.episode_limit))
    }

    fn config(&self) -> LaneConfig {
        let scenario = Scenario::resolve(&self.scenario).expect("a standard scenario");
        let mut lane = LaneConfig::new(self.name.clone(), scenario, self.num_envs);
        lane.envs = self.game(lane.envs);
        lane.settings.batch_size = self.batch_size;
        lane.settings.seed = self.seed;
        lane.settings.autoreset = self.autoreset;
        lane.max_held_batches = self.max_held_batches;
        lane.spectators = self.spectators;
        if let Some(names) = &self.fields {
            lane.settings.fields = FieldSet::from_names(names).expect("names of fields");
        }
        lane
    }

    fn game(&self, plain: LaneEnvs) -> LaneEnvs {
        let limit = Some(self.episode_limit);
        match (plain, self.oddity) {
            (LaneEnvs::Battle { scenario, rules, .. }, games::Oddity::None) => {
                LaneEnvs::Battle { scenario, rules, episode_limit: limit }
            }
            _ => {
                let (arena, seed, oddity) = (self.arena(), self.seed, self.oddity);
                let name = self.scenario.clone();
                let sizes = arena.sizes();
                let make = move |env: usize| -> Box<dyn Environment> {
                    Box::new(games::Odd::new(Battle::new(Arc::clone(&arena), seed + env as u64), env, oddity))
                };
                LaneEnvs::Other { name, sizes, make: Box::new(make) }
            }
        }
    }
}
