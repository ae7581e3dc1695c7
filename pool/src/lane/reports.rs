//! What the environments of a lane have done and which actions they have available, for the thread that
//! accepts requests.
//!
//! It needs this of all environments for every request. An environment's own memory is mostly in the cache of
//! the core that stepped it last, and its lock would make every access wait for the one before. So whoever
//! carries out an entry reports the result here, where the environments are side by side.

use crate::hosted_env::HostedEnv;
use smaclite_engine::Sizes;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// The reports of all environments.
///
/// The turn of an environment publishes the rest of its report. What the report says of actions is only read
/// after that, while the environment has no entry left: then nobody writes it.
pub(super) struct Reports {
    n_agents: usize,
    /// Words of bits per agent.
    words: usize,
    /// `[num_envs, n_agents, words]`, as an environment writes them.
    available: Vec<AtomicU64>,
    is_over: Vec<AtomicBool>,
    /// The last entry that was carried out.
    turn: Vec<AtomicU64>,
}

impl Reports {
    pub(super) fn new(num_envs: usize, sizes: Sizes) -> Reports {
        let Sizes { n_agents, n_actions, .. } = sizes;
        let words = n_actions.div_ceil(64);
        Reports {
            n_agents,
            words,
            available: (0..num_envs * n_agents * words).map(|_| AtomicU64::new(0)).collect(),
            is_over: (0..num_envs).map(|_| AtomicBool::new(false)).collect(),
            turn: (0..num_envs).map(|_| AtomicU64::new(0)).collect(),
        }
    }

    /// Reports that an environment has carried out its entry number `turn`.
    #[inline]
    pub(super) fn report(&self, env: usize, turn: u64, hosted: &mut HostedEnv) {
        let len = self.n_agents * self.words;
        let HostedEnv { env: state, available, is_over, .. } = hosted;
        state.write_available_bits(available);
        // Only changes are written: the thread that accepts requests has these cache lines too.
        for (to, &mut bits) in self.available[env * len..][..len].iter().zip(available) {
            if to.load(Ordering::Relaxed) != bits {
                to.store(bits, Ordering::Relaxed);
            }
        }
        if self.is_over[env].load(Ordering::Relaxed) != *is_over {
            self.is_over[env].store(*is_over, Ordering::Relaxed);
        }
        self.turn[env].store(turn, Ordering::Release);
    }

    /// The last entry of an environment that was carried out.
    #[inline]
    pub(super) fn turn(&self, env: usize) -> u64 {
        self.turn[env].load(Ordering::Acquire)
    }

    /// Whether the episode ended and the environment was not reset since.
    #[inline]
    pub(super) fn is_over(&self, env: usize) -> bool {
        self.is_over[env].load(Ordering::Relaxed)
    }

    /// `[n_agents, words]`: the actions that are available in an environment.
    #[inline]
    pub(super) fn masks(&self, env: usize) -> impl Iterator<Item = ActionMask<'_>> {
        let len = self.n_agents * self.words;
        self.available[env * len..][..len].chunks_exact(self.words).map(ActionMask)
    }
}

/// The actions that are available to an agent.
pub(super) struct ActionMask<'a>(&'a [AtomicU64]);

impl ActionMask<'_> {
    /// Whether this action is; not if there is no such action.
    #[inline]
    pub(super) fn has(&self, action: i32) -> bool {
        // Negative numbers become large ones.
        let action = action as u32;
        self.0
            .get(action as usize / 64)
            .is_some_and(|word| word.load(Ordering::Relaxed) >> (action % 64) & 1 == 1)
    }

    /// All of them.
    pub(super) fn actions(&self) -> Vec<usize> {
        (0..64 * self.0.len()).filter(|action| self.has(*action as i32)).collect()
    }
}
