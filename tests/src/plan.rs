//! Lanes and pools as plain data: a test writes them down, and a child process reads them from its command.

use crate::fault::{Fault, FaultyEnv};
use crate::toy_env::{SIZES, TOY, ToyEnv};
use serde::{Deserialize, Serialize};
use smaclite_engine::{Arena, Battle, BattleSetup, EnemySide, Opponent, Opponents, Sides, Sizes};
use smaclite_ipc::{LaneConfig, LaneEnvs, RuntimeDir, SupervisorConfig, WaitStrategy};
use smaclite_pool::environment::MakeEnvironment;
use smaclite_pool::fields::FieldSet;
use smaclite_pool::{Autoreset, LaneSettings, LaneSpec, PoolOptions};
use smaclite_scenarios::ScenarioFiles;
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
    /// A standard scenario, or [`TOY`].
    pub scenario: String,
    /// Environments.
    pub num_envs: usize,
    /// Slots per frame.
    pub batch_size: usize,
    /// Seed of environment 0.
    pub seed: u64,
    /// What happens at an episode's end.
    pub autoreset: Autoreset,
    /// Largest number of steps per episode, for battles.
    pub episode_limit: Option<u32>,
    /// Who plays the enemies of battles.
    pub opponents: Opponents,
    /// Which sides of battles joint actions play.
    pub sides: Sides,
    /// Names of the fields; `None` for the default.
    pub fields: Option<Vec<String>>,
    /// Own last actions in an observation.
    pub obs_last_actions: usize,
    /// Own number in an observation.
    pub obs_agent_id: bool,
    /// Batches that a learner may hold.
    pub max_held_batches: usize,
    /// Largest number of spectators at once.
    pub spectators: usize,
    /// Environments with a fault, at most one each.
    pub faults: Vec<(usize, Fault)>,
}

impl PoolPlan {
    /// The pool `train` with these lanes and one worker thread.
    pub fn new(lanes: impl IntoIterator<Item = LanePlan>) -> PoolPlan {
        PoolPlan { name: "train".into(), threads: 1, lanes: lanes.into_iter().collect() }
    }

    /// The same pool with this number of worker threads.
    pub fn threads(self, threads: usize) -> PoolPlan {
        PoolPlan { threads, ..self }
    }

    /// The [role](crate::roles) of its supervisor.
    pub fn role(&self) -> String {
        format!("supervisor {}", serde_json::to_string(self).expect("plain data"))
    }

    /// The configuration of its supervisor.
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
            opponents: Opponents::default(),
            sides: Sides::default(),
            fields: None,
            obs_last_actions: 0,
            obs_agent_id: false,
            max_held_batches: 4,
            spectators: 2,
            faults: Vec::new(),
        }
    }

    /// A synchronous lane of [`ToyEnv`]s.
    pub fn toy(num_envs: usize) -> LanePlan {
        LanePlan::new(TOY, num_envs)
    }

    /// The same lane with joint actions that play both sides, and no script.
    pub fn both_sides(self, enemies: EnemySide) -> LanePlan {
        LanePlan { sides: Sides::Both(enemies), opponents: Opponent::Learner.into(), ..self }
    }

    /// The same lane with a fault in environment `env`.
    pub fn fault(mut self, env: usize, fault: Fault) -> LanePlan {
        self.faults.push((env, fault));
        self
    }

    /// The [role](crate::roles) of a learner of the lane.
    pub fn role(&self) -> String {
        format!("learner {}", serde_json::to_string(self).expect("plain data"))
    }

    /// Makes the lane's environments, with their faults.
    pub fn make(&self) -> MakeEnvironment {
        let (make, faults) = (self.make_without_faults(), self.faults.clone());
        Box::new(move |env| match faults.iter().find(|(faulty, _)| *faulty == env) {
            Some((_, fault)) => Box::new(FaultyEnv::new(make(env), env, fault.clone())),
            None => make(env),
        })
    }

    /// Makes the lane's environments as they are without faults.
    pub fn make_without_faults(&self) -> MakeEnvironment {
        let seed = self.seed;
        if self.scenario == TOY {
            return Box::new(move |env| Box::new(ToyEnv::new(seed + env as u64)));
        }
        let arena = self.arena();
        Box::new(move |env| Box::new(Battle::new(Arc::clone(&arena), seed + env as u64)))
    }

    /// The lane for a pool without a supervisor.
    pub fn spec(&self) -> LaneSpec {
        LaneSpec {
            name: self.name.clone(),
            sizes: self.sizes(),
            settings: self.settings(),
            make: self.make(),
            team: None,
        }
    }

    fn settings(&self) -> LaneSettings {
        let LanePlan { num_envs, batch_size, seed, autoreset, obs_last_actions, obs_agent_id, .. } = *self;
        let own = LaneSettings { fields: self.field_set(), ..LaneSettings::new(num_envs) };
        LaneSettings { batch_size, seed, autoreset, obs_last_actions, obs_agent_id, ..own }
    }

    fn config(&self) -> LaneConfig {
        LaneConfig {
            name: self.name.clone(),
            envs: self.envs(),
            settings: self.settings(),
            max_held_batches: self.max_held_batches,
            spectators: self.spectators,
        }
    }

    /// Battles as a user's lane has them, unless an environment has a fault.
    fn envs(&self) -> LaneEnvs {
        if self.faults.is_empty() {
            LaneEnvs::Battle { setup: self.setup(), team: None }
        } else {
            LaneEnvs::Other { name: self.scenario.clone(), sizes: self.sizes(), make: self.make() }
        }
    }

    fn sizes(&self) -> Sizes {
        if self.scenario == TOY { SIZES } else { self.arena().sizes() }
    }

    fn arena(&self) -> Arc<Arena> {
        Arc::new(self.setup().arena().expect("a standard scenario").1)
    }

    fn setup(&self) -> BattleSetup {
        let (_, files) = ScenarioFiles::resolve(&self.scenario).expect("a standard scenario");
        let (episode_limit, opponents) = (self.episode_limit.into(), self.opponents.clone());
        BattleSetup { episode_limit, opponents, sides: self.sides, ..BattleSetup::new(files) }
    }

    fn field_set(&self) -> FieldSet {
        let names = self.fields.as_ref();
        names.map_or(FieldSet::DEFAULT, |names| FieldSet::from_names(names).expect("names of fields"))
    }
}
