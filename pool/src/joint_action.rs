//! A joint action in the memory of its lane, and what may be done with it in place of a battle's step.

use smaclite_engine::{Battle, Scratch, Step};
use std::sync::atomic::{AtomicI32, Ordering};

/// A joint action, one number per agent and, in battles of which it plays both sides, per enemy, in the
/// lane's memory. Nothing writes to it during the step.
#[derive(Clone, Copy, Debug)]
pub struct JointAction<'a>(&'a [AtomicI32]);

impl<'a> JointAction<'a> {
    /// The joint action in this memory, `[n_actors]`.
    pub(crate) fn new(actions: &'a [AtomicI32]) -> Self {
        JointAction(actions)
    }

    /// The actions of all agents in order, and then those of the enemies.
    pub fn iter(self) -> impl ExactSizeIterator<Item = i32> + Clone + use<'a> {
        self.0.iter().map(|action| action.load(Ordering::Relaxed))
    }

    /// Sets a number, before the step.
    pub(crate) fn set(self, place: usize, action: i32) {
        self.0[place].store(action, Ordering::Relaxed);
    }
}

/// What a step of one environment does in place of [`Battle::step_checked`]: a test lets it fail or wait, a
/// benchmark leaves the battle out.
pub type StepHook = Box<dyn FnMut(&mut Battle, JointAction<'_>, &mut Scratch) -> Step + Send>;

/// The hook of environment `i` of a lane, if it has one.
pub type MakeHook = Box<dyn Fn(usize) -> Option<StepHook> + Send>;
