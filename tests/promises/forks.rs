//! Forks after attaching: an error in the child, and the parent undisturbed.

#![allow(unsafe_code)] // `fork`

use smaclite_ipc::{ClientError, Supervisor};
use smaclite_tests::pools::process::SOON;
use smaclite_tests::pools::{LanePlan, Player, PoolPlan, Room};

/// What the child found, as its exit status.
const FORKED_ERROR: i32 = 42;

/// Runs `child` in a fork and returns its exit status. The child leaves without running destructors of its own, unless
/// `child` drops something.
fn in_a_fork(child: impl FnOnce() -> i32) -> i32 {
    // SAFETY: other threads of this process do not exist in the child, which uses no lock that one of them could hold:
    // it asks a client, drops its values, and leaves by `_exit`.
    unsafe {
        match libc::fork() {
            0 => {
                libc::alarm(20); // a deadlock is to fail, not to hang
                let status = std::panic::catch_unwind(std::panic::AssertUnwindSafe(child)).unwrap_or(101);
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
    let supervisor = Supervisor::start(plan.config(room.place())).expect("a pool");
    let mut player = Player::connect(room.place(), "train", &plan.lanes[0]).expect("a client");
    player.reset(None, SOON).expect("a reset");
    let batch = player.step(SOON).expect("a step");
    let bytes = batch.bytes().to_vec();
    let mut held = Some((player, batch, supervisor));
    let status = in_a_fork(|| {
        let (mut player, batch, supervisor) = held.take().expect("the child's copy");
        let error = player.client().send_reset(None, None);
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
    let mut player = Player::connect(room.place(), "train", &plan.lanes[0]).expect("still served");
    player.reset(None, SOON).expect("a reset");
    player.step(SOON).expect("a step");
}
