//! What a learner receives is what its environments produce when they are stepped one by one: for any number
//! of threads, batch size, autoreset mode and wait strategy.

use crate::harness::{start_one, start_waiting};
use crate::{MAX_THREADS, STEPS};
use smaclite_pool::fields::Field;
use smaclite_pool::transport::{RequestKind, Seeds, seed_words};
use smaclite_pool::{Autoreset, WaitStrategy};
use smaclite_tests::in_memory::SentMessage;
use smaclite_tests::{LanePlan, Row, conformance};

const MODES: [Autoreset; 3] = [Autoreset::NextStep, Autoreset::SameStep, Autoreset::Disabled];

/// Steps a lane for a while and compares every row.
fn check(plan: &LanePlan, threads: usize, wait: WaitStrategy) {
    let context = format!("{threads} threads, batches of {}, {:?}", plan.batch_size, plan.autoreset);
    let (_pool, mut learners) = start_waiting(wait, threads, std::slice::from_ref(plan));
    conformance::check(plan, &mut learners[0], STEPS * plan.num_envs / plan.batch_size, &context);
}

#[test]
fn a_learner_sees_the_same_bits_for_every_number_of_threads_batch_size_and_mode() {
    for autoreset in MODES {
        for threads in 1..=MAX_THREADS {
            for batch_size in [5, 2, 1] {
                let plan = LanePlan { batch_size, autoreset, ..LanePlan::toy(5) };
                check(&plan, threads, WaitStrategy::default());
            }
        }
    }
}

#[test]
fn every_wait_strategy_shows_the_same() {
    for wait in [WaitStrategy::Block, WaitStrategy::Spin] {
        check(&LanePlan::toy(5), 2, wait);
        check(&LanePlan { batch_size: 2, ..LanePlan::toy(5) }, 2, wait);
    }
}

#[test]
fn a_batch_larger_than_a_run_comes_in_one_frame() {
    let num_envs = if cfg!(miri) { 18 } else { 100 };
    check(&LanePlan::toy(num_envs), 2, WaitStrategy::default());
}

#[test]
fn more_threads_than_environments_do_no_harm() {
    check(&LanePlan::toy(1), 4, WaitStrategy::default());
    check(&LanePlan { batch_size: 1, ..LanePlan::toy(3) }, 4, WaitStrategy::default());
}

#[test]
fn fields_that_a_lane_leaves_out_are_absent_and_the_others_unchanged() {
    for autoreset in MODES {
        let fields = ["avail_actions", "episode_length", "final_state"].map(str::to_owned);
        let plan = LanePlan { autoreset, fields: Some(fields.into()), ..LanePlan::toy(4) };
        let (_pool, learner) = start_one(1, &plan);
        assert_eq!(learner.layout.offset(Field::Obs), None);
        assert_eq!(learner.layout.offset(Field::FinalState).is_some(), autoreset == Autoreset::SameStep);
        check(&plan, 2, WaitStrategy::default());
    }
}

#[test]
fn own_actions_and_numbers_are_appended_for_every_number_of_threads_batch_size_and_mode() {
    for autoreset in MODES {
        for (obs_last_actions, obs_agent_id) in [(1, false), (3, true), (16, false), (0, true)] {
            for (threads, batch_size) in [(1, 5), (2, 5), (2, 2)] {
                let plan =
                    LanePlan { batch_size, autoreset, obs_last_actions, obs_agent_id, ..LanePlan::toy(5) };
                check(&plan, threads, WaitStrategy::default());
            }
        }
    }
}

/// The other tests step an environment that was made for them; this one steps battles.
#[test]
fn battles_in_a_pool_are_those_of_the_engine_alone() {
    check(&LanePlan::new("2s3z", 3), 2, WaitStrategy::default());
    let own = LanePlan { obs_last_actions: 2, obs_agent_id: true, ..LanePlan::new("2s3z", 3) };
    check(&own, 2, WaitStrategy::default());
    // Each agent has 70 actions, which are more than a word has bits.
    check(&LanePlan::new("2c_vs_64zg", 2), 1, WaitStrategy::default());
}

/// Where units stand at the beginning is drawn.
#[test]
fn an_environment_with_a_seed_of_its_own_begins_as_with_that_seed_of_all() {
    let plan = LanePlan::new("terran_5_vs_5", 3);
    let (_pool, mut learner) = start_one(2, &plan);
    learner.send_reset_all(Some(5)); // 5, 6 and 7
    let from_five = learner.batch();
    let kind = Some(RequestKind::Reset { seeds: Seeds::Each(()), levels: false });
    let mut reset = |env_ids: &[i32], seeds: &[Option<u64>]| {
        learner.number += 1;
        let (session, number) = (learner.session, learner.number);
        let actions = seeds.iter().copied().flat_map(seed_words).collect();
        learner.send_raw(SentMessage { session, number, kind, env_ids: env_ids.to_vec(), actions });
        learner.rows(&learner.frame())
    };
    let begins_alike = |a: &Row, b: &Row| a.value(Field::State) == b.value(Field::State);
    let exchanged = reset(&[2, 0, 1], &[Some(5), Some(7), Some(6)]);
    for (env, same) in [(0, 2), (1, 1), (2, 0)] {
        assert!(begins_alike(&exchanged[env], &from_five[same]), "environment {env}");
    }
    let rows = reset(&[1, 2], &[None, Some(6)]);
    assert!(begins_alike(&rows[0], &exchanged[0]), "it is not named");
    assert!(!begins_alike(&rows[1], &exchanged[1]), "without a seed it goes on with its generator");
    assert!(begins_alike(&rows[2], &from_five[1]));
}
