//! Lanes and pools as plain data: a test writes them down, and a child process reads them from its command.

use crate::fault::Fault;
use serde::{Deserialize, Serialize};
use smaclite_engine::{Arena, Battle, BattleSetup, Opponent, Opponents, Sides};
use smaclite_ipc::{LaneConfig, PreparedPool, RuntimeDir, StartError, SupervisorConfig, WaitStrategy};
use smaclite_pool::fields::FieldSet;
use smaclite_pool::{Autoreset, LaneSettings, LaneSpec, MakeHook, PoolOptions};
use smaclite_scenarios::ScenarioFiles;
use std::sync::Arc;

/// The scenario of [`LanePlan::toy`]: two banelings or zerglings on each side, drawn for every episode. A
/// battle of random actions takes 1 to 15 steps.
const TOY: &str = "toy";
const TOY_TEXT: &str = r#"{
    "name": "toy", "num_allied_units": 2, "num_enemy_units": 2,
    "teams": {
        "distribution": "weighted_teams", "unit_types": ["BANELING", "ZERGLING"], "weights": [0.5, 0.5]
    },
    "start_positions": { "distribution": "surrounded_and_reflect", "p": 0.5 },
    "opponent": "attack_nearest",
    "terrain_preset": "FLAT", "num_unit_types": 2, "unit_type_ids": { "BANELING": 0, "ZERGLING": 1 },
    "ally_has_shields": false, "enemy_has_shields": false, "episode_limit": 15
}"#;

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
    /// A standard scenario, or `toy`.
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

    /// The configuration of its supervisor, without faults.
    fn config(&self, runtime_dir: &RuntimeDir) -> SupervisorConfig {
        let options = PoolOptions { threads: self.threads, wait: WaitStrategy::default() };
        let lanes = self.lanes.iter().map(LanePlan::config).collect();
        SupervisorConfig { name: self.name.clone(), lanes, options, runtime_dir: runtime_dir.clone() }
    }

    /// The prepared pool, with the faults of its lanes.
    ///
    /// # Errors
    /// As [`SupervisorConfig::prepare`].
    pub fn prepare(&self, runtime_dir: &RuntimeDir) -> Result<PreparedPool, StartError> {
        let mut pool = self.config(runtime_dir).prepare()?;
        for (index, lane) in self.lanes.iter().enumerate() {
            lane.hook().into_iter().for_each(|hook| pool.hook_steps(index, hook));
        }
        Ok(pool)
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

    /// A synchronous lane of small, short battles. Seeds decide teams and start positions of every episode,
    /// so an environment that was exchanged for another shows.
    pub fn toy(num_envs: usize) -> LanePlan {
        LanePlan {
            episode_limit: Some(15),
            opponents: Opponent::AttackNearest.into(),
            ..LanePlan::new(TOY, num_envs)
        }
    }

    /// The same lane with joint actions that play both sides, and no script.
    pub fn both_sides(self, sides: Sides) -> LanePlan {
        LanePlan { sides, opponents: Opponent::Learner.into(), ..self }
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

    /// The environments as they are without their faults.
    pub fn battles(&self) -> impl Iterator<Item = Battle> {
        let arena = self.arena();
        (0..self.num_envs as u64).map(move |env| Battle::new(Arc::clone(&arena), self.seed + env))
    }

    /// The faults.
    fn hook(&self) -> Option<MakeHook> {
        let faults = self.faults.clone();
        let fault_of =
            move |env| faults.iter().find(|(faulty, _)| *faulty == env).map(|(_, fault)| fault.clone());
        let hook: MakeHook = Box::new(move |env| fault_of(env).map(|fault| fault.hook(env)));
        (!self.faults.is_empty()).then_some(hook)
    }

    /// The lane for a pool without a supervisor.
    pub fn spec(&self) -> LaneSpec {
        let (name, settings, arena) = (self.name.clone(), self.settings(), self.arena());
        LaneSpec { name, settings, arena, team: None, hook: self.hook() }
    }

    fn settings(&self) -> LaneSettings {
        let LanePlan { num_envs, batch_size, seed, autoreset, obs_last_actions, obs_agent_id, .. } = *self;
        let own = LaneSettings { fields: self.field_set(), ..LaneSettings::new(num_envs) };
        LaneSettings { batch_size, seed, autoreset, obs_last_actions, obs_agent_id, ..own }
    }

    fn config(&self) -> LaneConfig {
        LaneConfig {
            name: self.name.clone(),
            setup: self.setup(),
            team: None,
            settings: self.settings(),
            max_held_batches: self.max_held_batches,
            spectators: self.spectators,
        }
    }

    fn arena(&self) -> Arc<Arena> {
        Arc::new(self.setup().arena().expect("a standard scenario").1)
    }

    fn setup(&self) -> BattleSetup {
        let files = match self.scenario.as_str() {
            TOY => ScenarioFiles { source: TOY.into(), text: TOY_TEXT.into(), unit_files: Vec::new() },
            standard => ScenarioFiles::resolve(standard).expect("a standard scenario").1,
        };
        let (episode_limit, opponents) = (self.episode_limit.into(), self.opponents.clone());
        BattleSetup { episode_limit, opponents, sides: self.sides, ..BattleSetup::new(files) }
    }

    fn field_set(&self) -> FieldSet {
        let names = self.fields.as_ref();
        names.map_or(FieldSet::DEFAULT, |names| FieldSet::from_names(names).expect("names of fields"))
    }
}
