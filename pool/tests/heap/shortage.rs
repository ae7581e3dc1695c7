//! Lanes whose transport has no frame to fill: workers wait without a lock, and a failure is reported.

use crate::game::Oddity;
use crate::harness::{LaneSetup, Learner, Row, all, start};
use crate::transport::Heap;
use smaclite_pool::transport::SessionId;
use smaclite_pool::{Pool, Rejection};

const N: usize = 4;

/// A lane with one worker whose learner was reset, and legal actions for all environments.
fn reset_lane(batch_size: usize) -> (Pool<Heap>, Learner, Vec<i32>) {
    let (pool, mut learners) =
        start(1, &[LaneSetup { batch_size, ..LaneSetup::new(N) }], |_, _| Oddity::default());
    let mut learner = learners.remove(0);
    let mut rows = reset(&mut learner);
    rows.sort_by_key(|row| row.env);
    let legal = rows.iter().flat_map(Row::legal_actions).collect();
    (pool, learner, legal)
}

fn reset(learner: &mut Learner) -> Vec<Row> {
    learner.send_reset(None, &all(N), N);
    (0..N / learner.layout.slots()).flat_map(|_| learner.batch()).collect()
}

/// The report needed a frame, too: where there was none the lane failed silently, and its learner hung.
#[test]
fn a_lane_that_fails_because_it_has_no_frame_says_so() {
    for batch_size in [N, 1] {
        let (pool, mut learner, legal) = reset_lane(batch_size);
        learner.set_shortage(true);
        learner.send_step(&all(N), &legal);
        let rejection = learner.frame().rejection();
        let said = matches!(&rejection, Some((0, Rejection::LaneFailed { text })) if text.contains("in use"));
        assert!(said, "{rejection:?}");
        assert!(pool.failure(0).is_some_and(|text| text.contains("in use")));
    }
}

/// A rejection that cannot be sent is no reason to leave the learner waiting, either.
#[test]
fn a_lane_that_has_no_frame_for_a_rejection_fails_and_says_so() {
    let (_pool, mut learner, _) = reset_lane(N);
    learner.set_shortage(true);
    learner.send_step(&all(N), &[-1; 2 * N]);
    let rejection = learner.frame().rejection();
    assert!(matches!(&rejection, Some((0, Rejection::LaneFailed { .. }))), "{rejection:?}");
}

#[test]
fn a_lane_goes_on_when_a_frame_comes_back() {
    for batch_size in [N, 1] {
        let (_pool, mut learner, legal) = reset_lane(batch_size);
        learner.set_shortage(true);
        learner.send_step(&all(N), &legal);
        learner.wait_for_shortage();
        learner.set_shortage(false);
        (0..N / batch_size).for_each(|_| drop(learner.batch()));
    }
}

/// A worker slept with the lane's locks until a frame came back, and the control thread, which alone can
/// bring one back from a killed learner, waited for those locks to change the lane's session. An illegal
/// action is refused by the leader as it accepts, a legal one needs a slot after its environment was stepped:
/// both wait without a lock.
#[test]
fn the_session_of_a_lane_that_waits_for_a_frame_can_be_changed() {
    for batch_size in [N, 1] {
        for is_legal in [true, false] {
            let (pool, mut learner, legal) = reset_lane(batch_size);
            learner.set_shortage(true);
            let actions = if is_legal { legal } else { vec![-1; 2 * N] };
            learner.send_step(&all(N), &actions);
            learner.wait_for_shortage();
            pool.set_session(0, Some(SessionId(2)));
            learner.set_shortage(false);
            assert_eq!(pool.failure(0), None);
            (learner.session, learner.number) = (2, 0);
            assert_eq!(reset(&mut learner).len(), N);
            assert!(learner.hears_nothing(), "what the old session asked for is dropped");
        }
    }
}
