//! Wrong actions: the client refuses them before they are sent, and its error names what was wrong.

use crate::assert_contains;
use smaclite_ipc::{Client, ClientError, WaitOptions};
use smaclite_pool::Autoreset;
use smaclite_tests::process::TIMEOUT;
use smaclite_tests::{LanePlan, PoolPlan, TestDir};

fn wait<'a>(never: &'a mut dyn FnMut() -> bool) -> WaitOptions<'a> {
    WaitOptions { timeout: Some(TIMEOUT), interrupted: never }
}

#[test]
fn wrong_actions_are_named_and_nothing_is_stepped() {
    let dir = TestDir::new();
    for batch_size in [4, 2] {
        let plan = PoolPlan::new([LanePlan { batch_size, ..LanePlan::new("2s3z", 4) }]);
        let _supervisor = dir.start(&plan);
        let mut client = dir.client();
        let error =
            client.send(&[1; 20], None, WaitOptions::forever()).expect_err("nothing was reset").to_string();
        assert_contains(&error, &["reset"]);
        let mut never = || false;
        let mut length = vec![0; 4];
        client.send_reset(None, None, WaitOptions::forever()).expect("sent");
        for _ in 0..4 / batch_size {
            drop(client.recv(wait(&mut never)).expect("a first observation"));
        }
        let actions = [1; 20];
        let mut refused = |actions: &[i32], envs: Option<&[i32]>, parts: &[&str]| {
            let error = step(&mut client, actions, envs).expect_err("wrong actions").to_string();
            assert_contains(&error, parts);
        };
        for wrong in [99, -1, 11, i32::MIN, 6] {
            let mut actions = actions;
            actions[13] = wrong; // no enemy is near at the start, so attacks are not available either
            let parts = ["environment 2, agent 3", &format!("action {wrong} "), "available: [1"];
            refused(&actions, None, &parts);
        }
        refused(&actions[..19], None, &["19 actions", "take 20"]);
        refused(&actions, Some(&[0, 1, 2]), &["20 actions", "take 15"]);
        if batch_size == 4 {
            refused(&actions[..5], Some(&[0]), &["got 1", "all 4"]);
        }
        refused(&actions, Some(&[0, 1, 2, 4]), &["environment 4", "0 to 3"]);
        refused(&actions, Some(&[0, 1, 2, -1]), &["environment -1", "0 to 3"]);
        refused(&actions, Some(&[0, 1, 2, 1]), &["environment 1", "twice"]);
        let nothing = client.recv(wait(&mut never)).expect_err("nothing was sent");
        assert!(matches!(nothing, ClientError::NothingToReceive { outstanding: 0, .. }), "{nothing}");
        client.send(&actions, None, WaitOptions::forever()).expect("legal actions");
        for _ in 0..4 / batch_size {
            let batch = client.recv(wait(&mut never)).expect("a step");
            let lengths = batch.field::<i32>(smaclite_pool::fields::Field::EpisodeLength).expect("a field");
            batch.env_id().iter().zip(lengths).for_each(|(env, l)| length[*env as usize] = *l);
        }
        assert_eq!(length, [1; 4], "exactly one step");
    }
}

/// Sends actions and receives the batch, or why they are refused: the client knows which environments exist
/// and are busy, and the lane everything else.
fn step(client: &mut Client, actions: &[i32], env_ids: Option<&[i32]>) -> Result<(), ClientError> {
    client.send(actions, env_ids, WaitOptions::forever())?;
    client.recv(WaitOptions::forever()).map(drop)
}

#[test]
fn actions_for_a_busy_or_finished_environment_are_refused() {
    let dir = TestDir::new();
    let lane = LanePlan {
        batch_size: 2,
        autoreset: Autoreset::Disabled,
        episode_limit: Some(3),
        ..LanePlan::new("2s3z", 4)
    };
    let plan = PoolPlan::new([lane]);
    let _supervisor = dir.start(&plan);
    let mut learner = dir.learner(&plan.lanes[0]);
    learner.reset(None, TIMEOUT).expect("a reset");
    learner.send_to(&[0]).expect("sent");
    let error = learner
        .client()
        .send(&[1; 5], Some(&[0]), WaitOptions::forever())
        .expect_err("a busy environment")
        .to_string();
    assert_contains(&error, &["environment 0", "earlier request"]);
    let error = learner
        .client()
        .send_reset(None, Some(&[0]), WaitOptions::forever())
        .expect_err("a busy environment")
        .to_string();
    assert_contains(&error, &["environment 0", "earlier request"]);
    let outstanding = learner.recv(TIMEOUT).expect_err("one result is no batch").to_string();
    assert_contains(&outstanding, &["of the 2 results", "1 are outstanding"]);
    learner.send_to(&[3]).expect("sent");
    learner.recv(TIMEOUT).expect("two results are a batch");
    for _ in 0..2 {
        learner.send_to(&[0, 3]).expect("sent");
        learner.recv(TIMEOUT).expect("a batch");
    }
    assert!(learner.reference().is_over(0) && learner.reference().is_over(3));
    learner.client().send(&[1; 10], Some(&[1, 3]), WaitOptions::forever()).expect("sent");
    let error = learner.recv(TIMEOUT).expect_err("a finished environment").to_string();
    assert_contains(&error, &["environment 3", "finished", "reset"]);
    learner.send_reset(&[0, 3], Some(99)).expect("a reset of some");
    learner.recv(TIMEOUT).expect("a batch");
    learner.send_to(&[0, 3]).expect("sent");
    learner.recv(TIMEOUT).expect("a batch");
}
