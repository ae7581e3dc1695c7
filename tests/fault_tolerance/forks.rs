//! Forks after attaching: the child gets an error, and the parent is not disturbed.

#![allow(unsafe_code)] // `fork`

use crate::assert_contains;
use smaclite_ipc::{ClientError, Order, WaitOptions, WaitStrategy};
use smaclite_tests::process::{TIMEOUT, eventually};
use smaclite_tests::{Child, LanePlan, Learner, PoolPlan, TestDir};
use std::panic::AssertUnwindSafe;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;

/// Exit status of a child that got the expected error.
const FORKED_ERROR: i32 = 42;

/// Runs `child` in a forked process and returns its exit status. Only what `child` drops is dropped there.
fn in_a_fork(child: impl FnOnce() -> i32) -> i32 {
    // SAFETY: other threads of this process do not exist in the child, which uses no lock that one of them
    // could hold: it calls a client, drops its values, and ends with `_exit`.
    unsafe {
        match libc::fork() {
            0 => {
                libc::alarm(20); // turns a deadlock into a failure
                let status = std::panic::catch_unwind(AssertUnwindSafe(child)).unwrap_or(101);
                libc::_exit(status)
            }
            child => {
                let mut status = 0;
                assert_eq!(libc::waitpid(child, &mut status, 0), child);
                assert!(libc::WIFEXITED(status), "the child died: {status:#x}");
                libc::WEXITSTATUS(status)
            }
        }
    }
}

#[test]
fn a_forked_child_gets_an_error_and_the_parent_continues() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4)]);
    let supervisor = dir.start(&plan);
    let mut learner = dir.learner(&plan.lanes[0]);
    learner.reset(None, TIMEOUT).expect("a reset");
    let batch = learner.step(TIMEOUT).expect("a step");
    let bytes = batch.bytes().to_vec();
    let mut held = Some((learner, batch, supervisor));
    let status = in_a_fork(|| {
        let (mut learner, batch, supervisor) = held.take().expect("the child's copy");
        let error = learner.client().send(Order::reset(None), None, WaitOptions::forever());
        drop((learner, batch, supervisor)); // as an interpreter's exit does
        if matches!(error, Err(ClientError::Forked { .. })) { FORKED_ERROR } else { 1 }
    });
    assert_eq!(status, FORKED_ERROR);
    let (mut learner, batch, supervisor) = held.take().expect("the parent's values");
    for _ in 0..20 {
        learner.step(TIMEOUT).expect("the parent continues");
    }
    assert_eq!(batch.bytes(), bytes);
    // A child that outlives the client keeps none of its resources.
    drop(learner);
    let mut held = Some((batch, supervisor));
    let status = in_a_fork(|| {
        drop(held.take());
        0
    });
    assert_eq!(status, 0);
    let mut learner = dir.learner(&plan.lanes[0]);
    learner.reset(None, TIMEOUT).expect("a reset");
    learner.step(TIMEOUT).expect("a step");
}

/// Reading a batch locked a mutex of its port. A child that was forked while another thread held it, in
/// `recv` or for reading, hung as soon as it read a batch.
#[test]
fn a_forked_child_can_read_a_batch_whatever_other_threads_do_at_the_fork() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let _supervisor = dir.start(&plan);
    let lane = &plan.lanes[0];
    let mut learner =
        Learner::connect_waiting(dir.runtime_dir(), "train", lane, WaitStrategy::Spin).expect("a client");
    learner.reset(None, TIMEOUT).expect("a reset");
    let batch = learner.step(TIMEOUT).expect("a step");
    let bytes = batch.bytes().to_vec();
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let stepping = scope.spawn(|| {
            while !stop.load(Ordering::Relaxed) {
                learner.step(TIMEOUT).expect("the parent continues");
            }
        });
        let reading = || {
            while !stop.load(Ordering::Relaxed) && batch.bytes().len() == bytes.len() {
                std::hint::spin_loop();
            }
        };
        (0..2).for_each(|_| drop(scope.spawn(reading)));
        let read = std::panic::catch_unwind(AssertUnwindSafe(|| {
            (0..300).for_each(|_| assert_eq!(in_a_fork(|| i32::from(batch.bytes() != bytes)), 0));
        }));
        stop.store(true, Ordering::Relaxed);
        stepping.join().expect("the parent's other thread");
        assert!(read.is_ok(), "a child did not read the batch");
    });
}

/// Where pools do not use Linux's sockets, a child hung whose parent's other threads used a connection at the
/// moment of the fork.
#[test]
fn a_forked_child_can_ask_a_pool_whatever_other_threads_do_at_the_fork() {
    let dir = TestDir::new();
    let _supervisor = Child::supervisor(&dir, &PoolPlan::new([LanePlan::new("2s3z", 2)]));
    let ask = || smaclite_ipc::status(dir.runtime_dir(), "train", WaitOptions::for_response());
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let asking = scope.spawn(|| {
            while !stop.load(Ordering::Relaxed) {
                ask().expect("a status");
            }
        });
        let asked = std::panic::catch_unwind(AssertUnwindSafe(|| {
            (0..200).for_each(|_| assert_eq!(in_a_fork(|| i32::from(ask().is_err())), 0));
        }));
        stop.store(true, Ordering::Relaxed);
        asking.join().expect("the parent's other thread");
        assert!(asked.is_ok(), "a child got no answer");
    });
}

/// The end of a pool waited until a socket was closed of which every forked child has a copy, and for the
/// same reason learners of other processes were not notified. If the child waited for its parent, this was a
/// deadlock.
#[test]
fn a_pool_ends_while_a_forked_child_lives() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2), LanePlan::new("3s5z", 2)]);
    let supervisor = dir.start(&plan);
    let mut learner = dir.learner(&plan.lanes[0]);
    learner.reset(None, TIMEOUT).expect("a reset");
    let mut other = Child::attached(&dir, &plan.lanes[1]);
    other.must("reset");
    other.must("run");
    // SAFETY: the child waits for a signal and uses nothing of its parent.
    let child = unsafe {
        match libc::fork() {
            0 => {
                libc::alarm(120); // if this test is killed
                libc::pause();
                libc::_exit(0)
            }
            child => child,
        }
    };
    let (done, ended) = channel();
    std::thread::spawn(move || {
        drop((learner, supervisor));
        let _ = done.send(());
    });
    let ended = ended.recv_timeout(TIMEOUT);
    let answer = other.answer(TIMEOUT);
    let _ = other.ask("disconnect");
    let nothing_left = eventually(|| dir.files().is_empty());
    // SAFETY: the child has not been waited for, so this is still its process id.
    unsafe {
        libc::kill(child, libc::SIGKILL);
        libc::waitpid(child, std::ptr::null_mut(), 0);
    }
    ended.expect("the pool ends while the child lives");
    assert_contains(&answer.expect_err("the pool is gone"), &["supervisor", "`train`", "gone"]);
    assert!(nothing_left, "left behind: {:#?}", dir.files());
}
