//! How an idle thread waits for work or for a frame.

use crate::sync::{spin_loop, yield_now};
use std::time::{Duration, Instant};

/// How many polls there are per yield where a core is spare.
const SELDOM: u32 = 32;

/// How an idle thread waits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WaitStrategy {
    /// Polls for a while, then blocks.
    #[default]
    Adaptive,
    /// Polls without end. For machines with a spare core per waiting thread.
    Spin,
    /// Blocks at once. Costs one wake-up by the operating system per batch, and no processor time.
    Block,
}

smaclite_units::keywords!(
    WaitStrategy,
    "wait",
    "adaptive" => Adaptive,
    "spin" => Spin,
    "block" => Block,
);

impl WaitStrategy {
    /// How threads poll in and around a pool of `threads` worker threads.
    ///
    /// Waking a blocked thread costs about 50 us, so a thread polls at least that long. With a spare core it
    /// polls for 500 us, which covers most batches, and seldom yields, because what arrives during a yield
    /// waits for its end. Without one, either would take the core from a worker.
    pub fn polling(self, threads: usize) -> Polling {
        let has_spare = std::thread::available_parallelism().is_ok_and(|cores| cores.get() > threads);
        let seldom = if has_spare { SELDOM } else { 1 };
        let (time, polls_per_yield) = match self {
            WaitStrategy::Adaptive => (Some(Duration::from_micros(if has_spare { 500 } else { 50 })), seldom),
            WaitStrategy::Spin => (None, seldom),
            WaitStrategy::Block => (Some(Duration::ZERO), 1),
        };
        Polling { time, polls_per_yield }
    }
}

/// How a thread polls before it blocks.
#[derive(Clone, Copy, Debug)]
pub struct Polling {
    /// How long; `None` is without end.
    time: Option<Duration>,
    polls_per_yield: u32,
}

impl Polling {
    /// Its time starts when the clock is looked at for the first time, so that a thread that finds something
    /// at once does not look.
    pub fn begin(self) -> Polls {
        Polls { polling: self, end: None, count: 0 }
    }

    /// As if it had begun at `begin`.
    pub fn begin_at(self, begin: Instant) -> Polls {
        Polls { polling: self, end: self.time.map(|time| begin + time), count: 0 }
    }
}

/// The polls of a thread that waits.
pub struct Polls {
    polling: Polling,
    /// `None` before its time has started, and if that has no end.
    end: Option<Instant>,
    count: u32,
}

impl Polls {
    /// Pauses before the next poll. `false` if the thread should block instead.
    pub fn pause(&mut self) -> bool {
        self.pause_briefly() || self.pause_at(Instant::now())
    }

    /// Pauses if the next poll needs no yield; otherwise the caller looks at the clock and, unless it gives
    /// up, continues with [`pause_at`](Polls::pause_at).
    pub fn pause_briefly(&mut self) -> bool {
        self.count += 1;
        let is_brief = self.count < self.polling.polls_per_yield;
        if is_brief {
            spin_loop();
        }
        is_brief
    }

    /// Yields the core. `false` if the time is over at `now`, and the thread should block instead.
    pub fn pause_at(&mut self, now: Instant) -> bool {
        self.count = 0;
        let may_poll = self.polling.time.is_none_or(|time| now < *self.end.get_or_insert(now + time));
        if may_poll {
            yield_now();
        }
        may_poll
    }
}

/// Most of the time between two looks at the clock that counts as waiting.
const LONGEST_LOOK: Duration = Duration::from_millis(200);

/// How much of a timeout is left.
///
/// Waits look at the clock ten times a second or more. If much more time passes between two looks, the
/// process was stopped (Ctrl-Z, a debugger), and so was what it waits for, if that is in the same process. So
/// that time hardly counts: a training that a user stops for an hour goes on afterwards.
#[derive(Clone, Copy, Debug)]
pub struct Deadline {
    left: Duration,
    looked: Instant,
}

impl Deadline {
    /// The end of a wait that began at `begin`.
    pub fn new(begin: Instant, timeout: Duration) -> Deadline {
        Deadline { left: timeout, looked: begin }
    }

    /// What is left at `now`; zero if the wait is over.
    pub fn left(&mut self, now: Instant) -> Duration {
        let passed = now.saturating_duration_since(self.looked).min(LONGEST_LOOK);
        self.looked = now;
        self.left = self.left.saturating_sub(passed);
        self.left
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An hour between two looks counts as a fifth of a second.
    #[test]
    fn time_in_which_the_process_was_stopped_does_not_end_a_wait() {
        let begin = Instant::now();
        let [tenth, hour] = [100, 3_600_000].map(Duration::from_millis);
        let mut deadline = Deadline::new(begin, 5 * tenth);
        assert_eq!(deadline.left(begin + tenth), 4 * tenth);
        assert_eq!(deadline.left(begin + hour), 2 * tenth);
        assert_eq!(deadline.left(begin + hour + tenth), tenth);
        assert_eq!(deadline.left(begin + hour + 2 * tenth), Duration::ZERO);
        assert_eq!(Deadline::new(begin, Duration::ZERO).left(begin), Duration::ZERO);
        assert_eq!(Deadline::new(begin, Duration::MAX).left(begin + hour), Duration::MAX - 2 * tenth);
    }

    /// The clock is looked at before a yield only, and decides whether to block.
    #[test]
    fn polls_end_when_their_time_is_over() {
        let now = Instant::now();
        for threads in [0, usize::MAX] {
            assert!(
                !WaitStrategy::Block.polling(threads).begin().pause(),
                "it polled with {threads} threads"
            );
        }
        let mut waiting = WaitStrategy::Adaptive.polling(usize::MAX).begin_at(now);
        assert!(!waiting.pause_briefly(), "without a spare core, every poll is followed by a yield");
        assert!(waiting.pause_at(now) && !waiting.pause_at(now + Duration::from_micros(50)));
        let mut spinning = Polling { time: None, polls_per_yield: SELDOM }.begin_at(now);
        for _ in 0..2 {
            let n_brief =
                std::iter::repeat_with(|| spinning.pause_briefly()).take_while(|brief| *brief).count();
            assert_eq!(n_brief + 1, SELDOM as usize);
            assert!(spinning.pause_at(now + Duration::from_secs(3600)));
        }
    }
}
