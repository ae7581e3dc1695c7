//! The environments of accepted requests that no thread has taken yet: one [`Work`] per lane.
//!
//! A synchronous request names all environments, so it is a parallel loop. The environments are divided into
//! one range per thread of the pool; a thread takes chunks from the front of its own range, whose
//! environments are in its core's cache, and then from the back of the others' (work stealing). An
//! asynchronous lane has one queue, from which every thread takes single environments in the order of the
//! requests.
//!
//! Synchronisation: publishing a range or pushing to the queue releases what the publisher wrote before (the
//! environments' orders, the frame), and taking acquires it. A take that compares with an old value of a
//! range fails, or finds the same numbers published again; then it takes part in the new request, as any
//! thread may.

use crate::sync::{ArrayQueue, AtomicU64, Ordering};
use crossbeam::utils::CachePadded;
use std::ops::Range;

/// Most environments that a thread takes at a time: enough to make taking cheap, few enough that lanes take
/// turns. After as many a busy worker accepts what was sent to an idle lane.
pub(crate) const CHUNK: usize = 16;

/// What is to be done in a lane.
#[allow(clippy::large_enum_variant, reason = "there is one per lane")]
pub(crate) enum Work {
    Synchronous(Ranges),
    Asynchronous(ArrayQueue<u32>),
}

/// A parallel loop over all environments.
pub(crate) struct Ranges {
    num_envs: usize,
    /// By thread: `begin << 32 | end` of the environments that are left.
    left: Vec<CachePadded<AtomicU64>>,
}

fn pack(range: &Range<usize>) -> u64 {
    (range.start as u64) << 32 | range.end as u64
}

fn unpack(packed: u64) -> Range<usize> {
    (packed >> 32) as usize..packed as u32 as usize
}

impl Work {
    pub(crate) fn new(num_envs: usize, synchronous: bool, threads: usize) -> Work {
        if synchronous {
            let left = (0..threads).map(|_| CachePadded::new(AtomicU64::new(0))).collect();
            Work::Synchronous(Ranges { num_envs, left })
        } else {
            Work::Asynchronous(ArrayQueue::new(num_envs))
        }
    }

    /// Takes some environments, by preference those of the thread with this number.
    pub(crate) fn take(&self, thread: usize) -> Option<Range<usize>> {
        match self {
            Work::Synchronous(ranges) => ranges.take(thread),
            Work::Asynchronous(queue) => queue.pop().map(|env| env as usize..env as usize + 1),
        }
    }

    /// Whether there is something to take.
    pub(crate) fn is_empty(&self) -> bool {
        match self {
            Work::Synchronous(ranges) => ranges.is_empty(),
            Work::Asynchronous(queue) => queue.is_empty(),
        }
    }
}

impl Ranges {
    /// Begins a loop over all environments; the last one must have ended. Returns how many threads it is for.
    pub(crate) fn publish(&self) -> usize {
        let (envs, threads) = (self.num_envs, self.left.len());
        for (i, left) in self.left.iter().enumerate() {
            left.store(pack(&(i * envs / threads..(i + 1) * envs / threads)), Ordering::Release);
        }
        threads.min(envs)
    }

    fn take(&self, thread: usize) -> Option<Range<usize>> {
        let threads = self.left.len();
        (0..threads).find_map(|i| self.take_from((thread + i) % threads, i == 0))
    }

    /// Takes half of a range, at most [`CHUNK`], so that the threads end together.
    fn take_from(&self, index: usize, is_own: bool) -> Option<Range<usize>> {
        let left = &self.left[index];
        let mut seen = left.load(Ordering::Relaxed);
        loop {
            let range = unpack(seen);
            if range.is_empty() {
                return None;
            }
            let share = if self.left.len() == 1 { range.len() } else { range.len().div_ceil(2) };
            let count = share.min(CHUNK);
            let (taken, rest) = if is_own {
                (range.start..range.start + count, range.start + count..range.end)
            } else {
                (range.end - count..range.end, range.start..range.end - count)
            };
            match left.compare_exchange_weak(seen, pack(&rest), Ordering::Acquire, Ordering::Relaxed) {
                Ok(_) => return Some(taken),
                Err(now) => seen = now,
            }
        }
    }

    fn is_empty(&self) -> bool {
        self.left.iter().all(|left| unpack(left.load(Ordering::Relaxed)).is_empty())
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn every_environment_is_taken_once_whoever_takes_it() {
        for (num_envs, threads) in [(1, 1), (1, 3), (7, 2), (64, 1), (64, 3), (1000, 16)] {
            let work = Work::new(num_envs, true, threads);
            let Work::Synchronous(ranges) = &work else { unreachable!("a synchronous lane") };
            for round in 0..3 {
                assert!(work.is_empty());
                assert_eq!(ranges.publish(), num_envs.min(threads));
                let mut taken = vec![0; num_envs];
                for thread in (round..).step_by(7) {
                    let Some(chunk) = work.take(thread % threads) else { break };
                    assert!((1..=CHUNK).contains(&chunk.len()));
                    chunk.for_each(|env| taken[env] += 1);
                }
                assert!(taken.iter().all(|times| *times == 1), "{num_envs} {threads}: {taken:?}");
            }
        }
    }

    #[test]
    fn a_thread_takes_its_own_environments_from_the_front_and_those_of_others_from_the_back() {
        let work = Work::new(8, true, 2);
        let Work::Synchronous(ranges) = &work else { unreachable!("a synchronous lane") };
        ranges.publish();
        let taken: Vec<_> = std::iter::from_fn(|| work.take(1)).collect();
        assert_eq!(taken, [4..6, 6..7, 7..8, 2..4, 1..2, 0..1]);
    }
}
