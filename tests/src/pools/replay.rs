//! The undisturbed run: the battles of a lane played on one thread without pool or transport, to compare
//! frames with.

use super::LanePlan;
use super::dice::joint_action;
use smaclite_engine::{Arena, Battle, Scratch, Sizes};
use smaclite_ipc::Batch;
use smaclite_pool::Autoreset;
use smaclite_pool::fields::{FIELDS, Field};
use smaclite_pool::layout::Layout;
use std::sync::Arc;

/// A lane's battles.
pub struct Replay {
    envs: Vec<Env>,
    sizes: Sizes,
    autoreset: Autoreset,
    seed: u64,
    scratch: Scratch,
}

struct Env {
    battle: Battle,
    over: bool,
    /// Requests served since the last seeding, by which actions are drawn.
    steps: u64,
    expected: Row,
}

/// What a slot must hold, field by field, as bytes.
#[derive(Clone, Default)]
struct Row(Vec<Option<Vec<u8>>>);

/// What a step did.
#[derive(Clone, Copy, Default)]
struct Outcome {
    reward: f32,
    terminated: bool,
    truncated: bool,
    battle_won: bool,
}

impl Replay {
    /// The lane's battles, before their first reset.
    pub fn new(plan: &LanePlan) -> Replay {
        let arena: Arc<Arena> = plan.arena();
        let env = |i: usize| Env {
            battle: Battle::new(Arc::clone(&arena), plan.seed + i as u64),
            over: false,
            steps: 0,
            expected: Row::default(),
        };
        Replay {
            envs: (0..plan.num_envs).map(env).collect(),
            sizes: arena.sizes(),
            autoreset: plan.autoreset,
            seed: plan.seed,
            scratch: Scratch::new(),
        }
    }

    /// Resets every environment with a seed (the lane's own, if `None`).
    pub fn reset_all(&mut self, seed: Option<u64>) {
        let seed = seed.unwrap_or(self.seed);
        for env in 0..self.envs.len() {
            self.reset(env, Some(seed));
            self.envs[env].steps = 0;
        }
    }

    /// Resets one environment; its generator goes on unless there is a seed.
    pub fn reset(&mut self, env: usize, seed: Option<u64>) {
        let state = &mut self.envs[env];
        if let Some(seed) = seed {
            state.battle.reseed(seed.wrapping_add(env as u64));
        }
        state.battle.reset();
        state.over = false;
        self.expect(env, Outcome::default(), None);
    }

    /// Looks at an environment without stepping it.
    pub fn observe(&mut self, env: usize) {
        self.expect(env, Outcome::default(), None);
    }

    /// Is the environment's episode over?
    pub fn is_over(&self, env: usize) -> bool {
        self.envs[env].over
    }

    /// Steps that the environment has been asked for since it was seeded.
    pub fn steps(&self, env: usize) -> u64 {
        self.envs[env].steps
    }

    /// Draws the actions of the environment's next step into `actions` and makes the step.
    pub fn step(&mut self, env: usize, actions: &mut [i32]) {
        let mut masks = vec![0; self.sizes.n_agents * self.sizes.n_actions];
        let state = &mut self.envs[env];
        state.battle.write_avail_actions(&mut masks);
        joint_action(&masks, self.sizes.n_actions, env, state.steps, actions);
        state.steps += 1;
        if state.over && self.autoreset == Autoreset::NextStep {
            state.battle.reset();
            state.over = false;
            return self.expect(env, Outcome::default(), None);
        }
        let step = state.battle.step(actions, &mut self.scratch).expect("drawn from the mask");
        let outcome = Outcome {
            reward: step.reward as f32,
            terminated: step.terminated,
            truncated: step.truncated,
            battle_won: step.battle_won,
        };
        state.over = step.terminated || step.truncated;
        let mut last = None;
        if state.over && self.autoreset == Autoreset::SameStep {
            last = Some(self.envs[env].battle.clone());
            self.envs[env].battle.reset();
            self.envs[env].over = false;
        }
        self.expect(env, outcome, last);
    }

    /// Compares a slot of a batch with what the environment must have written; the error names the field.
    ///
    /// # Errors
    /// What differs.
    pub fn check(&self, batch: &Batch, slot: usize) -> Result<(), String> {
        let env = batch.env_id()[slot] as usize;
        let state = self.envs.get(env).ok_or_else(|| format!("slot {slot} is environment {env}"))?;
        let layout = batch.layout();
        for spec in &FIELDS {
            let Some(Some(expected)) = state.expected.0.get(spec.field as usize) else { continue };
            let Some(start) = layout.offset(spec.field) else { continue };
            let found = row(batch.bytes(), layout, spec.field, start, slot);
            if found != expected {
                let at =
                    found.iter().zip(expected).position(|(a, b)| a != b).unwrap_or(0) / spec.dtype.size();
                return Err(format!(
                    "environment {env}, step {} since its seeding: {}[{at}] differs from the undisturbed run",
                    state.steps, spec.name
                ));
            }
        }
        Ok(())
    }

    /// Compares every slot of a batch.
    ///
    /// # Errors
    /// The first difference.
    pub fn check_all(&self, batch: &Batch) -> Result<(), String> {
        (0..batch.env_id().len()).try_for_each(|slot| self.check(batch, slot))
    }

    /// Notes what the environment's slot must hold now; `last` is the finished battle under same-step
    /// autoreset.
    fn expect(&mut self, env: usize, outcome: Outcome, last: Option<Battle>) {
        let (sizes, scratch) = (self.sizes, &mut self.scratch);
        let state = &mut self.envs[env];
        let ended = last.as_ref().unwrap_or(&state.battle);
        let mut row = Row(vec![None; FIELDS.len()]);
        row.set(Field::EnvId, &(env as i32).to_ne_bytes());
        row.set(Field::Reward, &outcome.reward.to_ne_bytes());
        row.set(Field::Terminated, &[u8::from(outcome.terminated)]);
        row.set(Field::Truncated, &[u8::from(outcome.truncated)]);
        row.set(Field::BattleWon, &[u8::from(outcome.battle_won)]);
        row.set(Field::DeadAllies, &(ended.dead_allies() as i32).to_ne_bytes());
        row.set(Field::DeadEnemies, &(ended.dead_enemies() as i32).to_ne_bytes());
        row.set(Field::EpisodeReturn, &(ended.episode_return() as f32).to_ne_bytes());
        row.set(Field::EpisodeLength, &(ended.episode_length() as i32).to_ne_bytes());
        row.view([Field::Obs, Field::State, Field::AvailActions], &state.battle, sizes, scratch);
        let mut alive = vec![0; sizes.n_agents];
        state.battle.write_alive(&mut alive);
        row.set(Field::Alive, &alive);
        if let Some(last) = &last {
            let fields = [Field::FinalObs, Field::FinalState, Field::FinalAvailActions];
            row.view(fields, last, sizes, scratch);
        }
        state.expected = row;
    }
}

impl Row {
    fn set(&mut self, field: Field, bytes: &[u8]) {
        self.0[field as usize] = Some(bytes.to_vec());
    }

    fn view(
        &mut self,
        [obs, state, avail]: [Field; 3],
        battle: &Battle,
        sizes: Sizes,
        scratch: &mut Scratch,
    ) {
        let mut floats = vec![0f32; sizes.n_agents * sizes.obs_size];
        battle.write_obs(&mut floats, scratch);
        self.set(obs, &floats.iter().flat_map(|x| x.to_ne_bytes()).collect::<Vec<_>>());
        let mut floats = vec![0f32; sizes.state_size];
        battle.write_state(&mut floats);
        self.set(state, &floats.iter().flat_map(|x| x.to_ne_bytes()).collect::<Vec<_>>());
        let mut masks = vec![0; sizes.n_agents * sizes.n_actions];
        battle.write_avail_actions(&mut masks);
        self.set(avail, &masks);
    }
}

fn row<'a>(frame: &'a [u8], layout: &Layout, field: Field, start: usize, slot: usize) -> &'a [u8] {
    let len = layout.row_len(field) * field.spec().dtype.size();
    &frame[start + slot * len..start + (slot + 1) * len]
}
