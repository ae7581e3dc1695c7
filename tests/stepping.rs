//! How batches are stepped: asynchronously, by any number of threads, over either transport, with every
//! autoreset mode: always the bits of the undisturbed run. Every frame is compared with battles played
//! directly by the engine (`pools::replay`), so two ways of stepping that both agree with it agree with each
//! other.

use smaclite_ipc::{Client, Supervisor, WaitOptions, WaitStrategy};
use smaclite_pool::Autoreset;
use smaclite_pool::fields::Field;
use smaclite_tests::pools::games::Oddity;
use smaclite_tests::pools::player::Trouble;
use smaclite_tests::pools::process::SOON;
use smaclite_tests::pools::{Child, LanePlan, Player, PoolPlan, Room};
use std::time::{Duration, Instant};

/// Not a test: what children run, which are this program with a role.
#[test]
#[ignore = "children run it"]
fn role() {
    smaclite_tests::pools::role::play_if_asked();
}

/// Resets and makes `frames` steps of a batch, resetting by hand where nothing else does.
fn play(player: &mut Player, plan: &LanePlan, frames: usize) -> Result<(), Trouble> {
    player.reset(Some(3), SOON)?;
    for frame in 0..frames {
        let over: Vec<i32> = match plan.autoreset {
            Autoreset::Disabled => player.ready().iter().copied().filter(|e| player.is_over(*e)).collect(),
            _ => Vec::new(),
        };
        if !over.is_empty() {
            let seed = (frame % 2 == 0).then_some(frame as u64);
            player.send_reset(&over, seed)?;
        }
        // A synchronous lane either resets or steps, an asynchronous one both at once.
        if !player.ready().is_empty() {
            player.send()?;
        }
        player.recv(SOON)?;
    }
    Ok(())
}

#[test]
fn every_way_of_stepping_shows_the_bits_of_the_undisturbed_run() {
    let room = Room::new();
    for autoreset in [Autoreset::NextStep, Autoreset::SameStep, Autoreset::Disabled] {
        for threads in [1, 2, 4] {
            for batch_size in [12, 5, 1] {
                let plan =
                    LanePlan { autoreset, batch_size, episode_limit: Some(9), ..LanePlan::new("2s3z", 12) };
                let pool = PoolPlan::new([plan]).threads(threads);
                let _embedded = Supervisor::start(pool.config(room.runtime_dir())).expect("a pool");
                let mut player =
                    Player::connect(room.runtime_dir(), "train", &pool.lanes[0]).expect("a client");
                let played = play(&mut player, &pool.lanes[0], 400 / batch_size);
                played
                    .unwrap_or_else(|e| panic!("{threads} threads, {batch_size} of 12, {autoreset:?}: {e}"));
            }
        }
    }
}

#[test]
fn other_processes_see_the_same_bits() {
    for (threads, batch_size) in [(1, 6), (2, 6), (4, 2)] {
        let room = Room::new();
        let plan = PoolPlan::new([LanePlan { batch_size, ..LanePlan::new("3s5z", 6) }]).threads(threads);
        let _supervisor = Child::supervisor(&room, &plan);
        let mut player = Player::connect(room.runtime_dir(), "train", &plan.lanes[0]).expect("a client");
        let played = play(&mut player, &plan.lanes[0], 200 / batch_size);
        played.unwrap_or_else(|e| panic!("{threads} threads, {batch_size} of 6: {e}"));
    }
}

#[test]
fn no_environment_starves_in_asynchronous_mode() {
    let room = Room::new();
    for (threads, oddity) in [(1, Oddity::None), (2, Oddity::None), (2, Oddity::Sleeps { env: 5, millis: 2 })]
    {
        let plan =
            PoolPlan::new([LanePlan { batch_size: 4, oddity, ..LanePlan::new("MMM", 16) }]).threads(threads);
        let _supervisor = Supervisor::start(plan.config(room.runtime_dir())).expect("a pool");
        let mut player = Player::connect(room.runtime_dir(), "train", &plan.lanes[0]).expect("a client");
        // Environments stay with their worker (a half each, with two). How the cores are shared between
        // workers is the kernel's affair, so what is promised is this: every environment goes on, and within
        // a worker nobody is passed over, however slow a neighbour is.
        player.reset(Some(3), SOON).expect("a reset");
        let mut batches = 0;
        let mut steps = Vec::new();
        while steps.iter().min() < Some(&50) {
            player.step(SOON).expect("a frame as in the undisturbed run");
            batches += 1;
            steps = (0..16).map(|env| player.replay().steps(env)).collect();
            assert!(batches < 100_000, "some environments starve: {steps:?}");
        }
        println!(
            "{threads} threads, {oddity:?}: steps of 16 environments in {batches} batches of 4: {steps:?}"
        );
        for sharing in steps.chunks(16 / threads) {
            let (least, most) = (sharing.iter().min().unwrap_or(&0), sharing.iter().max().unwrap_or(&0));
            assert!(least * 3 >= *most * 2, "some environments are passed over: {steps:?}");
        }
    }
}

#[test]
fn a_slow_environment_does_not_hold_back_a_batch_of_others() {
    let room = Room::new();
    let oddity = Oddity::Sleeps { env: 0, millis: 1000 };
    let plan = PoolPlan::new([LanePlan { batch_size: 2, oddity, ..LanePlan::new("2s3z", 8) }]).threads(2);
    let _supervisor = Supervisor::start(plan.config(room.runtime_dir())).expect("a pool");
    let mut player = Player::connect(room.runtime_dir(), "train", &plan.lanes[0]).expect("a client");
    player.reset(None, SOON).expect("a reset");
    let begin = Instant::now();
    // Environments 4 to 7 are the other worker's.
    player.send_to(&[0, 4, 5, 6, 7]).expect("sent");
    let first = player.recv(SOON).expect("a batch");
    assert!(first.env_id().iter().all(|env| *env >= 4), "{:?}", first.env_id());
    println!("the first batch came after {:?}", begin.elapsed());
}

#[test]
fn same_step_shows_the_last_of_the_old_episode_and_the_first_of_the_new() {
    let room = Room::new();
    let plan =
        LanePlan { autoreset: Autoreset::SameStep, episode_limit: Some(4), ..LanePlan::new("2s3z", 3) };
    let pool = PoolPlan::new([plan]);
    let _supervisor = Supervisor::start(pool.config(room.runtime_dir())).expect("a pool");
    let mut player = Player::connect(room.runtime_dir(), "train", &pool.lanes[0]).expect("a client");
    player.reset(None, SOON).expect("a reset");
    let fields = [Field::Obs, Field::FinalObs, Field::State, Field::FinalState];
    let mut before = Vec::new();
    for step in 1..=12 {
        let batch = player.step(SOON).expect("a step as in the undisturbed run");
        let ended = step % 4 == 0;
        assert_eq!(batch.truncated(), [u8::from(ended); 3], "step {step}");
        let lengths = batch.field::<i32>(Field::EpisodeLength).expect("a field");
        assert_eq!(lengths, [if ended { 4 } else { step % 4 }; 3], "step {step}");
        let [obs, final_obs, state, final_state] = fields.map(|f| batch.field::<f32>(f).expect("a field"));
        if ended {
            assert_ne!(obs, final_obs, "units have moved since the start");
            assert_ne!(state, final_state);
            assert_ne!(final_obs, before, "the last observation is newer than the one before");
        }
        before = obs.to_vec();
    }
}

#[test]
fn only_the_chosen_fields_are_there() {
    let room = Room::new();
    for autoreset in [Autoreset::NextStep, Autoreset::SameStep] {
        let fields = Some(vec!["obs".into(), "final_obs".into()]);
        let plan = LanePlan { fields, autoreset, ..LanePlan::new("2s3z", 4) };
        let pool = PoolPlan::new([plan.clone()]);
        let supervisor = Supervisor::start(pool.config(room.runtime_dir())).expect("a pool");
        let mut player = Player::connect(room.runtime_dir(), "train", &pool.lanes[0]).expect("a client");
        play(&mut player, &plan, 60).expect("frames as in the undisturbed run");
        let batch = player.step(SOON).expect("a step");
        let there: Vec<_> = batch.layout().fields().iter().map(|f| f.spec().name).collect();
        let mut expected = vec!["env_id", "obs", "reward", "terminated", "truncated"];
        expected.extend((autoreset == Autoreset::SameStep).then_some("final_obs"));
        assert_eq!(there, expected);
        assert!(batch.field::<f32>(Field::State).is_none());
        let lean = supervisor.shared_memory();
        drop((supervisor, player, batch));
        let full = PoolPlan::new([LanePlan { fields: None, ..plan }]);
        let full = Supervisor::start(full.config(room.runtime_dir())).expect("a pool").shared_memory();
        assert!(lean < full, "{lean} bytes without, {full} with all fields");
    }
}

#[test]
fn a_whole_reset_drops_what_is_under_way() {
    let room = Room::new();
    for (threads, batch_size) in [(1, 8), (2, 8), (4, 8), (2, 4), (4, 1)] {
        let plan = PoolPlan::new([LanePlan { batch_size, ..LanePlan::new("2s3z", 8) }]).threads(threads);
        let _supervisor = Supervisor::start(plan.config(room.runtime_dir())).expect("a pool");
        let mut player = Player::connect(room.runtime_dir(), "train", &plan.lanes[0]).expect("a client");
        player.reset(Some(0), SOON).expect("a reset");
        for round in 1..150 {
            player.send_to(&(0..8).collect::<Vec<_>>()).expect("sent");
            if round % 3 == 0 {
                std::thread::sleep(Duration::from_micros(30 * round));
            }
            // Of the steps just sent some are made and some are not; none may show.
            player
                .reset(Some(round), SOON)
                .unwrap_or_else(|e| panic!("{threads} threads, round {round}: {e}"));
        }
        play(&mut player, &plan.lanes[0], 20).expect("frames as in the undisturbed run");
    }
}

#[test]
fn a_wait_ends_by_its_timeout_or_an_interruption() {
    let room = Room::new();
    let oddity = Oddity::Sleeps { env: 0, millis: 1500 };
    let plan = PoolPlan::new([LanePlan { oddity, ..LanePlan::new("2s3z", 2) }]);
    let _supervisor = Supervisor::start(plan.config(room.runtime_dir())).expect("a pool");
    for wait in [WaitStrategy::default(), WaitStrategy::Block, WaitStrategy::Spin] {
        let mut client = Client::connect(room.runtime_dir(), "train", None, wait).expect("a client");
        let mut never = || false;
        let wait = WaitOptions { timeout: Some(SOON), interrupted: &mut never };
        drop(client.reset(None, None, wait).expect("a reset"));
        let mut actions = vec![0; 10];
        client.sample_actions(None, &mut actions).expect("actions");
        client.send(&actions, None, WaitOptions::forever()).expect("sent");
        let timeout = Some(Duration::from_millis(50));
        let error = client.recv(WaitOptions { timeout, interrupted: &mut never }).err().expect("it sleeps");
        assert!(error.to_string().contains("0.05 s"), "{error}");
        let mut asked = 0;
        let mut interrupted = || {
            asked += 1;
            true
        };
        let error = client.recv(WaitOptions { timeout: None, interrupted: &mut interrupted });
        assert!(error.err().expect("interrupted").to_string().contains("interrupted"));
        assert_eq!(asked, 1);
        let wait = WaitOptions { timeout: Some(SOON), interrupted: &mut never };
        client.recv(wait).expect("the result comes all the same");
    }
}
