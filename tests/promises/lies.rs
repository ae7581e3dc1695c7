//! Programs that speak iceoryx2 themselves and lie: refused, counted, and without effect on the lane.

use crate::assert_says;
use smaclite_ipc::wire::{RequestHeader, actions_offset, step_bytes};
use smaclite_ipc::{LaneDescription, status};
use smaclite_pool::transport::RequestKind;
use smaclite_tests::pools::dice::Dice;
use smaclite_tests::pools::process::eventually;
use smaclite_tests::pools::raw::{Control, Requests, node, requests};
use smaclite_tests::pools::{Child, LanePlan, PoolPlan, Room};

/// The most bytes that a liar sends.
const MOST: usize = 1 << 16;

fn rejected(room: &Room) -> u64 {
    status(room.runtime_dir(), "train").expect("the supervisor lives").lanes[0].stats.rejected
}

/// Sends something that must be refused, and waits until it was counted.
#[track_caller]
fn assert_refused(room: &Room, publisher: &Requests, header: RequestHeader, payload: &[u8]) {
    let before = rejected(room);
    publisher.send(header, payload);
    let counted = eventually(|| rejected(room) == before + 1);
    assert!(counted, "{} instead of {} refusals of {header:?}", rejected(room), before + 1);
}

/// The payload of a step with these environments and the same action for everyone.
fn step_payload(lane: &LaneDescription, envs: &[i32], action: i32) -> Vec<u8> {
    let mut bytes = vec![0; step_bytes(envs.len(), lane.sizes.n_agents)];
    for (at, env) in bytes.chunks_exact_mut(4).zip(envs) {
        at.copy_from_slice(&env.to_ne_bytes());
    }
    bytes[actions_offset(envs.len())..]
        .chunks_exact_mut(4)
        .for_each(|at| at.copy_from_slice(&action.to_ne_bytes()));
    bytes
}

fn reset_payload(envs: &[i32]) -> Vec<u8> {
    envs.iter().flat_map(|env| env.to_ne_bytes()).collect()
}

#[test]
fn strangers_messages_are_refused_while_a_learner_goes_on() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4)]);
    let _supervisor = Child::supervisor(&room, &plan);
    let mut learner = Child::attached(&room, &plan.lanes[0]);
    learner.must("reset");
    learner.must("run");
    let lane = status(room.runtime_dir(), "train").expect("a status").lanes.remove(0).description;
    let node = node(room.runtime_dir());
    let publisher = requests(&node, &lane, MOST);
    let layout = lane.layout().expect("a layout");
    let good = RequestHeader::new(&layout, 77, 1, RequestKind::Step, 4);
    let payload = step_payload(&lane, &[0, 1, 2, 3], 1);
    // A session that nobody has, though one could guess: the learner's is 1.
    assert_refused(&room, &publisher, good, &payload);
    assert_refused(&room, &publisher, RequestHeader { session: 0, ..good }, &payload);
    let ours = RequestHeader { session: 1, ..good };
    for header in [
        RequestHeader { magic: 7, ..ours },
        RequestHeader { version: 2, ..ours },
        RequestHeader { layout_hash: 1, ..ours },
        RequestHeader { kind: 0, ..ours },
        RequestHeader { kind: u32::MAX, ..ours },
        RequestHeader { count: 0, ..ours },
        RequestHeader { count: 3, ..ours },
        RequestHeader { count: u32::MAX, ..ours },
        RequestHeader { count: 1 << 31, ..ours },
    ] {
        assert_refused(&room, &publisher, header, &payload);
    }
    for len in [1, 3, 4, payload.len() - 1, payload.len() + 1, MOST] {
        assert_refused(&room, &publisher, ours, &vec![0; len]);
    }
    let undisturbed = learner.answer(std::time::Duration::ZERO);
    assert_says(&undisturbed.expect_err("it runs on"), &["no answer"]);
}

#[test]
fn a_learner_that_lies_harms_nobody() {
    let room = Room::new();
    let plan =
        PoolPlan::new([LanePlan::new("2s3z", 4), LanePlan { batch_size: 2, ..LanePlan::new("3s5z", 4) }]);
    let _supervisor = Child::supervisor(&room, &plan);
    for plan in &plan.lanes {
        let mut control = Control::connect(room.runtime_dir());
        let (session, lane) = control.attach(&plan.name);
        let node = node(room.runtime_dir());
        let publisher = requests(&node, &lane, MOST);
        let layout = lane.layout().expect("a layout");
        let lane_index = usize::from(plan.name == "3s5z");
        let rejected =
            || status(room.runtime_dir(), "train").expect("it lives").lanes[lane_index].stats.rejected;
        let mut number = 0;
        let mut ask = |kind: RequestKind, payload: &[u8], count: usize| {
            number += 1;
            publisher.send(RequestHeader::new(&layout, session, number, kind, count), payload);
        };
        let reset = RequestKind::Reset { seed: Some(1) };
        let mut refused = |kind, payload: &[u8], count| {
            let before = rejected();
            ask(kind, payload, count);
            assert!(eventually(|| rejected() == before + 1), "{kind:?} of {count} was taken");
        };
        refused(RequestKind::Step, &step_payload(&lane, &[0, 1, 2, 3], 1), 4); // before a reset
        refused(reset, &reset_payload(&[0, 1, 2, 2]), 4);
        refused(reset, &reset_payload(&[0, 1, 2, 4]), 4);
        refused(reset, &reset_payload(&[-1, 1, 2, 3]), 4);
        ask(reset, &reset_payload(&[3, 2, 1, 0]), 4);
        let steps = || status(room.runtime_dir(), "train").expect("it lives").lanes[lane_index].stats.frames;
        let frames = if lane.settings.is_synchronous() { 1 } else { 2 };
        assert!(eventually(|| steps() == frames), "the reset was not served");
        let mut refused = |kind, payload: &[u8], count| {
            let before = rejected();
            ask(kind, payload, count);
            assert!(eventually(|| rejected() == before + 1), "{kind:?} of {count} was taken");
        };
        for action in [-1, 6, lane.sizes.n_actions as i32, i32::MAX, i32::MIN] {
            refused(RequestKind::Step, &step_payload(&lane, &[0, 1, 2, 3], action), 4);
        }
        for envs in [[0, 1, 2, 2], [0, 1, 2, 4], [0, 1, 2, i32::MIN], [i32::MAX; 4]] {
            refused(RequestKind::Step, &step_payload(&lane, &envs, 1), 4);
            refused(reset, &reset_payload(&envs), 4);
        }
        assert_eq!(steps(), frames, "a refused request was served");
        // Numbers that come twice would make two rounds look like one.
        let before = rejected();
        for again in [1, 0] {
            let header = RequestHeader::new(&layout, session, again, reset, 4);
            publisher.send(header, &reset_payload(&[0, 1, 2, 3]));
        }
        assert!(eventually(|| rejected() == before + 2));
        drop((publisher, node, control));
        let mut honest = Child::learner(&room, plan);
        assert!(eventually(|| honest.ask("connect train").is_ok()), "the lane was not freed");
        honest.must("reset");
        if lane.settings.is_synchronous() {
            honest.must("step 20");
        }
    }
}

#[test]
fn a_reset_that_is_refused_leaves_work_under_way_alone() {
    // A refused reset of all environments once freed those at work: their next actions came on top of the old
    // ones, and a worker stepped with actions nobody had checked.
    let room = Room::new();
    let lane = LanePlan { batch_size: 1, ..LanePlan::new("2s3z", 4) };
    let _supervisor = Child::supervisor(&room, &PoolPlan::new([lane]));
    let mut control = Control::connect(room.runtime_dir());
    let (session, lane) = control.attach("2s3z");
    let node = node(room.runtime_dir());
    let publisher = requests(&node, &lane, MOST);
    let layout = lane.layout().expect("a layout");
    let mut dice = Dice::new(1);
    let mut number = 1;
    let reset = RequestKind::Reset { seed: None };
    publisher.send(RequestHeader::new(&layout, session, 1, reset, 4), &reset_payload(&[0, 1, 2, 3]));
    for _ in 0..400 {
        number += 1;
        let (kind, payload) = match dice.below(3) {
            0 => (reset, reset_payload(&[0, 1, 2, 2])),
            _ => (RequestKind::Step, step_payload(&lane, &[0, 1, 2, 3], 1 + dice.below(5) as i32)),
        };
        publisher.send(RequestHeader::new(&layout, session, number, kind, 4), &payload);
    }
    let lane = status(room.runtime_dir(), "train").expect("a status").lanes.remove(0);
    assert_eq!(lane.failure, None);
}

#[test]
fn garbage_at_random_never_breaks_a_lane() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan { batch_size: 3, ..LanePlan::new("2s3z", 6) }]).threads(2);
    let _supervisor = Child::supervisor(&room, &plan);
    let mut control = Control::connect(room.runtime_dir());
    let (session, lane) = control.attach("2s3z");
    let node = node(room.runtime_dir());
    let publisher = requests(&node, &lane, MOST);
    let layout = lane.layout().expect("a layout");
    let mut dice = Dice::new(5);
    for number in 1..3000 {
        let count = *dice.pick(&[1, 3, 6, 6, 6, 7, 100]);
        let kind = *dice.pick(&[RequestKind::Step, RequestKind::Reset { seed: None }]);
        let envs: Vec<i32> = match dice.below(3) {
            0 => (0..count).map(|_| dice.below(9) as i32 - 1).collect(),
            _ => (0..count).collect(),
        };
        let mut payload = match kind {
            RequestKind::Step => step_payload(&lane, &envs, dice.below(7) as i32),
            RequestKind::Reset { .. } => reset_payload(&envs),
        };
        if dice.below(4) == 0 {
            let (at, byte) = (dice.below(payload.len() as u64) as usize, dice.below(256) as u8);
            payload[at] = byte;
        }
        if dice.below(8) == 0 {
            payload.truncate(dice.below(payload.len() as u64) as usize + 1);
        }
        let number = if dice.below(10) == 0 { dice.below(number + 5) } else { number };
        publisher.send(RequestHeader::new(&layout, session, number, kind, envs.len()), &payload);
    }
    drop((publisher, control));
    let lane = status(room.runtime_dir(), "train").expect("a status").lanes.remove(0);
    assert_eq!(lane.failure, None);
    println!("{:?}", lane.stats);
    assert!(lane.stats.rejected > 100 && lane.stats.steps > 100, "{:?}", lane.stats);
}

/// Writes to a request after it was sent, while it is checked and carried out.
#[allow(unsafe_code)]
mod rewriting {
    use super::*;

    #[test]
    fn a_request_that_is_rewritten_while_it_is_read_steps_only_what_was_checked() {
        let room = Room::new();
        let plan = PoolPlan::new([LanePlan::new("2s3z", 64)]);
        let _supervisor = Child::supervisor(&room, &plan);
        let mut control = Control::connect(room.runtime_dir());
        let (session, lane) = control.attach("2s3z");
        let node = node(room.runtime_dir());
        let publisher = requests(&node, &lane, MOST);
        let layout = lane.layout().expect("a layout");
        let envs: Vec<i32> = (0..64).collect();
        let reset = RequestKind::Reset { seed: None };
        let payload = step_payload(&lane, &envs, 1);
        let mut dice = Dice::new(3);
        for number in 1..800 {
            if number % 16 == 1 {
                // Before anyone is dead: then stopping is legal for all.
                publisher
                    .send(RequestHeader::new(&layout, session, number, reset, 64), &reset_payload(&envs));
                continue;
            }
            let header = RequestHeader::new(&layout, session, number, RequestKind::Step, 64);
            let bytes = publisher.send(header, &payload);
            let end = std::time::Instant::now() + std::time::Duration::from_micros(dice.below(400));
            while std::time::Instant::now() < end {
                let at = actions_offset(64) + dice.below(64 * 5) as usize * 4;
                // Half the requests are only rewritten after they were read, or to the same.
                let value =
                    if number % 2 == 0 { 1 } else { *dice.pick(&[-1i32, 0, 1, 4, 6, 63, 64, i32::MAX]) };
                // SAFETY: the publisher's segment stays mapped while the publisher lives, `at` lies within
                // the sample, aligned to 4. That the reader races with this is the point; the reader uses
                // atomics.
                unsafe { bytes.add(at).cast::<i32>().write_volatile(value) };
            }
        }
        let lane = status(room.runtime_dir(), "train").expect("it lives").lanes.remove(0);
        println!("{:?}", lane.stats);
        assert_eq!(lane.failure, None);
        assert!(lane.stats.rejected > 10 && lane.stats.frames > 10, "{:?}", lane.stats);
    }
}

#[test]
fn nonsense_on_the_control_socket_is_answered() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let _supervisor = Child::supervisor(&room, &plan);
    let long = format!("\"{}\"", "x".repeat(1 << 21));
    for line in ["", "{", "null", "{\"ask\":\"everything\"}", "{\"ask\":\"attach\"}", "\u{0}\u{1}", &long] {
        let answer = Control::connect(room.runtime_dir()).ask(line);
        assert!(answer.is_empty() || answer.contains("refused"), "{answer}");
    }
    let mut control = Control::connect(room.runtime_dir());
    let old = control.ask(r#"{"request":"attach","version":99,"lane":null}"#);
    assert_says(&old, &["refused", "version", "99"]);
    let (session, _) = control.attach("2s3z");
    assert!(session > 0);
    let twice = control.ask(r#"{"request":"attach","version":1,"lane":null}"#);
    assert_says(&twice, &["refused"]);
    // Many connections that ask nothing, one that does not read its answers.
    let idle: Vec<_> = (0..200).map(|_| Control::connect(room.runtime_dir())).collect();
    let mut learner = Child::learner(&room, &plan.lanes[0]);
    drop(control);
    assert!(eventually(|| learner.ask("connect train").is_ok()), "the lane was not freed");
    learner.must("reset");
    learner.must("step 5");
    drop(idle);
}
