//! Wrong actions: the client, or the lane, names what was wrong, and nothing is stepped. The single reasons
//! are tested in `in_memory::rejections`, and what the client refuses before it sends in `smaclite_ipc`.

use crate::assert_contains;
use smaclite_ipc::{ClientError, Order, WaitOptions};
use smaclite_tests::learner::LearnerError;
use smaclite_tests::process::TIMEOUT;
use smaclite_tests::{Child, LanePlan, PoolPlan, TestDir};

/// Actions, and the environments that they are for.
type Request<'a> = (&'a [i32], Option<&'a [i32]>);

#[test]
fn wrong_actions_are_named_and_nothing_is_stepped() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan { batch_size: 2, ..LanePlan::new("2s3z", 4) }]);
    let _supervisor = Child::supervisor(&dir, &plan);
    let mut learner = dir.learner(&plan.lanes[0]);
    learner.reset(None, TIMEOUT).expect("a reset");
    let mut attack = [1; 20];
    attack[13] = 6; // no enemy is near at the start
    let cases: [(Request, [&str; 2]); 5] = [
        ((&[1; 19], None), ["19 actions", "take 20"]),
        ((&[1; 20], Some(&[0, 1, 2])), ["20 actions", "take 15"]),
        ((&[1; 10], Some(&[0, 4])), ["environment 4", "0 to 3"]),
        ((&[1; 10], Some(&[1, 1])), ["environment 1", "twice"]),
        ((&attack, None), ["environment 2, agent 3: action 6 ", "available: [1"]),
    ];
    for ((actions, env_ids), parts) in cases {
        let sent = learner.client().send(Order::Step(actions), env_ids, WaitOptions::forever());
        let refused = sent.map_err(LearnerError::from).and_then(|()| learner.recv(TIMEOUT));
        assert_contains(&refused.expect_err("wrong actions").to_string(), &parts);
    }
    learner.send_to(&[0]).expect("sent");
    let too_few = learner.recv(TIMEOUT).expect_err("one result is no batch");
    let is_expected = |error: &ClientError| {
        matches!(error, ClientError::NothingToReceive { outstanding: 1, batch_size: 2 })
    };
    assert!(matches!(&too_few, LearnerError::Client(error) if is_expected(error)), "{too_few}");
    learner.send_to(&[1, 2, 3]).expect("sent");
    (0..2).for_each(|_| drop(learner.recv(TIMEOUT).expect("the first step of each, as in the reference")));
}

/// Each refusal took a place in the learner's queue, from which the fourth pushed the batch.
#[test]
fn refusals_that_are_read_late_push_out_no_batch() {
    let dir = TestDir::new();
    let _supervisor = dir.start(&PoolPlan::new([LanePlan { batch_size: 4, ..LanePlan::new("3m", 8) }]));
    let mut client = dir.client();
    let wait = || WaitOptions { timeout: Some(TIMEOUT), ..WaitOptions::forever() };
    for round in 0..3 {
        client.send(Order::reset(None), None, wait()).expect("sent");
        let mut envs = client.recv(wait()).expect("a batch").env_id().to_vec();
        drop(client.recv(wait()).expect("a batch"));
        client.send(Order::Step(&[1; 12]), Some(&envs), wait()).expect("sent");
        let others: Vec<i32> = (0..8).filter(|env| !envs.contains(env)).collect();
        for env in &others {
            client.send(Order::Step(&[6; 3]), Some(&[*env]), wait()).expect("the lane refuses it later");
        }
        assert!(
            smaclite_tests::process::eventually(|| dir.status().lanes[0].stats.rejected == 4 * round + 4)
        );
        // All may come in any order; the last refusal may be counted before it can be read.
        let (mut received, mut refused, mut attempts) = (Vec::new(), Vec::new(), 0..200);
        while received.len() < 4 || refused.len() < 4 {
            attempts.next().unwrap_or_else(|| panic!("only {received:?}, {refused:?}"));
            match client.recv(wait()) {
                Ok(batch) => received.extend_from_slice(batch.env_id()),
                Err(ClientError::NothingToReceive { .. }) => {}
                Err(error) => refused.push(error.to_string()),
            }
        }
        envs.sort_unstable();
        received.sort_unstable();
        assert_eq!(received, envs);
        refused.sort();
        for (env, refused) in others.iter().zip(refused) {
            assert_contains(&refused, &[&format!("environment {env}, agent 0: action 6 is not available")]);
        }
        client.send(Order::Step(&[1; 12]), Some(&others), wait()).expect("they are free");
        client.recv(wait()).expect("a batch");
    }
}
