//! How an idle thread waits for work or for a frame.

use std::time::Duration;

/// How an idle thread waits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WaitStrategy {
    /// Polls for a while, yielding the core between polls, then blocks.
    #[default]
    Adaptive,
    /// Polls without end, yielding the core between polls. For machines with a spare core per waiting thread.
    Spin,
    /// Blocks at once. Costs one wake-up by the operating system per batch, and no processor time.
    Block,
}

impl WaitStrategy {
    const ALL: [WaitStrategy; 3] = [WaitStrategy::Adaptive, WaitStrategy::Spin, WaitStrategy::Block];

    /// The keyword used in options and Python.
    pub fn name(self) -> &'static str {
        match self {
            WaitStrategy::Adaptive => "adaptive",
            WaitStrategy::Spin => "spin",
            WaitStrategy::Block => "block",
        }
    }

    /// How long to poll before blocking, in and around a pool of `threads` worker threads; `None` is without
    /// end.
    ///
    /// Waking a blocked thread costs about 50 us, so a thread polls at least that long. With a spare core it
    /// polls for 500 us, which covers most batches; without one, longer polling would take the core from a
    /// worker.
    pub fn spin_time(self, threads: usize) -> Option<Duration> {
        let cores = || std::thread::available_parallelism().map_or(1, |n| n.get());
        match self {
            WaitStrategy::Adaptive if cores() > threads => Some(Duration::from_micros(500)),
            WaitStrategy::Adaptive => Some(Duration::from_micros(50)),
            WaitStrategy::Spin => None,
            WaitStrategy::Block => Some(Duration::ZERO),
        }
    }
}

/// A keyword that names no wait strategy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the wait strategy must be `adaptive`, `spin` or `block`, got `{0}`")]
pub struct UnknownWaitStrategy(pub String);

impl std::str::FromStr for WaitStrategy {
    type Err = UnknownWaitStrategy;

    fn from_str(keyword: &str) -> Result<Self, UnknownWaitStrategy> {
        let strategy = WaitStrategy::ALL.into_iter().find(|strategy| strategy.name() == keyword);
        strategy.ok_or_else(|| UnknownWaitStrategy(keyword.to_owned()))
    }
}
