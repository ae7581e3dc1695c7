//! Environments that panic, sleep or wait at a given point.

use serde::{Deserialize, Serialize};
use smaclite_pool::StepHook;
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

impl Fault {
    /// What environment `index` does in place of a battle's step: the fault, and then the step.
    pub fn hook(self, index: usize) -> StepHook {
        let mut steps = 0;
        Box::new(move |battle, actions, scratch| {
            steps += 1;
            match &self {
                Fault::PanicInStep(step) if *step == steps => {
                    panic!("environment {index} broke in step {step}")
                }
                Fault::PanicInStep(_) => {}
                Fault::Sleep(time) => std::thread::sleep(*time),
                Fault::Gate(gate) => gate.pass(),
                Fault::Log(log, character) => log.lock().unwrap().push(*character),
            }
            battle.step_checked(actions.iter(), scratch)
        })
    }
}
