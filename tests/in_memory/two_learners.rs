//! Lanes with a learner for each side, of which one may have left or may send anything.

use crate::harness::{Learner, all, start_one, wait_until};
use smaclite_engine::policy::Tactic;
use smaclite_engine::{EnemySide, Faction};
use smaclite_pool::fields::Field;
use smaclite_pool::transport::{RequestKind, SessionId};
use smaclite_pool::{Pool, Rejection};
use smaclite_tests::LanePlan;
use smaclite_tests::in_memory::InMemory;

const N: usize = 2;
/// Of each side of the map.
const UNITS: usize = 3;
const RESET: RequestKind = RequestKind::Reset { seed: None, levels: false };
const STOP: i32 = 1;
const ALLIES: Option<Faction> = Some(Faction::Ally);
const ENEMIES: Option<Faction> = Some(Faction::Enemy);

/// A lane after its first reset. The harness sends the requests of both learners.
fn reset_lane() -> (Pool<InMemory>, Learner) {
    let plan = LanePlan {
        fields: Some(vec!["obs".into(), "level".into(), "snapshot".into()]),
        ..LanePlan::new("3m", N)
    };
    let plan = plan.both_sides(EnemySide { mirror: false, zero_sum: false });
    let (pool, mut learner) = start_one(1, &plan);
    send_both(&mut learner, RESET, &[]);
    assert_eq!(learner.frame().rejection(), None);
    (pool, learner)
}

/// Both learners send the same.
fn send_both(learner: &mut Learner, kind: RequestKind, actions: &[i32]) {
    learner.number += 1;
    learner.send_half(ALLIES, kind, &all(N), actions);
    learner.send_half(ENEMIES, kind, &all(N), actions);
}

/// The step of a learner that left afterwards once counted as the whole request: the survivor's units went on
/// with its old actions, and its own step was refused because the number was used up.
#[test]
fn a_step_of_a_learner_that_has_left_is_not_made() {
    let (pool, mut learner) = reset_lane();
    pool.lane(0).stand_in(Faction::Enemy, Tactic::Nearest);
    learner.number += 1;
    let actions = [STOP; N * UNITS];
    learner.send_half(ENEMIES, RequestKind::Step, &all(N), &actions);
    learner.send_half(ALLIES, RequestKind::Step, &all(N), &actions);
    assert_eq!(learner.frame().rejection(), None);
    // The next one is, so there was one answer to two messages.
    learner.number += 1;
    learner.send_half(ALLIES, RequestKind::Step, &all(N), &actions);
    assert_eq!(learner.frame().rejection(), None);
    assert!(learner.has_no_frame());
    let stats = pool.lane(0).stats();
    assert_eq!((stats.accepted, stats.rejected, stats.steps), (3, 0, 2 * N as u64));
}

/// The lane once took the kind of the enemies' reset, with levels, and the body of the allies', without: it
/// began episodes with levels that nobody had sent, and failed.
#[test]
fn a_learner_of_one_side_chooses_no_levels_and_restores_nothing() {
    let (_pool, mut learner) = reset_lane();
    let levels = RequestKind::Reset { seed: None, levels: true };
    let restore = RequestKind::Restore { seed: None };
    let body = vec![0; N * 2 * UNITS * 5];
    for (allies, enemies) in [(RESET, levels), (levels, RESET), (levels, levels), (restore, restore)] {
        learner.number += 1;
        for (side, kind) in [(ALLIES, allies), (ENEMIES, enemies)] {
            learner.send_half(side, kind, &all(N), if kind == RESET { &[] } else { &body });
        }
        let text = learner.rejection().to_string();
        assert!(
            text.contains("a learner of one side cannot restore or fork battles or choose levels"),
            "{text}"
        );
    }
    send_both(&mut learner, RequestKind::Step, &[STOP; N * UNITS]);
    assert_eq!(learner.frame().rejection(), None, "the lane goes on");
}

/// Of a reset the seed of either learner counts; that of the allies if both give one.
#[test]
fn either_learner_can_give_the_seed_of_a_reset() {
    let (_pool, mut learner) = reset_lane();
    let mut states = |seeds: [Option<u64>; 2]| {
        learner.number += 1;
        for (side, seed) in [ALLIES, ENEMIES].into_iter().zip(seeds) {
            learner.send_half(side, RequestKind::Reset { seed, levels: false }, &all(N), &[]);
        }
        let frame = learner.frame();
        assert_eq!(frame.rejection(), None);
        frame.field::<u8>(&learner.layout, Field::Snapshot).expect("the lane has it")
    };
    let expected = states([Some(3), Some(4)]);
    assert!(states([Some(3), None]) == expected && states([None, Some(3)]) == expected);
    assert!(states([None, Some(4)]) != expected);
}

/// What one learner sent while the other was silent was kept without a limit, until the transport lent no
/// more.
#[test]
fn a_learner_that_sends_too_far_ahead_of_the_other_is_told_so() {
    let (pool, mut learner) = reset_lane();
    let requests = [(RequestKind::Step, &[STOP; N * UNITS][..]), (RESET, &[])];
    for (kind, actions) in requests {
        learner.number += 1;
        learner.send_half(ALLIES, kind, &all(N), actions);
    }
    learner.number += 1;
    learner.send_half(ALLIES, RESET, &all(N), &[]);
    assert_eq!(learner.rejection(), Rejection::TooFarAhead { side: Faction::Ally, waiting: 2 });
    learner.number -= 3;
    for (kind, actions) in requests {
        learner.number += 1;
        learner.send_half(ENEMIES, kind, &all(N), actions);
        assert_eq!(learner.frame().rejection(), None, "the two that waited are carried out");
    }
    wait_until("both are counted", || pool.lane(0).stats().accepted == 3);
}

/// Both learners get the error, and each calls its own units agents: "agent 0" did not say whose.
#[test]
fn an_illegal_action_names_the_learner_that_chose_it() {
    let (_pool, mut learner) = reset_lane();
    let illegal = [9; N * UNITS];
    for (side, name) in [(ALLIES, "allies"), (ENEMIES, "enemies")] {
        learner.number += 1;
        for of in [ALLIES, ENEMIES] {
            let actions = if of == side { illegal } else { [STOP; N * UNITS] };
            learner.send_half(of, RequestKind::Step, &all(N), &actions);
        }
        let (text, expected) = (
            learner.rejection().to_string(),
            format!("environment 0, agent 0 of the learner of the {name}: action 9 is not available"),
        );
        assert!(text.starts_with(&expected), "{text}");
    }
}

/// The control thread, which alone can free the frames of a dead process, waited for one, and then failed the
/// lane.
#[test]
fn a_session_ends_while_no_frame_is_free() {
    let (pool, mut learner) = reset_lane();
    for session in 2..4 {
        learner.set_shortage(true);
        pool.lane(0).end_session(Faction::Enemy);
        let left = Rejection::OtherLearnerLeft { side: Faction::Enemy };
        assert_eq!(learner.frame().rejection(), Some((0, left)));
        assert_eq!(pool.lane(0).failure(), None);
        learner.set_shortage(false);
        pool.lane(0).set_session(Some(SessionId(session)));
        (learner.session, learner.number) = (session, 0);
        send_both(&mut learner, RESET, &[]);
        assert_eq!(learner.frame().rejection(), None, "the next pair plays");
    }
}
