//! Forks after attaching: an error in the child, and the parent undisturbed.

#![allow(unsafe_code)] // `fork`

use crate::assert_says;
use smaclite_ipc::{ClientError, Supervisor, WaitOptions, WaitStrategy};
use smaclite_tests::pools::process::{SOON, eventually};
use smaclite_tests::pools::{Child, LanePlan, Player, PoolPlan, Room};
use std::panic::AssertUnwindSafe;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;

/// What the child found, as its exit status.
const FORKED_ERROR: i32 = 42;

/// Runs `child` in a fork and returns its exit status. The child leaves without running destructors of its
/// own, unless `child` drops something.
fn in_a_fork(child: impl FnOnce() -> i32) -> i32 {
    // SAFETY: other threads of this process do not exist in the child, which uses no lock that one of them
    // could hold: it asks a client, drops its values, and leaves by `_exit`.
    unsafe {
        match libc::fork() {
            0 => {
                libc::alarm(20); // a deadlock is to fail, not to hang
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
fn a_forked_child_gets_an_error_and_the_parent_goes_on() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4)]);
    let supervisor = Supervisor::start(plan.config(room.runtime_dir())).expect("a pool");
    let mut player = Player::connect(room.runtime_dir(), "train", &plan.lanes[0]).expect("a client");
    player.reset(None, SOON).expect("a reset");
    let batch = player.step(SOON).expect("a step");
    let bytes = batch.bytes().to_vec();
    let mut held = Some((player, batch, supervisor));
    let status = in_a_fork(|| {
        let (mut player, batch, supervisor) = held.take().expect("the child's copy");
        let error = player.client().send_reset(None, None, WaitOptions::forever());
        drop((player, batch, supervisor)); // as an interpreter's exit does
        if matches!(error, Err(ClientError::Forked { .. })) { FORKED_ERROR } else { 1 }
    });
    assert_eq!(status, FORKED_ERROR);
    let (mut player, batch, supervisor) = held.take().expect("the parent's own");
    for _ in 0..20 {
        player.step(SOON).expect("the parent goes on");
    }
    assert_eq!(batch.bytes(), bytes);
    // A child that outlives the client keeps nothing of it alive.
    drop(player);
    let mut held = Some((batch, supervisor));
    let status = in_a_fork(|| {
        drop(held.take());
        0
    });
    assert_eq!(status, 0);
    let mut player = Player::connect(room.runtime_dir(), "train", &plan.lanes[0]).expect("still served");
    player.reset(None, SOON).expect("a reset");
    player.step(SOON).expect("a step");
}

/// Reading a batch once locked a mutex of its port. A child that was forked while another thread had it, in
/// `recv` or reading as well, hung at its first look at a batch.
#[test]
fn a_child_reads_a_batch_of_its_parent_whatever_other_threads_did_at_the_fork() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let _supervisor = Supervisor::start(plan.config(room.runtime_dir())).expect("a pool");
    let lane = &plan.lanes[0];
    let mut player =
        Player::connect_waiting(room.runtime_dir(), "train", lane, WaitStrategy::Spin).expect("a client");
    player.reset(None, SOON).expect("a reset");
    let batch = player.step(SOON).expect("a step");
    let bytes = batch.bytes().to_vec();
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let stepping = scope.spawn(|| {
            while !stop.load(Ordering::Relaxed) {
                player.step(SOON).expect("the parent goes on");
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

/// The end of a pool once waited for the end of a socket of which every forked child has a copy, and learners
/// of other processes did not hear of it for the same reason. With a child that waited for its parent this
/// was a deadlock.
#[test]
fn a_pool_ends_while_a_forked_child_lives() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2), LanePlan::new("3s5z", 2)]);
    let supervisor = Supervisor::start(plan.config(room.runtime_dir())).expect("a pool");
    let mut player = Player::connect(room.runtime_dir(), "train", &plan.lanes[0]).expect("a client");
    player.reset(None, SOON).expect("a reset");
    let mut other = Child::attached(&room, &plan.lanes[1]);
    other.must("reset");
    other.must("run");
    // SAFETY: the child waits for a signal and touches nothing of its parent.
    let child = unsafe {
        match libc::fork() {
            0 => {
                libc::alarm(120); // should this test be gone
                libc::pause();
                libc::_exit(0)
            }
            child => child,
        }
    };
    let (done, ended) = channel();
    std::thread::spawn(move || {
        drop((player, supervisor));
        let _ = done.send(());
    });
    let ended = ended.recv_timeout(SOON);
    let told = other.answer(SOON);
    let _ = other.ask("disconnect");
    let nothing_left = eventually(|| room.files().is_empty());
    // SAFETY: the child was not waited for before, so the number is still its.
    unsafe {
        libc::kill(child, libc::SIGKILL);
        libc::waitpid(child, std::ptr::null_mut(), 0);
    }
    ended.expect("the pool ends though the child lives");
    assert_says(&told.expect_err("the pool is gone"), &["supervisor", "`train`", "gone"]);
    assert!(nothing_left, "left behind: {:#?}", room.files());
}
