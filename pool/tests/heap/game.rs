//! A small game whose every number depends on all that happened in it: its seed, its resets, its actions and
//! their order. It can be told to stop at a gate, to panic, and to write down when it is stepped.

use smaclite_engine::{IllegalAction, Scratch, Sizes, Step};
use smaclite_pool::environment::Environment;
use std::sync::{Arc, Condvar, Mutex};

/// Of every game here.
pub const SIZES: Sizes = Sizes { n_agents: 2, n_enemies: 1, n_actions: 5, obs_size: 3, state_size: 4 };

/// A closed gate stops whoever comes to it, in the middle of a step.
#[derive(Clone, Default)]
pub struct Gate(Arc<(Mutex<GateState>, Condvar)>);

#[derive(Default)]
struct GateState {
    closed: bool,
    waiting: usize,
}

impl Gate {
    /// Whoever comes from now on stops.
    pub fn close(&self) {
        self.0.0.lock().unwrap().closed = true;
    }

    /// Lets everyone through.
    pub fn open(&self) {
        self.0.0.lock().unwrap().closed = false;
        self.0.1.notify_all();
    }

    /// Waits until somebody stands at the closed gate.
    pub fn somebody_waits(&self) {
        let state = self.0.0.lock().unwrap();
        drop(self.0.1.wait_while(state, |state| state.waiting == 0).unwrap());
    }

    fn pass(&self) {
        let mut state = self.0.0.lock().unwrap();
        state.waiting += 1;
        self.0.1.notify_all();
        let mut state = self.0.1.wait_while(state, |state| state.closed).unwrap();
        state.waiting -= 1;
    }
}

/// What is special about a game.
#[derive(Clone, Default)]
pub struct Oddity {
    /// Steps stop here.
    pub gate: Option<Gate>,
    /// The step with this number panics, counted from 1 over all episodes.
    pub panics_in_step: Option<u32>,
    /// The check of actions panics.
    pub panics_in_check: bool,
    /// Every step adds the mark.
    pub log: Option<(Arc<Mutex<Vec<char>>>, char)>,
}

/// The game.
#[derive(Clone)]
pub struct LaneEnvs {
    /// Everything that happened, mixed.
    word: u64,
    length: u32,
    total: f64,
    steps: u32,
    oddity: Oddity,
}

fn mix(word: u64, more: u64) -> u64 {
    let word = (word ^ more).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    word ^ (word >> 29)
}

impl LaneEnvs {
    /// Seeded and reset.
    pub fn new(seed: u64, oddity: Oddity) -> LaneEnvs {
        let mut game = LaneEnvs { word: 0, length: 0, total: 0.0, steps: 0, oddity };
        game.reseed(seed);
        game.reset();
        game
    }

    /// One action of each agent is never available; which one changes from step to step.
    fn is_available(&self, agent: usize, action: usize) -> bool {
        (self.word as usize / 7 + agent) % SIZES.n_actions != action
    }
}

impl Environment for LaneEnvs {
    fn sizes(&self) -> Sizes {
        SIZES
    }

    fn reseed(&mut self, seed: u64) {
        self.word = mix(1, seed);
    }

    fn reset(&mut self) {
        self.word = mix(self.word, 2);
        (self.length, self.total) = (0, 0.0);
    }

    fn check(&self, actions: &[i32]) -> Result<(), IllegalAction> {
        assert!(!self.oddity.panics_in_check, "the check broke");
        for (agent, &action) in actions.iter().enumerate() {
            let n_actions = SIZES.n_actions;
            let known = usize::try_from(action).ok().filter(|a| *a < n_actions);
            let known = known.ok_or(IllegalAction::OutOfRange { agent, action, n_actions })?;
            if !self.is_available(agent, known) {
                let available = (0..n_actions).filter(|a| self.is_available(agent, *a)).collect();
                return Err(IllegalAction::Unavailable { agent, action, available });
            }
        }
        Ok(())
    }

    fn step(&mut self, actions: &[i32], _scratch: &mut Scratch) -> Result<Step, IllegalAction> {
        self.check(actions)?;
        self.steps += 1;
        if let Some((log, mark)) = &self.oddity.log {
            log.lock().unwrap().push(*mark);
        }
        if let Some(gate) = &self.oddity.gate {
            gate.pass();
        }
        assert_ne!(Some(self.steps), self.oddity.panics_in_step, "step {} broke", self.steps);
        self.word = actions.iter().fold(self.word, |word, action| mix(word, *action as u64 + 3));
        self.length += 1;
        let reward = (self.word % 16) as f64 / 16.0;
        self.total += reward;
        let terminated = self.word.is_multiple_of(11);
        let truncated = !terminated && self.length == 9;
        Ok(Step { reward, terminated, truncated, battle_won: terminated && self.word.is_multiple_of(2) })
    }

    fn write_obs(&self, out: &mut [f32], _scratch: &mut Scratch) {
        assert_eq!(out.len(), SIZES.n_agents * SIZES.obs_size);
        out.iter_mut().zip(10..).for_each(|(x, salt)| *x = (mix(self.word, salt) % 4096) as f32 / 4096.0);
    }

    fn write_state(&self, out: &mut [f32]) {
        assert_eq!(out.len(), SIZES.state_size);
        out.iter_mut().zip(20..).for_each(|(x, salt)| *x = (mix(self.word, salt) % 4096) as f32 / 4096.0);
    }

    fn write_avail_actions(&self, out: &mut [u8]) {
        for (i, cell) in out.iter_mut().enumerate() {
            *cell = u8::from(self.is_available(i / SIZES.n_actions, i % SIZES.n_actions));
        }
    }

    fn write_alive(&self, out: &mut [u8]) {
        out.iter_mut().zip(0..).for_each(|(x, agent)| *x = (self.word >> agent & 1) as u8);
    }

    fn dead_allies(&self) -> usize {
        self.word as usize % 3
    }

    fn dead_enemies(&self) -> usize {
        self.word as usize % 2
    }

    fn episode_return(&self) -> f64 {
        self.total
    }

    fn episode_length(&self) -> u32 {
        self.length
    }
}
