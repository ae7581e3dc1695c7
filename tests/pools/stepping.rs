//! However batches are stepped (asynchronously, by any number of threads, by an embedded pool or another
//! process, with any autoreset mode), learners see the same bits. Every frame is compared with the
//! [reference](smaclite_tests::reference), so two ways of stepping that agree with it agree with each other.

use smaclite_ipc::{Client, WaitOptions, WaitStrategy};
use smaclite_pool::Autoreset;
use smaclite_pool::fields::Field;
use smaclite_tests::fault::{Fault, Gate};
use smaclite_tests::learner::LearnerError;
use smaclite_tests::process::TIMEOUT;
use smaclite_tests::{Child, LanePlan, Learner, PoolPlan, TestDir, conformance};
use std::time::Duration;

/// Resets, then steps `frames` batches. Without autoreset it resets finished environments.
fn run(learner: &mut Learner, plan: &LanePlan, frames: usize) -> Result<(), LearnerError> {
    learner.reset(Some(3), TIMEOUT)?;
    for frame in 0..frames {
        let over: Vec<i32> = match plan.autoreset {
            Autoreset::Disabled => {
                learner.ready().iter().copied().filter(|e| learner.reference().is_over(*e)).collect()
            }
            _ => Vec::new(),
        };
        if !over.is_empty() {
            let seed = (frame % 2 == 0).then_some(frame as u64);
            learner.send_reset(&over, seed)?;
        }
        // A synchronous lane either resets or steps, an asynchronous one both at once.
        if !learner.ready().is_empty() {
            learner.send()?;
        }
        learner.recv(TIMEOUT)?;
    }
    Ok(())
}

/// A learner whose thread works in the pool, one that sends messages to it, and one of another process.
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
                check(&mut embedded.connect(None, WaitStrategy::default()).expect("a client"), "calls");
                check(&mut dir.learner(&plan).into_client(), "messages");
                drop(embedded);
                if batch_size != 5 {
                    let _supervisor = Child::supervisor(&dir, &pool);
                    check(&mut dir.learner(&plan).into_client(), "another process");
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
fn same_step_autoreset_shows_the_last_observation_and_the_first_of_the_new_episode() {
    let dir = TestDir::new();
    let plan =
        LanePlan { autoreset: Autoreset::SameStep, episode_limit: Some(4), ..LanePlan::new("2s3z", 3) };
    let pool = PoolPlan::new([plan]);
    let _supervisor = dir.start(&pool);
    let mut learner = dir.learner(&pool.lanes[0]);
    learner.reset(None, TIMEOUT).expect("a reset");
    let fields = [Field::Obs, Field::FinalObs, Field::State, Field::FinalState];
    let mut before = Vec::new();
    for step in 1..=12 {
        let batch = learner.step(TIMEOUT).expect("a step as in the reference");
        let ended = step % 4 == 0;
        assert_eq!(batch.truncated(), [u8::from(ended); 3], "step {step}");
        let lengths = batch.field::<i32>(Field::EpisodeLength).expect("a field");
        assert_eq!(lengths, [if ended { 4 } else { step % 4 }; 3], "step {step}");
        let [obs, final_obs, state, final_state] = fields.map(|f| batch.field::<f32>(f).expect("a field"));
        if ended {
            assert_ne!(obs, final_obs, "units have moved since the start");
            assert_ne!(state, final_state);
            assert_ne!(final_obs, before, "the last observation is that of the step before");
        }
        before = obs.to_vec();
    }
}

#[test]
fn frames_have_only_the_chosen_fields() {
    let dir = TestDir::new();
    for autoreset in [Autoreset::NextStep, Autoreset::SameStep] {
        let fields = Some(vec!["obs".into(), "final_obs".into()]);
        let plan = LanePlan { fields, autoreset, ..LanePlan::new("2s3z", 4) };
        let pool = PoolPlan::new([plan.clone()]);
        let supervisor = dir.start(&pool);
        let mut learner = dir.learner(&pool.lanes[0]);
        run(&mut learner, &plan, 60).expect("frames as in the reference");
        let batch = learner.step(TIMEOUT).expect("a step");
        let names: Vec<_> = batch.layout().fields().iter().map(|f| f.spec().name).collect();
        let mut expected = vec!["env_id", "obs", "reward", "terminated", "truncated", "was_reset"];
        expected.extend((autoreset == Autoreset::SameStep).then_some("final_obs"));
        assert_eq!(names, expected);
        assert!(batch.field::<f32>(Field::State).is_none());
        let lean = supervisor.shared_memory();
        drop((supervisor, learner, batch));
        let full = PoolPlan::new([LanePlan { fields: None, ..plan }]);
        let full = dir.start(&full).shared_memory();
        assert!(lean < full, "{lean} bytes without, {full} with all fields");
    }
}

#[test]
fn a_reset_of_all_drops_the_results_of_earlier_steps() {
    let dir = TestDir::new();
    for (threads, batch_size) in [(1, 8), (2, 8), (4, 8), (2, 4), (4, 1)] {
        let plan = PoolPlan::new([LanePlan { batch_size, ..LanePlan::new("2s3z", 8) }]).threads(threads);
        let _supervisor = dir.start(&plan);
        let mut learner = dir.learner(&plan.lanes[0]);
        learner.reset(Some(0), TIMEOUT).expect("a reset");
        for repetition in 1..150 {
            learner.send_to(&(0..8).collect::<Vec<_>>()).expect("sent");
            if repetition % 3 == 0 {
                std::thread::sleep(Duration::from_micros(30 * repetition));
            }
            // Some of the steps just sent are made and some are not; no result may be received.
            learner
                .reset(Some(repetition), TIMEOUT)
                .unwrap_or_else(|e| panic!("{threads} threads, repetition {repetition}: {e}"));
        }
        run(&mut learner, &plan.lanes[0], 20).expect("frames as in the reference");
    }
}

#[test]
fn a_wait_ends_by_its_timeout_or_an_interruption() {
    let dir = TestDir::new();
    let slow = Fault::Sleep(Duration::from_millis(1500));
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2).fault(0, slow)]);
    let _supervisor = dir.start(&plan);
    for wait in [WaitStrategy::default(), WaitStrategy::Block, WaitStrategy::Spin] {
        let mut client = Client::connect(dir.runtime_dir(), "train", None, wait).expect("a client");
        let mut never = || false;
        let wait = WaitOptions { timeout: Some(TIMEOUT), interrupted: &mut never };
        drop(client.reset(None, None, wait).expect("a reset"));
        let mut actions = vec![0; 10];
        client.sample_actions(None, &mut actions).expect("actions");
        client.send(&actions, None, WaitOptions::forever()).expect("sent");
        let timeout = Some(Duration::from_millis(50));
        let error =
            client.recv(WaitOptions { timeout, interrupted: &mut never }).expect_err("the step sleeps");
        assert!(error.to_string().contains("0.05 s"), "{error}");
        let mut checks = 0;
        let mut interrupted = || {
            checks += 1;
            true
        };
        let error = client.recv(WaitOptions { timeout: None, interrupted: &mut interrupted });
        assert!(error.expect_err("interrupted").to_string().contains("interrupted"));
        assert_eq!(checks, 1);
        let wait = WaitOptions { timeout: Some(TIMEOUT), interrupted: &mut never };
        client.recv(wait).expect("the result still comes");
    }
}
