//! However batches are stepped (asynchronously, by any number of threads, by an embedded pool or another
//! process, with any autoreset mode), learners see the same bits. Every frame is compared with the
//! [reference](smaclite_tests::reference), so two ways of stepping that agree with it agree with each other.

use smaclite_ipc::{Client, ClientError, Order, Supervisor, WaitOptions, WaitStrategy};
use smaclite_pool::Autoreset;
use smaclite_tests::fault::{Fault, Gate};
use smaclite_tests::process::TIMEOUT;
use smaclite_tests::{Child, LanePlan, Learner, PoolPlan, TestDir, conformance};
use std::time::Duration;

const STRATEGIES: [WaitStrategy; 3] = [WaitStrategy::Adaptive, WaitStrategy::Spin, WaitStrategy::Block];

/// Who steps a lane of a pool of this process.
#[derive(Clone, Copy, Debug)]
enum Way {
    /// A learner whose thread works in the pool.
    Calls,
    /// One that sends messages to it.
    Messages,
}

const WAYS: [Way; 2] = [Way::Calls, Way::Messages];

impl Way {
    /// A client of the pool's only lane.
    fn connect(self, dir: &TestDir, pool: &Supervisor, wait: WaitStrategy) -> Client {
        match self {
            Way::Calls => pool.connect(None, wait),
            Way::Messages => dir.connect(None, wait, WaitOptions::no_wait()),
        }
        .expect("a client")
    }
}

#[test]
fn every_way_of_stepping_shows_the_bits_of_the_reference() {
    for autoreset in [Autoreset::NextStep, Autoreset::SameStep, Autoreset::Disabled] {
        for threads in [1, 2, 4] {
            for batch_size in [12, 5, 1] {
                let plan = LanePlan {
                    autoreset,
                    batch_size,
                    episode_limit: Some(9),
                    // Also what is appended to observations, with some of them.
                    obs_last_actions: threads - 1,
                    obs_agent_id: threads == 2,
                    ..LanePlan::new("2s3z", 12)
                };
                let context = format!("{threads} threads, {batch_size} of 12, {autoreset:?}");
                let pool = PoolPlan::new([plan.clone()]).threads(threads);
                let check = |client: &mut Client, way: &str| {
                    conformance::check(&plan, client, 400 / batch_size, &format!("{way}: {context}"));
                };
                let dir = TestDir::new();
                let embedded = dir.start(&pool);
                for strategy in STRATEGIES {
                    let mut client = Way::Calls.connect(&dir, &embedded, strategy);
                    check(&mut client, &format!("calls, {strategy:?}"));
                }
                check(&mut dir.client(), "messages");
                drop(embedded);
                if batch_size != 5 {
                    let _supervisor = Child::supervisor(&dir, &pool);
                    check(&mut dir.client(), "another process");
                }
            }
        }
    }
}

#[test]
fn no_environment_starves_in_asynchronous_mode() {
    let dir = TestDir::new();
    for threads in [1, 2] {
        let plan = PoolPlan::new([LanePlan { batch_size: 4, ..LanePlan::new("MMM", 16) }]).threads(threads);
        let _supervisor = dir.start(&plan);
        let mut learner = dir.learner(&plan.lanes[0]);
        // Every environment makes progress. How the batches are shared out is the system's affair.
        learner.reset(Some(3), TIMEOUT).expect("a reset");
        let mut batches = 0;
        let mut steps = Vec::new();
        while steps.iter().min() < Some(&100) {
            learner.step(TIMEOUT).expect("a frame as in the reference");
            batches += 1;
            steps = (0..16).map(|env| learner.reference().steps(env)).collect();
            assert!(batches < 100_000, "some environments starve: {steps:?}");
        }
    }
}

#[test]
fn a_slow_environment_does_not_delay_a_batch_of_others() {
    let dir = TestDir::new();
    for slow in 0..8 {
        let gate = Gate::default();
        let lane =
            LanePlan { batch_size: 2, ..LanePlan::new("2s3z", 8) }.fault(slow, Fault::Gate(gate.clone()));
        let plan = PoolPlan::new([lane]).threads(2);
        let _supervisor = dir.start(&plan);
        let mut learner = dir.learner(&plan.lanes[0]);
        learner.reset(None, TIMEOUT).expect("a reset");
        gate.close();
        learner.send().expect("sent");
        // Three batches of all other environments come while its step waits, wherever it waits.
        gate.wait_for_arrival();
        let mut seen = Vec::new();
        for _ in 0..3 {
            seen.extend_from_slice(learner.recv(TIMEOUT).expect("a batch").env_id());
        }
        seen.sort_unstable();
        assert!(seen.iter().all(|env| *env != slow as i32), "{seen:?}");
        gate.open();
        assert!(learner.recv(TIMEOUT).expect("the last batch").env_id().contains(&(slow as i32)));
    }
}

#[test]
fn fields_that_a_lane_leaves_out_take_no_memory() {
    let dir = TestDir::new();
    let fields = Some(vec!["obs".into(), "final_obs".into()]);
    let lane = LanePlan { autoreset: Autoreset::SameStep, ..LanePlan::new("2s3z", 4) };
    let [lean, full] = [LanePlan { fields, ..lane.clone() }, lane]
        .map(|lane| dir.start(&PoolPlan::new([lane])).shared_memory());
    assert!(lean < full, "{lean} bytes without, {full} with all fields");
}

/// An environment's tasks keep their order, whichever threads take them.
#[test]
fn a_reset_of_all_drops_the_results_of_earlier_steps() {
    let dir = TestDir::new();
    for (threads, batch_size) in [(1, 8), (2, 8), (4, 8), (2, 4), (4, 1)] {
        let lane = LanePlan { batch_size, ..LanePlan::new("2s3z", 8) };
        let pool = dir.start(&PoolPlan::new([lane.clone()]).threads(threads));
        for way in WAYS {
            let mut learner = Learner::new(way.connect(&dir, &pool, WaitStrategy::default()), &lane);
            learner.reset(None, TIMEOUT).expect("a reset");
            for repetition in 1..150 {
                learner.send().expect("sent");
                if repetition % 3 == 0 {
                    std::thread::sleep(Duration::from_micros(30 * repetition));
                }
                // Some of the steps just sent are made and some are not; no result may be received.
                let seed = (repetition % 4 > 0).then_some(repetition);
                let reset = learner.reset(seed, TIMEOUT);
                reset.unwrap_or_else(|e| panic!("{way:?}, {threads} threads, repetition {repetition}: {e}"));
            }
            (0..20).for_each(|_| drop(learner.step(TIMEOUT).expect("a frame as in the reference")));
        }
    }
}

/// Else it would wait for ever.
#[test]
fn a_request_for_fewer_results_than_a_batch_has_is_refused_before_it_is_sent() {
    let dir = TestDir::new();
    let plan = LanePlan { batch_size: 2, ..LanePlan::new("2s3z", 4) };
    let _pool = dir.start(&PoolPlan::new([plan]));
    let mut client = dir.client();
    client.reset(None, None, WaitOptions::for_response()).expect("two of four environments");
    client.recv(WaitOptions::for_response()).expect("the other two");
    let mut reset = |env_ids: &[i32]| client.reset(None, Some(env_ids), WaitOptions::for_response());
    let too_few = reset(&[3]).expect_err("no batch would come");
    assert!(matches!(too_few, ClientError::TooFewForBatch { outstanding: 1, batch_size: 2 }), "{too_few}");
    assert_eq!(reset(&[0, 3]).expect("environment 3 is ready").env_id().len(), 2);
}

#[test]
fn a_wait_ends_by_its_timeout_or_an_interruption() {
    let dir = TestDir::new();
    let gate = Gate::default();
    let pool = dir.start(&PoolPlan::new([LanePlan::new("2s3z", 2).fault(0, Fault::Gate(gate.clone()))]));
    for way in WAYS {
        for strategy in STRATEGIES {
            let mut client = way.connect(&dir, &pool, strategy);
            drop(client.reset(None, None, WaitOptions::forever()).expect("a reset"));
            let mut actions = vec![0; 10];
            client.sample_actions(None, &mut actions).expect("actions");
            gate.close();
            client.send(Order::Step(&actions), None, WaitOptions::forever()).expect("sent");
            gate.wait_for_arrival(); // a thread of the pool has the environment
            let timeout = Some(Duration::from_millis(50));
            let wait = WaitOptions { timeout, interrupted: &mut || false };
            let error = client.recv(wait).expect_err("the step waits");
            assert!(error.to_string().contains("0.05 s"), "{error}");
            let mut checks = 0;
            let mut interrupted = || {
                checks += 1;
                true
            };
            let error = client.recv(WaitOptions { timeout: None, interrupted: &mut interrupted });
            assert!(matches!(error, Err(ClientError::Interrupted)), "{way:?} {strategy:?}: {error:?}");
            assert_eq!(checks, 1);
            gate.open();
            let wait = WaitOptions { timeout: Some(TIMEOUT), interrupted: &mut || false };
            client.recv(wait).expect("the result still comes");
        }
    }
}
