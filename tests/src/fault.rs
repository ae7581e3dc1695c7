//! Environments that panic, sleep or wait at a given point.

use serde::{Deserialize, Serialize};
use smaclite_engine::{Scratch, Sizes, Step};
use smaclite_pool::environment::{Environment, JointAction};
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

/// What an environment does in addition to being stepped. A gate and a log exist in one process only, so they
/// are not sent to a child.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Fault {
    /// The step with this number panics, counted from 1 over all episodes.
    PanicInStep(u64),
    /// Every step sleeps.
    Sleep(Duration),
    /// Every step waits while the gate is closed.
    #[serde(skip)]
    Gate(Gate),
    /// Every step appends the character to the log.
    #[serde(skip)]
    Log(Arc<Mutex<Vec<char>>>, char),
}

/// Stops steps while it is closed.
#[derive(Clone, Debug, Default)]
pub struct Gate(Arc<(Mutex<GateState>, Condvar)>);

#[derive(Debug, Default)]
struct GateState {
    closed: bool,
    waiting: usize,
}

impl Gate {
    /// From now on steps wait here.
    pub fn close(&self) {
        self.0.0.lock().unwrap().closed = true;
    }

    /// Lets all steps continue.
    pub fn open(&self) {
        self.0.0.lock().unwrap().closed = false;
        self.0.1.notify_all();
    }

    /// Returns as soon as a step waits at the closed gate.
    pub fn wait_for_arrival(&self) {
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

/// Environment `index` of a lane, with a fault; everything else is forwarded.
pub struct FaultyEnv {
    env: Box<dyn Environment>,
    index: usize,
    fault: Fault,
    steps: u64,
}

impl FaultyEnv {
    /// Adds the fault to environment `index`.
    pub fn new(env: Box<dyn Environment>, index: usize, fault: Fault) -> FaultyEnv {
        FaultyEnv { env, index, fault, steps: 0 }
    }
}

impl Environment for FaultyEnv {
    fn step_checked(&mut self, actions: JointAction<'_>, scratch: &mut Scratch) -> Step {
        self.steps += 1;
        match &self.fault {
            Fault::PanicInStep(step) if *step == self.steps => {
                panic!("environment {} broke in step {step}", self.index)
            }
            Fault::PanicInStep(_) => {}
            Fault::Sleep(time) => std::thread::sleep(*time),
            Fault::Gate(gate) => gate.pass(),
            Fault::Log(log, character) => log.lock().unwrap().push(*character),
        }
        self.env.step_checked(actions, scratch)
    }

    fn sizes(&self) -> Sizes {
        self.env.sizes()
    }
    fn reseed(&mut self, seed: u64) {
        self.env.reseed(seed);
    }
    fn reset(&mut self) {
        self.env.reset();
    }
    fn write_obs(&self, out: &mut [f32], scratch: &mut Scratch) {
        self.env.write_obs(out, scratch);
    }
    fn write_state(&self, out: &mut [f32]) {
        self.env.write_state(out);
    }
    fn write_avail_actions(&self, out: &mut [u8]) {
        self.env.write_avail_actions(out);
    }
    fn write_available_bits(&self, out: &mut [u64]) {
        self.env.write_available_bits(out);
    }
    fn write_alive(&self, out: &mut [u8]) {
        self.env.write_alive(out);
    }
    fn dead_allies(&self) -> usize {
        self.env.dead_allies()
    }
    fn dead_enemies(&self) -> usize {
        self.env.dead_enemies()
    }
    fn episode_return(&self) -> f64 {
        self.env.episode_return()
    }
    fn episode_length(&self) -> u32 {
        self.env.episode_length()
    }
    fn opponent(&self) -> usize {
        self.env.opponent()
    }
}
