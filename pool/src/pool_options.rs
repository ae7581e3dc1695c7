//! How many threads a pool has, and how they wait.

use crate::wait_strategy::WaitStrategy;

/// How a pool runs.
#[derive(Clone, Copy, Debug)]
pub struct PoolOptions {
    /// Threads that step environments, at least 1. While a learner of this process waits for a batch, its
    /// thread is one of them.
    pub threads: usize,
    /// How idle workers wait.
    pub wait: WaitStrategy,
}

impl Default for PoolOptions {
    /// One thread per core that this process may use, for learners of the process.
    fn default() -> Self {
        PoolOptions { threads: cores(), wait: WaitStrategy::default() }
    }
}

impl PoolOptions {
    /// One thread per core that this process may use, less one for a learner in another process.
    pub fn for_other_processes() -> PoolOptions {
        PoolOptions { threads: (cores() - 1).max(1), wait: WaitStrategy::default() }
    }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_learner_in_another_process_has_a_core_of_its_own_if_there_are_several() {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        assert_eq!(PoolOptions::default().threads, cores);
        let rest = if cores == 1 { 1 } else { cores - 1 };
        assert_eq!(PoolOptions::for_other_processes().threads, rest);
    }
}
