//! What a lane must produce: its environments without their faults, stepped one by one on this thread,
//! without pool or transport.

use crate::own_features::OwnFeatures;
use crate::{LanePlan, Row};
use smaclite_engine::{Battle, Scratch, Snapshot};
use smaclite_ipc::Batch;
use smaclite_pool::Autoreset;

/// The state of an environment.
#[derive(Clone)]
pub struct SavedEnv {
    snapshot: Snapshot,
    own: OwnFeatures,
    is_over: bool,
}

/// A lane computed step by step.
pub struct Reference {
    envs: Vec<ReferenceEnv>,
    autoreset: Autoreset,
    seed: u64,
    /// The first reset of a session uses the lane's seed if it has none.
    was_reset: bool,
    scratch: Scratch,
}

struct ReferenceEnv {
    battle: Battle,
    own: OwnFeatures,
    is_over: bool,
    steps: u64,
    row: Row,
}

impl Reference {
    /// The lane's environments at the start of a session, before their first reset.
    pub fn new(plan: &LanePlan) -> Reference {
        let mut scratch = Scratch::new();
        let env = |(index, mut battle): (usize, Battle)| {
            let own = OwnFeatures::new(plan);
            battle.keep_shares();
            let row = Row::of(&battle, index, None, &own, &mut scratch);
            ReferenceEnv { battle, own, is_over: false, steps: 0, row }
        };
        let envs = plan.battles().enumerate().map(env).collect();
        Reference { envs, autoreset: plan.autoreset, seed: plan.seed, was_reset: false, scratch }
    }

    /// Resets every environment: with a seed, environment `i` is seeded with `seed + i`; without one its
    /// generator continues, except in the first reset, which uses the lane's seed.
    pub fn reset_all(&mut self, seed: Option<u64>) {
        let seed = seed.or((!self.was_reset).then_some(self.seed));
        self.was_reset = true;
        for env in 0..self.envs.len() {
            self.reset(env as i32, seed);
            self.envs[env].steps = 0;
        }
    }

    /// Resets one environment; its generator continues unless there is a seed.
    pub fn reset(&mut self, env: i32, seed: Option<u64>) -> &Row {
        let state = &mut self.envs[env as usize];
        if let Some(seed) = seed {
            state.battle.reseed(seed.wrapping_add(env as u64));
        }
        state.battle.reset();
        state.own.reset();
        state.is_over = false;
        self.observe(env)
    }

    /// The row of an environment when others are reset in synchronous mode: unchanged, but not of a step.
    pub fn observe(&mut self, env: i32) -> &Row {
        let state = &mut self.envs[env as usize];
        state.row = Row::of(&state.battle, env as usize, None, &state.own, &mut self.scratch);
        &state.row
    }

    /// The state of an environment.
    pub fn save(&self, env: i32) -> SavedEnv {
        let state = &self.envs[env as usize];
        let snapshot = state.battle.save();
        SavedEnv { snapshot, own: state.own.clone(), is_over: state.is_over }
    }

    /// Continues an environment from another state, with a generator of its own if there is a seed.
    ///
    /// # Panics
    /// If the state is of another scenario.
    pub fn restore(&mut self, env: i32, saved: &SavedEnv, seed: Option<u64>) -> &Row {
        let state = &mut self.envs[env as usize];
        state.battle.restore(&saved.snapshot).expect("of this scenario");
        if let Some(seed) = seed {
            state.battle.reseed(seed.wrapping_add(env as u64));
        }
        (state.own, state.is_over) = (saved.own.clone(), saved.is_over);
        self.observe(env)
    }

    /// Steps one environment, with autoreset.
    ///
    /// # Panics
    /// If an action is illegal.
    pub fn step(&mut self, env: i32, actions: &[i32]) -> &Row {
        self.envs[env as usize].steps += 1;
        if self.is_over(env) && self.autoreset == Autoreset::NextStep {
            return self.reset(env, None);
        }
        let state = &mut self.envs[env as usize];
        let step = state.battle.step(actions, &mut self.scratch).expect("available actions");
        state.is_over = step.terminated || step.truncated;
        state.own.step(actions);
        state.row = Row::of(&state.battle, env as usize, Some(step), &state.own, &mut self.scratch);
        if state.is_over && self.autoreset == Autoreset::SameStep {
            state.battle.reset();
            state.own.reset();
            state.is_over = false;
            state.row.append_reset(&state.battle, &state.own, &mut self.scratch);
        }
        &state.row
    }

    /// The environment's last row.
    pub fn row(&self, env: i32) -> &Row {
        &self.envs[env as usize].row
    }

    /// Whether the environment's episode is over.
    pub fn is_over(&self, env: i32) -> bool {
        self.envs[env as usize].is_over
    }

    /// Steps of the environment since the last reset of all.
    pub fn steps(&self, env: i32) -> u64 {
        self.envs[env as usize].steps
    }

    /// Compares every slot of a batch with the last row of its environment.
    ///
    /// # Errors
    /// The first difference.
    pub fn check(&self, batch: &Batch) -> Result<(), String> {
        for slot in 0..batch.env_id().len() {
            let found = Row::read(batch.bytes(), batch.layout(), slot);
            let env = found.env();
            let known = usize::try_from(env).ok().and_then(|env| self.envs.get(env));
            let expected = known.ok_or_else(|| format!("slot {slot} is of environment {env}"))?;
            if let Some(difference) = found.difference(&expected.row) {
                return Err(format!("environment {env}, step {}: {difference}", expected.steps));
            }
        }
        Ok(())
    }
}
