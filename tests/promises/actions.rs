//! Wrong actions: refused by the client before they are sent, naming what was wrong; nothing is stepped.

use crate::assert_says;
use smaclite_ipc::{Client, ClientError, Supervisor, WaitOptions, WaitStrategy};
use smaclite_pool::Autoreset;
use smaclite_tests::pools::process::SOON;
use smaclite_tests::pools::{LanePlan, Player, PoolPlan, Room};

fn wait<'a>(never: &'a mut dyn FnMut() -> bool) -> WaitOptions<'a> {
    WaitOptions { timeout: Some(SOON), interrupted: never }
}

#[test]
fn wrong_actions_are_named_and_nothing_is_stepped() {
    let room = Room::new();
    for batch_size in [4, 2] {
        let plan = PoolPlan::new([LanePlan { batch_size, ..LanePlan::new("2s3z", 4) }]);
        let _supervisor = Supervisor::start(plan.config(room.runtime_dir())).expect("a pool");
        let mut client =
            Client::connect(room.runtime_dir(), "train", None, WaitStrategy::default()).expect("a client");
        let error =
            client.send(&[1; 20], None, WaitOptions::forever()).expect_err("nothing was reset").to_string();
        assert_says(&error, &["reset"]);
        let mut never = || false;
        let mut length = vec![0; 4];
        client.send_reset(None, None, WaitOptions::forever()).expect("sent");
        for _ in 0..4 / batch_size {
            drop(client.recv(wait(&mut never)).expect("a first observation"));
        }
        let mut actions = vec![0; 20];
        client.sample_actions(None, &mut actions).expect("actions");
        let mut refused = |actions: &[i32], envs: Option<&[i32]>, parts: &[&str]| {
            let error =
                client.send(actions, envs, WaitOptions::forever()).expect_err("wrong actions").to_string();
            assert_says(&error, parts);
        };
        for wrong in [99, -1, 11, i32::MIN, 6] {
            let mut actions = actions.clone();
            actions[13] = wrong; // no enemy is near at the start, so attacks are not available either
            let parts = ["environment 2, agent 3", &format!("action {wrong} "), "available: [1"];
            refused(&actions, None, &parts);
        }
        refused(&actions[..19], None, &["19 actions", "take 20"]);
        refused(&actions, Some(&[0, 1, 2]), &["20 actions", "take 15"]);
        if batch_size == 4 {
            refused(&actions[..5], Some(&[0]), &["1 environments", "all 4"]);
        }
        refused(&actions, Some(&[0, 1, 2, 4]), &["environment 4", "0 to 3"]);
        refused(&actions, Some(&[0, 1, 2, -1]), &["environment -1", "0 to 3"]);
        refused(&actions, Some(&[0, 1, 2, 1]), &["environment 1", "twice"]);
        let nothing = client.recv(wait(&mut never)).err().expect("nothing was sent");
        assert!(matches!(nothing, ClientError::NothingToReceive { outstanding: 0, .. }), "{nothing}");
        client.send(&actions, None, WaitOptions::forever()).expect("legal actions");
        for _ in 0..4 / batch_size {
            let batch = client.recv(wait(&mut never)).expect("a step");
            let lengths = batch.field::<i32>(smaclite_pool::fields::Field::EpisodeLength).expect("a field");
            batch.env_id().iter().zip(lengths).for_each(|(env, l)| length[*env as usize] = *l);
        }
        assert_eq!(length, [1; 4], "one step was made, not more");
    }
}

#[test]
fn an_environment_at_work_or_over_takes_no_actions() {
    let room = Room::new();
    let lane = LanePlan {
        batch_size: 2,
        autoreset: Autoreset::Disabled,
        episode_limit: Some(3),
        ..LanePlan::new("2s3z", 4)
    };
    let plan = PoolPlan::new([lane]);
    let _supervisor = Supervisor::start(plan.config(room.runtime_dir())).expect("a pool");
    let mut player = Player::connect(room.runtime_dir(), "train", &plan.lanes[0]).expect("a client");
    player.reset(None, SOON).expect("a reset");
    player.send_to(&[0]).expect("sent");
    let error =
        player.client().send(&[1; 5], Some(&[0]), WaitOptions::forever()).expect_err("at work").to_string();
    assert_says(&error, &["environment 0", "earlier request"]);
    let error = player
        .client()
        .send_reset(None, Some(&[0]), WaitOptions::forever())
        .expect_err("at work")
        .to_string();
    assert_says(&error, &["environment 0", "earlier request"]);
    let outstanding = player.recv(SOON).err().expect("one is not a batch").to_string();
    assert_says(&outstanding, &["1 results", "batch takes 2"]);
    player.send_to(&[3]).expect("sent");
    player.recv(SOON).expect("two are");
    for _ in 0..2 {
        player.send_to(&[0, 3]).expect("sent");
        player.recv(SOON).expect("a batch");
    }
    assert!(player.replay().is_over(0) && player.replay().is_over(3));
    let error =
        player.client().send(&[1; 10], Some(&[1, 3]), WaitOptions::forever()).expect_err("over").to_string();
    assert_says(&error, &["environment 3", "finished", "reset"]);
    player.send_reset(&[0, 3], Some(99)).expect("a reset of some");
    player.recv(SOON).expect("a batch");
    player.send_to(&[0, 3]).expect("sent");
    player.recv(SOON).expect("a batch");
}
