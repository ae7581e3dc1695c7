//! What the thread that accepts requests and the threads that carry them out tell each other of every
//! environment.
//!
//! The accepting thread needs this of all environments for every request. An environment's own memory is
//! mostly in the cache of the core that stepped it last, and its lock would make every access wait for the
//! one before. So here the environments are side by side, one column per property.
//!
//! Orders are written while the environment is idle, reports while it is not. Publishing work releases the
//! orders to the thread that takes it; the end of the work (`is_busy`, or the lane's count of outstanding
//! environments) releases the reports. So every access here is relaxed but that to `busy`.

use crate::hosted_env::{HostedEnv, Task, words_per_actor};
use crossbeam::atomic::AtomicCell;
use smaclite_engine::Sizes;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, Ordering::*};

pub(super) struct EnvTable {
    n_actors: usize,
    /// Words of bits per actor.
    words: usize,
    /// The orders.
    tasks: Vec<AtomicCell<Task>>,
    /// `[num_envs, n_actors]`: the orders' joint actions.
    actions: Vec<AtomicI32>,
    /// `[num_envs, n_actors, words]`: the available actions.
    available: Vec<AtomicU64>,
    /// The episode ended and the environment was not reset since.
    over: Vec<AtomicBool>,
    /// The environment has an order; only asynchronous lanes use it.
    busy: Vec<AtomicBool>,
}

/// Writes only changes: other threads have the cache line too.
macro_rules! set {
    ($cell:expr, $value:expr) => {
        if $cell.load(Relaxed) != $value {
            $cell.store($value, Relaxed);
        }
    };
}

impl EnvTable {
    pub(super) fn new(num_envs: usize, sizes: Sizes) -> EnvTable {
        let (n_actors, words) = (sizes.n_actors(), words_per_actor(sizes));
        EnvTable {
            n_actors,
            words,
            tasks: (0..num_envs).map(|_| AtomicCell::new(Task::Step)).collect(),
            actions: (0..num_envs * n_actors).map(|_| AtomicI32::new(0)).collect(),
            available: (0..num_envs * n_actors * words).map(|_| AtomicU64::new(0)).collect(),
            over: (0..num_envs).map(|_| AtomicBool::new(false)).collect(),
            busy: (0..num_envs).map(|_| AtomicBool::new(false)).collect(),
        }
    }

    #[inline]
    pub(super) fn order(&self, env: usize, task: Task) {
        if self.tasks[env].load() != task {
            self.tasks[env].store(task);
        }
    }

    #[inline]
    pub(super) fn task(&self, env: usize) -> Task {
        self.tasks[env].load()
    }

    /// `[n_actors]`: the joint action of an environment's order.
    #[inline]
    pub(super) fn actions(&self, env: usize) -> &[AtomicI32] {
        &self.actions[env * self.n_actors..][..self.n_actors]
    }

    /// Reports how far an environment is.
    #[inline]
    pub(super) fn report(&self, env: usize, hosted: &mut HostedEnv) {
        let len = self.n_actors * self.words;
        for (cell, bits) in self.available[env * len..][..len].iter().zip(hosted.available()) {
            set!(cell, *bits);
        }
        set!(self.over[env], hosted.is_over);
    }

    /// Whether the episode ended and the environment was not reset since.
    #[inline]
    pub(super) fn is_over(&self, env: usize) -> bool {
        self.over[env].load(Relaxed)
    }

    /// `[n_actors]`: the actions that are available in an environment.
    #[inline]
    pub(super) fn masks(&self, env: usize) -> impl Iterator<Item = ActionMask<'_>> {
        let len = self.n_actors * self.words;
        self.available[env * len..][..len].chunks_exact(self.words).map(ActionMask)
    }

    #[inline]
    pub(super) fn is_busy(&self, env: usize) -> bool {
        self.busy[env].load(Acquire)
    }

    #[inline]
    pub(super) fn set_busy(&self, env: usize, is_busy: bool) {
        self.busy[env].store(is_busy, Release);
    }
}

/// The actions that are available to an actor.
pub(super) struct ActionMask<'a>(&'a [AtomicU64]);

impl ActionMask<'_> {
    /// Whether this action is; not if there is no such action.
    #[inline]
    pub(super) fn has(&self, action: i32) -> bool {
        // Negative numbers become large ones.
        let action = action as u32;
        self.0.get(action as usize / 64).is_some_and(|word| word.load(Relaxed) >> (action % 64) & 1 == 1)
    }

    /// All of them.
    pub(super) fn actions(&self) -> Vec<usize> {
        (0..64 * self.0.len()).filter(|action| self.has(*action as i32)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn actions_beyond_the_64th_are_available_too() {
        let words = [1 << 3 | 1 << 63, 1 << 5].map(AtomicU64::new);
        let mask = ActionMask(&words);
        assert_eq!(mask.actions(), [3, 63, 69]);
        assert!([-1, 0, 64, 128].iter().all(|action| !mask.has(*action)));
    }
}
