//! The orders of accepted requests that no thread has taken yet: one [`Work`] per lane, which is a queue of
//! environments in one piece or in one piece per thread.
//!
//! A synchronous request names all environments, so it is a parallel loop: the queue has each environment at
//! its own position and is divided into one range per thread. A thread takes chunks from the front of its own
//! range, whose environments are in its core's cache, and then from the back of the others' (work stealing).
//! In an asynchronous lane there is one range, from whose front every thread takes single environments, in
//! the order of the requests, and at whose end later requests are added.
//!
//! Synchronisation: publishing or extending a range releases what the publisher wrote before (the orders, the
//! frame), and taking acquires it. A take that compares with an old value of a range fails, or finds the same
//! numbers published again; then it takes part in the new request, as any thread may. The place of a position
//! is written again only when a later position was added, which an environment has, so after it was taken: a
//! thread that reads a place, and then takes it because no other thread has, has read it in time. So that no
//! processor moves the read behind the take, the take releases, too.

use crate::sync::{AtomicU32, AtomicU64, Ordering};
use crossbeam::utils::CachePadded;
use std::ops::Range;

/// Most environments that a thread takes at a time: enough to make taking cheap, few enough that lanes take
/// turns. After as many the server looks for requests.
pub(crate) const CHUNK: usize = 16;

/// The environments that are left to take.
pub(crate) struct Work {
    num_envs: usize,
    /// Most environments that are taken at a time.
    most: u32,
    /// The positions that are left, from begin to end, which wrap around: `begin << 32 | end`.
    left: Vec<CachePadded<AtomicU64>>,
    /// The environment of each position, modulo the length, which is a power of two.
    envs: Vec<AtomicU32>,
}

/// `begin` and the number of positions.
fn unpack(packed: u64) -> (u32, u32) {
    let (begin, end) = ((packed >> 32) as u32, packed as u32);
    (begin, end.wrapping_sub(begin))
}

fn pack(begin: u32, count: u32) -> u64 {
    u64::from(begin) << 32 | u64::from(begin.wrapping_add(count))
}

impl Work {
    pub(crate) fn new(num_envs: usize, synchronous: bool, threads: usize) -> Work {
        let (ranges, most) = if synchronous { (threads, CHUNK as u32) } else { (1, 1) };
        Work {
            num_envs,
            most,
            left: (0..ranges).map(|_| CachePadded::new(AtomicU64::new(0))).collect(),
            envs: (0..num_envs.next_power_of_two() as u32).map(AtomicU32::new).collect(),
        }
    }

    /// Begins a loop over all environments of a synchronous lane; the last one must have ended. Returns for
    /// how many threads it is work.
    pub(crate) fn publish(&self) -> usize {
        let (envs, threads) = (self.num_envs, self.left.len());
        for (i, left) in self.left.iter().enumerate() {
            let (begin, end) = (i * envs / threads, (i + 1) * envs / threads);
            left.store(pack(begin as u32, (end - begin) as u32), Ordering::Release);
        }
        threads.min(envs)
    }

    /// Adds environments of an asynchronous lane. One thread at a time does so, and no environment is added
    /// again before its order was carried out.
    pub(crate) fn add(&self, envs: &[u32]) {
        let left = &self.left[0];
        let mut seen = left.load(Ordering::Relaxed);
        let end = seen as u32; // no other thread changes it
        for (env, i) in envs.iter().zip(0..) {
            self.place(end.wrapping_add(i)).store(*env, Ordering::Relaxed);
        }
        loop {
            let (begin, count) = unpack(seen);
            let more = pack(begin, count + envs.len() as u32);
            match left.compare_exchange_weak(seen, more, Ordering::Release, Ordering::Relaxed) {
                Ok(_) => return,
                Err(now) => seen = now,
            }
        }
    }

    fn place(&self, position: u32) -> &AtomicU32 {
        &self.envs[position as usize & (self.envs.len() - 1)]
    }

    /// Takes some environments, by preference those of the thread with this number.
    pub(crate) fn take(&self, thread: usize) -> Option<Range<usize>> {
        let ranges = self.left.len();
        (0..ranges).find_map(|i| self.take_from((thread + i) % ranges, i == 0))
    }

    /// Takes half of a range, so that the threads end together.
    fn take_from(&self, index: usize, is_own: bool) -> Option<Range<usize>> {
        let left = &self.left[index];
        let mut seen = left.load(Ordering::Acquire);
        loop {
            let (begin, count) = unpack(seen);
            if count == 0 {
                return None;
            }
            let share = if self.left.len() == 1 { count } else { count.div_ceil(2) };
            let taken = share.min(self.most);
            let rest = count - taken;
            let (first, rest) = if is_own {
                (begin, pack(begin.wrapping_add(taken), rest))
            } else {
                (begin + rest, pack(begin, rest))
            };
            let env = self.place(first).load(Ordering::Relaxed) as usize;
            match left.compare_exchange_weak(seen, rest, Ordering::AcqRel, Ordering::Acquire) {
                Ok(_) => return Some(env..env + taken as usize),
                Err(now) => seen = now,
            }
        }
    }

    /// Whether there is nothing to take.
    pub(crate) fn is_empty(&self) -> bool {
        self.left.iter().all(|left| unpack(left.load(Ordering::Relaxed)).1 == 0)
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn every_environment_is_taken_once_whoever_takes_it() {
        for (num_envs, threads) in [(1, 1), (1, 3), (7, 2), (64, 1), (64, 3), (1000, 16)] {
            let work = Work::new(num_envs, true, threads);
            for round in 0..3 {
                assert!(work.is_empty());
                assert_eq!(work.publish(), num_envs.min(threads));
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
        work.publish();
        let taken: Vec<_> = std::iter::from_fn(|| work.take(1)).collect();
        assert_eq!(taken, [4..6, 6..7, 7..8, 2..4, 1..2, 0..1]);
    }

    /// Beyond the largest position, behind which comes 0.
    #[test]
    fn environments_of_an_asynchronous_lane_are_taken_in_the_order_of_the_requests() {
        let work = Work::new(5, false, 2);
        work.left[0].store(pack(u32::MAX - 3, 0), Ordering::Relaxed);
        for requests in [[&[3, 0][..], &[4]], [&[1, 2], &[0, 3, 4]], [&[4, 1, 0, 2, 3], &[]]] {
            requests.iter().for_each(|envs| work.add(envs));
            let taken: Vec<_> = std::iter::from_fn(|| work.take(1)).collect();
            let expected: Vec<_> = requests.concat().iter().map(|env| *env as usize).collect();
            assert_eq!(taken, expected.iter().map(|env| *env..env + 1).collect::<Vec<_>>());
            assert!(work.is_empty());
        }
    }
}

/// In every interleaving (`just loom`).
#[cfg(all(test, loom))]
mod loom_tests {
    use super::*;
    use loom::sync::Arc;

    /// A thread pauses between the look at a range and the take, in which time the other environment is
    /// taken, carried out and added again: to the place that the first thread reads.
    #[test]
    fn a_place_is_read_before_it_is_written_again() {
        loom::model(|| {
            let work = Arc::new(Work::new(2, false, 2));
            work.add(&[0, 1]);
            let other = loom::thread::spawn({
                let work = Arc::clone(&work);
                move || work.take(0)
            });
            let first = work.take(1).expect("one of two").start;
            work.add(&[first as u32]);
            let rest: Vec<_> = std::iter::from_fn(|| work.take(1)).chain(other.join().unwrap()).collect();
            let mut envs: Vec<_> = rest.into_iter().map(|envs| envs.start).collect();
            envs.extend(std::iter::from_fn(|| work.take(1)).map(|envs| envs.start));
            envs.sort_unstable();
            assert_eq!(envs, [0, 1], "the other one, and this one again");
        });
    }
}
