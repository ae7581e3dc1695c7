//! Malformed and hostile requests, sent without the real client: they are rejected, counted, and have no
//! effect on the lane.

use crate::assert_contains;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use smaclite_ipc::LaneDescription;
use smaclite_ipc::wire::{RequestHeader, body_offset, request_bytes};
use smaclite_pool::transport::{RequestKind, RequestNumber, Seeds, SessionId};
use smaclite_tests::process::eventually;
use smaclite_tests::raw_client::{Control, RawLearner, Requests, attach_request, node, requests};
use smaclite_tests::{Child, LanePlan, PoolPlan, TestDir};

/// The largest payload, in bytes.
const MAX_PAYLOAD: usize = 1 << 16;

fn rejected(dir: &TestDir) -> u64 {
    dir.status().lanes[0].stats.rejected
}

/// Sends a request that must be rejected, and waits until it was counted.
#[track_caller]
fn assert_rejected(dir: &TestDir, publisher: &Requests, header: RequestHeader, payload: &[u8]) {
    let before = rejected(dir);
    publisher.send(header, payload);
    let counted = eventually(|| rejected(dir) == before + 1);
    assert!(counted, "{} rejections, expected {}: {header:?}", rejected(dir), before + 1);
}

/// The payload of a step with these environments and the same action for every agent.
fn step_payload(lane: &LaneDescription, envs: &[i32], action: i32) -> Vec<u8> {
    let mut bytes = vec![0; request_bytes(&lane.layout().expect("a layout"), RequestKind::Step, envs.len())];
    for (at, env) in bytes.chunks_exact_mut(4).zip(envs) {
        at.copy_from_slice(&env.to_ne_bytes());
    }
    bytes[body_offset(envs.len())..]
        .chunks_exact_mut(4)
        .for_each(|at| at.copy_from_slice(&action.to_ne_bytes()));
    bytes
}

fn reset_payload(envs: &[i32]) -> Vec<u8> {
    envs.iter().flat_map(|env| env.to_ne_bytes()).collect()
}

/// The payload of a fork of `from` to `to`.
fn fork_payload(from: &[i32], to: &[i32]) -> Vec<u8> {
    let mut bytes = reset_payload(to);
    bytes.resize(body_offset(to.len()), 0);
    bytes.extend(reset_payload(from));
    bytes
}

#[test]
fn requests_of_unknown_sessions_and_malformed_ones_are_rejected_while_a_learner_continues() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4)]);
    let (_supervisor, mut learner) = Child::supervisor_and_learner(&dir, &plan);
    learner.must("run");
    let lane = dir.status().lanes.remove(0).description;
    let node = node(dir.runtime_dir());
    let publisher = requests(&node, &lane, MAX_PAYLOAD);
    let layout = lane.layout().expect("a layout");
    let good = RequestHeader::new(&layout, SessionId(77), RequestNumber(1), RequestKind::Step, 4);
    let payload = step_payload(&lane, &[0, 1, 2, 3], 1);
    // A session that does not exist, though the learner's is easy to guess: it is 1.
    assert_rejected(&dir, &publisher, good, &payload);
    assert_rejected(&dir, &publisher, RequestHeader { session: 0, ..good }, &payload);
    // What it says of its wait, here a minute or more, is not counted with those of accepted requests.
    assert_rejected(&dir, &publisher, RequestHeader { sent_ns: 0, ..good }, &payload);
    let stats = dir.status().lanes[0].stats;
    assert!((1..30_000_000_000).contains(&stats.waited_ns), "{stats:?}");
    let ours = RequestHeader { session: 1, ..good };
    for header in [
        RequestHeader { magic: 7, ..ours },
        RequestHeader { version: ours.version + 1, ..ours },
        RequestHeader { layout_hash: 1, ..ours },
        RequestHeader { kind: 0, ..ours },
        RequestHeader { kind: u32::MAX, ..ours },
        RequestHeader { count: 0, ..ours },
        RequestHeader { count: 3, ..ours },
        RequestHeader { count: u32::MAX, ..ours },
        RequestHeader { count: 1 << 31, ..ours },
    ] {
        assert_rejected(&dir, &publisher, header, &payload);
    }
    for len in [1, 3, 4, payload.len() - 1, payload.len() + 1, MAX_PAYLOAD] {
        assert_rejected(&dir, &publisher, ours, &vec![0; len]);
    }
    let no_answer = learner.answer(std::time::Duration::ZERO);
    assert_contains(&no_answer.expect_err("it continues"), &["no answer"]);
}

#[test]
fn invalid_requests_of_a_learner_are_rejected_and_have_no_effect() {
    let dir = TestDir::new();
    let plan =
        PoolPlan::new([LanePlan::new("2s3z", 4), LanePlan { batch_size: 2, ..LanePlan::new("3s5z", 4) }]);
    let _supervisor = Child::supervisor(&dir, &plan);
    for (index, plan) in plan.lanes.iter().enumerate() {
        let mut raw = RawLearner::attach(dir.runtime_dir(), &plan.name, MAX_PAYLOAD);
        let (lane, all) = (raw.lane.clone(), [0, 1, 2, 3]);
        let rejected = || dir.status().lanes[index].stats.rejected;
        let frames = || dir.status().lanes[index].stats.frames;
        let reset = RequestKind::Reset { seeds: Seeds::From(1), levels: false };
        let assert_rejected = |raw: &mut RawLearner, kind, payload: &[u8]| {
            let before = rejected();
            raw.send(kind, payload, 4);
            assert!(eventually(|| rejected() == before + 1), "{kind:?} was accepted");
        };
        assert_rejected(&mut raw, RequestKind::Step, &step_payload(&lane, &all, 1)); // before a reset
        for envs in [[0, 1, 2, 2], [0, 1, 2, 4], [-1, 1, 2, 3]] {
            assert_rejected(&mut raw, reset, &reset_payload(&envs));
        }
        raw.send(reset, &reset_payload(&[3, 2, 1, 0]), 4);
        let expected = if lane.settings.is_synchronous() { 1 } else { 2 };
        assert!(eventually(|| frames() == expected), "the reset was not answered");
        for action in [-1, 6, lane.sizes.n_actions as i32, i32::MAX, i32::MIN] {
            assert_rejected(&mut raw, RequestKind::Step, &step_payload(&lane, &all, action));
        }
        for envs in [[0, 1, 2, 2], [0, 1, 2, 4], [0, 1, 2, i32::MIN], [i32::MAX; 4]] {
            assert_rejected(&mut raw, RequestKind::Step, &step_payload(&lane, &envs, 1));
            assert_rejected(&mut raw, reset, &reset_payload(&envs));
        }
        assert_eq!(frames(), expected, "a rejected request had an effect");
        // A repeated number would make two epochs look like one.
        let before = rejected();
        for number in [1, 0] {
            raw.send_numbered(number, reset, &reset_payload(&all), 4);
        }
        assert!(eventually(|| rejected() == before + 2));
        drop(raw);
        let mut next = Child::learner(&dir, plan);
        assert!(eventually(|| next.ask("connect train").is_ok()), "the lane was not freed");
        next.must("reset");
        if lane.settings.is_synchronous() {
            next.must("step 20");
        }
    }
}

#[test]
fn a_rejected_reset_does_not_affect_requests_that_are_being_processed() {
    // A rejected reset of all environments marked the busy ones as free: their next actions overwrote those
    // being used, and a worker stepped with actions that had not been checked.
    let dir = TestDir::new();
    let lane = LanePlan { batch_size: 1, ..LanePlan::new("2s3z", 4) };
    let _supervisor = Child::supervisor(&dir, &PoolPlan::new([lane]));
    let mut raw = RawLearner::attach(dir.runtime_dir(), "2s3z", MAX_PAYLOAD);
    let lane = raw.lane.clone();
    let mut rng = Pcg64::seed_from_u64(1);
    let reset = RequestKind::Reset { seeds: Seeds::Continue, levels: false };
    raw.send(reset, &reset_payload(&[0, 1, 2, 3]), 4);
    for _ in 0..400 {
        let (kind, payload) = match rng.random_range(0..3) {
            0 => (reset, reset_payload(&[0, 1, 2, 2])),
            _ => (RequestKind::Step, step_payload(&lane, &[0, 1, 2, 3], rng.random_range(1..=5))),
        };
        raw.send(kind, &payload, 4);
    }
    let lane = dir.status().lanes.remove(0);
    assert_eq!(lane.failure, None);
}

#[test]
fn random_requests_never_break_a_lane() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan { batch_size: 3, ..LanePlan::new("2s3z", 6) }]).threads(2);
    let _supervisor = Child::supervisor(&dir, &plan);
    let raw = RawLearner::attach(dir.runtime_dir(), "2s3z", MAX_PAYLOAD);
    let lane = raw.lane.clone();
    let mut rng = Pcg64::seed_from_u64(5);
    for number in 1..3000 {
        let count = *[1, 3, 6, 6, 6, 7, 100].choose(&mut rng).expect("not empty");
        let kinds = [
            RequestKind::Step,
            RequestKind::Reset { seeds: Seeds::Continue, levels: false },
            RequestKind::Fork { seeds: Seeds::From(3) },
            RequestKind::Fork { seeds: Seeds::Each(()) },
        ];
        let kind = *kinds.choose(&mut rng).expect("not empty");
        let envs: Vec<i32> = match rng.random_range(0..3) {
            0 => (0..count).map(|_| rng.random_range(-1..8)).collect(),
            _ => (0..count).collect(),
        };
        let mut payload = match kind {
            RequestKind::Reset { .. } => reset_payload(&envs),
            RequestKind::Fork { seeds: Seeds::Each(()) } => {
                let words: Vec<i32> = envs.iter().flat_map(|env| [*env % 2, *env, 5]).collect();
                fork_payload(&[words, envs.clone()].concat(), &envs)
            }
            RequestKind::Fork { .. } => fork_payload(&envs, &envs),
            _ => step_payload(&lane, &envs, rng.random_range(0..7)),
        };
        if rng.random_ratio(1, 4) {
            let at = rng.random_range(0..payload.len());
            payload[at] = rng.random();
        }
        if rng.random_ratio(1, 8) {
            payload.truncate(rng.random_range(1..=payload.len()));
        }
        let number = if rng.random_ratio(1, 10) { rng.random_range(0..number + 5) } else { number };
        raw.send_numbered(number, kind, &payload, envs.len());
    }
    drop(raw);
    let lane = dir.status().lanes.remove(0);
    assert_eq!(lane.failure, None);
    println!("{:?}", lane.stats);
    assert!(lane.stats.rejected > 100 && lane.stats.steps > 100, "{:?}", lane.stats);
}

/// Writes to a request after it was sent, while it is being checked and processed.
#[allow(unsafe_code)]
mod rewriting {
    use super::*;

    #[test]
    fn a_request_that_is_rewritten_while_it_is_read_steps_only_with_checked_actions() {
        let dir = TestDir::new();
        let plan = PoolPlan::new([LanePlan::new("2s3z", 64)]);
        let _supervisor = Child::supervisor(&dir, &plan);
        let mut raw = RawLearner::attach(dir.runtime_dir(), "2s3z", MAX_PAYLOAD);
        let lane = raw.lane.clone();
        let envs: Vec<i32> = (0..64).collect();
        let reset = RequestKind::Reset { seeds: Seeds::Continue, levels: false };
        let payload = step_payload(&lane, &envs, 1);
        let mut rng = Pcg64::seed_from_u64(3);
        for number in 1..800 {
            if number % 16 == 1 {
                // Before any agent dies: then action 1 (stop) is legal for all.
                raw.send(reset, &reset_payload(&envs), 64);
                continue;
            }
            let bytes = raw.send(RequestKind::Step, &payload, 64).payload;
            let end = std::time::Instant::now() + std::time::Duration::from_micros(rng.random_range(0..400));
            while std::time::Instant::now() < end {
                let at = body_offset(64) + rng.random_range(0..64 * 5) * 4;
                // Half of the requests keep their value, so that some are accepted.
                let values = [-1i32, 0, 1, 4, 6, 63, 64, i32::MAX];
                let value = if number % 2 == 0 { 1 } else { *values.choose(&mut rng).expect("not empty") };
                // SAFETY: the publisher's segment stays mapped while the publisher lives, `at` lies within
                // the sample, aligned to 4. The reader races with this on purpose; it uses atomics.
                unsafe { bytes.add(at).cast::<i32>().write_volatile(value) };
            }
        }
        let lane = dir.status().lanes.remove(0);
        println!("{:?}", lane.stats);
        assert_eq!(lane.failure, None);
        assert!(lane.stats.rejected > 10 && lane.stats.frames > 10, "{:?}", lane.stats);
    }
}

#[test]
fn invalid_text_on_the_control_socket_is_answered() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let _supervisor = Child::supervisor(&dir, &plan);
    let long = format!("\"{}\"", "x".repeat(1 << 21));
    for line in
        ["", "{", "null", r#"{"request":"everything"}"#, r#"{"request":"attach"}"#, "\u{0}\u{1}", &long]
    {
        let answer = Control::connect(dir.runtime_dir()).ask(line);
        assert!(answer.is_empty() || answer.contains("refused"), "{answer}");
    }
    let mut control = Control::connect(dir.runtime_dir());
    let old = control.ask(r#"{"request":"attach","version":2,"lane":null}"#);
    assert_contains(&old, &["refused", "release unknown (protocol 2)"]);
    let (session, _) = control.attach("2s3z");
    assert!(session > 0);
    let twice = control.ask(&attach_request(None));
    assert_contains(&twice, &["refused"]);
    // Many connections that request nothing.
    let idle: Vec<_> = (0..200).map(|_| Control::connect(dir.runtime_dir())).collect();
    let mut learner = Child::learner(&dir, &plan.lanes[0]);
    drop(control);
    assert!(eventually(|| learner.ask("connect train").is_ok()), "the lane was not freed");
    learner.must("reset");
    learner.must("step 5");
    drop(idle);
}
