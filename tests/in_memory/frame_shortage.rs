//! Lanes whose transport has no free frame: workers wait without holding a lock, and a failure is reported.

use crate::harness::{Learner, all, legal_actions, start_one};
use smaclite_pool::transport::SessionId;
use smaclite_pool::{Pool, Rejection};
use smaclite_tests::LanePlan;
use smaclite_tests::in_memory::InMemory;

const N: usize = 4;

/// A lane with one worker, after a reset, that has no frame, and legal actions for all environments.
fn lane_without_frames(batch_size: usize) -> (Pool<InMemory>, Learner, Vec<i32>) {
    let (pool, mut learner) = start_one(1, &LanePlan { batch_size, ..LanePlan::toy(N) });
    learner.send_reset_all(None);
    let mut rows = learner.rows_of_all();
    if batch_size == N {
        rows = learner.begin_shortage_of_all(&legal_actions(&rows));
    } else {
        learner.set_shortage(true);
    }
    (pool, learner, legal_actions(&rows))
}

/// The report needs a frame too: without one the lane failed silently, and its learner waited without end.
#[test]
fn a_lane_that_fails_because_it_has_no_frame_reports_it() {
    for batch_size in [N, 1] {
        let (pool, mut learner, legal) = lane_without_frames(batch_size);
        learner.send_step(&all(N), &legal);
        let rejection = learner.frame().rejection();
        let is_reported =
            matches!(&rejection, Some((0, Rejection::LaneFailed { text })) if text.contains("in use"));
        assert!(is_reported, "{rejection:?}");
        assert!(pool.lane(0).failure().is_some_and(|text| text.contains("in use")));
    }
}

/// The learner must get an answer also if its request was rejected and the rejection cannot be sent.
#[test]
fn a_lane_that_has_no_frame_for_a_rejection_fails_and_reports_it() {
    let (_pool, mut learner, _) = lane_without_frames(N);
    learner.send_step(&all(N), &[-1; 2 * N]);
    let rejection = learner.frame().rejection();
    assert!(matches!(&rejection, Some((0, Rejection::LaneFailed { .. }))), "{rejection:?}");
}

#[test]
fn a_lane_continues_when_a_frame_is_free_again() {
    for batch_size in [N, 1] {
        let (_pool, mut learner, legal) = lane_without_frames(batch_size);
        learner.send_step(&all(N), &legal);
        learner.wait_for_shortage();
        learner.set_shortage(false);
        (0..N / batch_size).for_each(|_| drop(learner.batch()));
    }
}

/// A worker held the lane's locks while it waited for a frame. The control thread, which alone can recover
/// the frames of a killed learner, waited for those locks to change the lane's session. An illegal action is
/// rejected while the request is accepted, a legal one needs a slot after its environment was stepped: both
/// must wait without a lock.
#[test]
fn the_session_of_a_lane_that_waits_for_a_frame_can_be_changed() {
    for batch_size in [N, 1] {
        for is_legal in [true, false] {
            let (pool, mut learner, legal) = lane_without_frames(batch_size);
            let actions = if is_legal { legal } else { vec![-1; 2 * N] };
            learner.send_step(&all(N), &actions);
            learner.wait_for_shortage();
            pool.lane(0).set_session(Some(SessionId(2)));
            learner.set_shortage(false);
            assert_eq!(pool.lane(0).failure(), None);
            (learner.session, learner.number) = (2, 0);
            learner.send_reset_all(None);
            assert_eq!(learner.rows_of_all().len(), N);
            assert!(learner.has_no_frame(), "a request of the old session was answered");
        }
    }
}
