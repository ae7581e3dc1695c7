//! Followers: what they play again is what the learner sees, and they disturb no other process.

use rustix::process::Signal;
use smaclite_engine::{Battle, Faction, Scratch};
use smaclite_ipc::{
    Client, ClientError, ConnectError, ControlSocketError, FollowedPart, Follower, MAX_LOG_BYTES, Piece,
    WaitOptions,
};
use smaclite_pool::Autoreset;
use smaclite_pool::fields::Field;
use smaclite_tests::process::{TIMEOUT, eventually};
use smaclite_tests::{Child, LanePlan, PoolPlan, TestDir};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

fn follow(dir: &TestDir, lane: Option<&str>, env_ids: &[usize]) -> Result<Follower, ConnectError> {
    Follower::connect(dir.runtime_dir(), "train", lane, env_ids, WaitOptions::for_response())
}

/// All that happened since the last call.
fn read_all(follower: &mut Follower) -> Result<Vec<FollowedPart>, ClientError> {
    let mut all = Vec::new();
    loop {
        let Piece { parts, more } = follower.read(WaitOptions::for_response())?;
        all.extend(parts);
        if !more {
            return Ok(all);
        }
    }
}

/// Plays again what a follower receives.
struct Mirror {
    follower: Follower,
    scratch: Scratch,
    /// By environment: its battle, the number of its episode, and whether that is over.
    battles: BTreeMap<usize, (Battle, u64, bool)>,
}

impl Mirror {
    fn follow(dir: &TestDir, env_ids: &[usize]) -> Mirror {
        let follower = follow(dir, None, env_ids).expect("a follower");
        let battle = |env_id: &usize| (*env_id, (Battle::new(Arc::clone(follower.arena()), 0), 0, false));
        Mirror { scratch: Scratch::new(), battles: env_ids.iter().map(battle).collect(), follower }
    }

    fn catch_up(&mut self) {
        for followed in read_all(&mut self.follower).expect("the pool lives") {
            let (battle, number, is_over) = self.battles.get_mut(&followed.env_id).expect("it is followed");
            if let Some(start) = &followed.start {
                battle.restore(start).expect("a snapshot of the same scenario");
            } else {
                assert_eq!(*number, followed.number, "another episode has a start");
            }
            (*number, *is_over) = (followed.number, followed.is_over);
            for actions in followed.actions.chunks(battle.arena().sizes().n_agents) {
                let actions: Vec<i32> = actions.iter().map(|action| i32::from(*action)).collect();
                let step = battle.step(&actions, &mut self.scratch).expect("legal actions");
                assert!(
                    !(step.terminated || step.truncated) || *is_over,
                    "the end is reported with its step"
                );
            }
        }
    }

    fn state(&self, env_id: usize) -> Vec<f32> {
        let battle = &self.battles[&env_id].0;
        let mut state = vec![0.0; battle.arena().sizes().state_size];
        battle.write_state(Faction::Ally, &mut state);
        state
    }
}

/// Steps a batch of legal actions; the state of every environment after it.
fn step(client: &mut Client) -> Vec<Vec<f32>> {
    let sizes = client.description().sizes;
    let mut actions = vec![0; client.description().settings.num_envs * sizes.n_agents];
    client.sample_actions(None, &mut actions).expect("legal actions");
    let batch = client.step(&actions, None, WaitOptions::forever()).expect("a batch");
    let state = batch.field::<f32>(Field::State).expect("every field");
    state.chunks(sizes.state_size).map(<[f32]>::to_vec).collect()
}

#[test]
fn followers_play_again_what_the_learner_sees() {
    for autoreset in [Autoreset::NextStep, Autoreset::SameStep] {
        let dir = TestDir::new();
        let lane = LanePlan { autoreset, episode_limit: Some(7), ..LanePlan::new("MMM", 3) };
        let plan = PoolPlan::new([lane]).threads(2);
        let _supervisor = dir.start(&plan);
        let mut client = dir.client();
        client.reset(Some(5), None, WaitOptions::forever()).expect("a batch");
        (0..4).for_each(|_| drop(step(&mut client)));

        // The first follower begins in the middle of an episode, the second one later.
        let mut first = Mirror::follow(&dir, &[0, 2]);
        let mut second = None;
        for round in 0..40 {
            let states = step(&mut client);
            if round == 10 {
                second = Some(Mirror::follow(&dir, &[2]));
            }
            if round % 3 == 0 {
                first.catch_up();
                assert_eq!([first.state(0), first.state(2)], [states[0].clone(), states[2].clone()]);
            }
            if round % 7 == 0
                && let Some(second) = &mut second
            {
                second.catch_up();
                assert_eq!(second.state(2), states[2]);
            }
        }
        drop(first);
        let states = step(&mut client);
        let second = second.as_mut().expect("it follows");
        second.catch_up();
        assert_eq!(second.state(2), states[2], "the log lasts as long as its last follower");
        assert!(second.battles[&2].1 > 3, "several episodes");
    }
}

#[test]
fn a_follower_of_what_cannot_be_followed_gets_an_error() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("3m", 2), LanePlan::new("MMM", 2)]);
    let _supervisor = dir.start(&plan);
    let error = |lane: Option<&str>, env_ids: &[usize]| {
        let follower = follow(&dir, lane, env_ids);
        follower.err().expect("it is refused").to_string()
    };
    let too_many = vec![0; 65];
    for (lane, env_ids, parts) in [
        (None, &[0][..], &["several lanes", "`3m`"][..]),
        (Some("3s5z"), &[0], &["no lane `3s5z`"]),
        (Some("3m"), &[1, 2], &["env_id must be below 2", "got 2"]),
        (Some("3m"), &[], &["between 1 and 64", "got 0"]),
        (Some("3m"), &too_many, &["between 1 and 64", "got 65"]),
    ] {
        crate::assert_contains(&error(lane, env_ids), parts);
    }
    let connect = || follow(&dir, Some("3m"), &[0]).expect("a follower");
    let mut followers: Vec<Follower> = (0..16).map(|_| connect()).collect();
    crate::assert_contains(&error(Some("3m"), &[1]), &["lane `3m`", "16 followers"]);
    followers.pop();
    let is_free = || follow(&dir, Some("3m"), &[1]).is_ok();
    assert!(eventually(is_free), "a follower that left makes room");
}

#[test]
fn followers_that_stop_or_outlive_their_pool_disturb_no_other_process() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4)]);
    let (mut supervisor, mut learner) = Child::supervisor_and_learner(&dir, &plan);
    let mut mirror = Mirror::follow(&dir, &[0, 1, 2, 3]);
    let mut idle = Mirror::follow(&dir, &[3]);
    learner.must("step 200");
    mirror.catch_up();
    learner.must("check");
    idle.catch_up();
    assert_eq!(idle.state(3), mirror.state(3));
    supervisor.signal(Signal::KILL);
    supervisor.wait(TIMEOUT);
    let error = read_all(&mut mirror.follower).expect_err("the pool is dead");
    assert!(matches!(error, ClientError::PoolDied { .. }), "{error}");
}

/// Environments whose episodes end with every step, so that their logs grow as fast as possible.
fn short_episodes(num_envs: usize) -> PoolPlan {
    PoolPlan::new([LanePlan { episode_limit: Some(1), ..LanePlan::new("27m_vs_30m", num_envs) }])
}

/// 64 environments of 27m_vs_30m with one-step episodes took gigabytes, which one answer carried: neither it
/// nor any status could be read.
#[test]
fn what_is_read_late_is_limited_and_what_was_lost_is_counted() {
    let dir = TestDir::new();
    let _supervisor = Child::supervisor(&dir, &short_episodes(64));
    let env_ids: Vec<usize> = (0..64).collect();
    let mut late = follow(&dir, None, &env_ids).expect("a follower");
    let mut client = dir.client();
    client.reset(Some(5), None, WaitOptions::forever()).expect("a batch");
    (0..500).for_each(|_| drop(step(&mut client)));

    let parts = read_all(&mut late).expect("the pool lives");
    let start_bytes = Battle::new(Arc::clone(late.arena()), 0).record().len();
    let bytes =
        |part: &FollowedPart| usize::from(part.start.is_some()) * start_bytes + 2 * part.actions.len();
    let read: usize = parts.iter().map(bytes).sum();
    assert!(read <= MAX_LOG_BYTES && read > MAX_LOG_BYTES / 2, "{read} bytes");
    for env_id in env_ids {
        let of_env: Vec<_> = parts.iter().filter(|part| part.env_id == env_id).collect();
        let first = of_env.first().expect("a part of every environment");
        assert!(first.lost > 50 && first.start.is_some(), "lost {}", first.lost);
        let numbers = of_env.iter().map(|part| part.number);
        // Episode 0 was reset before its first step.
        assert!(numbers.eq(first.lost + 1..=first.lost + of_env.len() as u64));
        assert!(of_env[1..].iter().all(|part| part.lost == 0));
    }
    drop(step(&mut client));
    let next = read_all(&mut late).expect("the pool lives");
    assert!(next.len() <= 2 * 64 && next.iter().all(|part| part.lost == 0));
}

/// While followers read, the supervisor encoded everything that was unread for one after the other: 16 s, in
/// which no process could attach.
#[test]
fn a_pool_answers_while_sixteen_followers_read() {
    let dir = TestDir::new();
    let _supervisor = Child::supervisor(&dir, &short_episodes(64));
    let env_ids: Vec<usize> = (0..64).collect();
    let connect = |_| follow(&dir, None, &env_ids).expect("a follower");
    let followers: Vec<Follower> = (0..16).map(connect).collect();
    let mut client = dir.client();
    client.reset(Some(5), None, WaitOptions::forever()).expect("a batch");
    (0..200).for_each(|_| drop(step(&mut client)));
    let stop = AtomicBool::new(false);
    let mut longest = Duration::ZERO;
    std::thread::scope(|scope| {
        for mut follower in followers {
            let stop = &stop;
            scope.spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    read_all(&mut follower).expect("the pool lives");
                }
            });
        }
        for _ in 0..50 {
            let begin = Instant::now();
            dir.status();
            longest = longest.max(begin.elapsed());
            drop(step(&mut client));
        }
        stop.store(true, Ordering::Relaxed);
    });
    println!("the longest wait for a status: {longest:?}");
    assert!(longest < Duration::from_secs(5), "{longest:?}");
}

/// After a wait that ended too early, each later request got the answer of the one before.
#[test]
fn a_late_answer_is_not_taken_for_the_next_one() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let (supervisor, mut learner) = Child::supervisor_and_learner(&dir, &plan);
    let mut follower = follow(&dir, None, &[0]).expect("a follower");
    let mut steps = 0;
    let mut count = |parts: Vec<FollowedPart>| {
        steps += parts.iter().map(|part| part.actions.len() / 5).sum::<usize>();
        steps
    };
    learner.must("step 10");
    let before = count(read_all(&mut follower).expect("the pool lives"));
    supervisor.signal(Signal::STOP);
    for _ in 0..2 {
        let wait = WaitOptions { timeout: Some(Duration::from_millis(100)), ..WaitOptions::forever() };
        let error = follower.read(wait).expect_err("it is stopped");
        assert!(matches!(error, ClientError::Control(ControlSocketError::Silent { .. })), "{error}");
    }
    supervisor.signal(Signal::CONT);
    assert!(eventually(|| dir.status().lanes[0].stats.steps > 0));
    learner.must("step 30");
    let after = count(read_all(&mut follower).expect("the pool lives"));
    // A reset is not a step of the log.
    assert!(after >= before + 27, "{before} steps, then {after}");
    assert_eq!(count(read_all(&mut follower).expect("the pool lives")), after, "everything was read at once");
}
