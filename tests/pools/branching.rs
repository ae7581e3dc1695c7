//! Battles branch: from a snapshot, and from one environment to another, they go on with the bits that they
//! would have had. Every frame is compared with the [reference](smaclite_tests::reference).

use rand::seq::{IndexedRandom, SliceRandom};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use smaclite_engine::{Column, RecordLayout};
use smaclite_ipc::{Batch, Order, Seeds, WaitOptions};
use smaclite_pool::Autoreset;
use smaclite_pool::fields::{FIELDS, Field};
use smaclite_tests::learner::LearnerError;
use smaclite_tests::process::TIMEOUT;
use smaclite_tests::reference::SavedEnv;
use smaclite_tests::{Child, LanePlan, Learner, PoolPlan, TestDir};
use std::sync::Arc;

/// A lane with all fields.
fn lane(scenario: &str, num_envs: usize) -> LanePlan {
    let fields = Some(FIELDS.iter().map(|spec| spec.name.to_owned()).collect());
    LanePlan { fields, ..LanePlan::new(scenario, num_envs) }
}

/// The snapshot in a slot of a batch.
fn snapshot(batch: &Batch, slot: usize) -> &[u8] {
    let all = batch.field::<u8>(Field::Snapshot).expect("the lane has it");
    let size = batch.layout().snapshot_size();
    &all[slot * size..][..size]
}

/// What can be restored later: the states of a batch that is kept.
struct Kept {
    batch: Arc<Batch>,
    states: Vec<SavedEnv>,
}

impl Kept {
    fn new(batch: Arc<Batch>, learner: &Learner) -> Kept {
        let states = batch.env_id().iter().map(|env| learner.reference().save(*env)).collect();
        Kept { batch, states }
    }
}

/// Forks or restores some of the environments that are ready, or does nothing.
fn branch(learner: &mut Learner, kept: Option<&Kept>, rng: &mut Pcg64) -> Result<(), LearnerError> {
    let mut to = learner.ready().to_vec();
    to.shuffle(rng);
    to.truncate(rng.random_range(1..=to.len()));
    let seed = rng.random_ratio(1, 2).then(|| rng.random_range(0..99));
    match (rng.random_range(0..6), kept) {
        (0, _) => {
            let ready = learner.ready().to_vec();
            let from: Vec<i32> = to.iter().map(|_| *ready.choose(rng).expect("not empty")).collect();
            learner.send_fork(&from, &to, seed)
        }
        (1, Some(Kept { batch, states })) => {
            let slots: Vec<usize> = to.iter().map(|_| rng.random_range(0..states.len())).collect();
            let records: Vec<u8> = slots.iter().flat_map(|slot| snapshot(batch, *slot)).copied().collect();
            let states: Vec<SavedEnv> = slots.iter().map(|slot| states[*slot].clone()).collect();
            learner.send_restore(&records, &states, &to, seed)
        }
        _ => Ok(()),
    }
}

/// Steps, forks and restores at random; a synchronous lane does one of them at a time.
fn run(learner: &mut Learner, plan: &LanePlan, frames: usize, rng: &mut Pcg64) -> Result<(), LearnerError> {
    learner.reset(Some(3), TIMEOUT)?;
    let mut kept: Option<Kept> = None;
    for _ in 0..frames {
        let is_over = |env: &i32| learner.reference().is_over(*env);
        let over: Vec<i32> = learner.ready().iter().copied().filter(is_over).collect();
        if plan.autoreset == Autoreset::Disabled && !over.is_empty() {
            learner.send_reset(&over, None)?;
        }
        if !learner.ready().is_empty() {
            branch(learner, kept.as_ref(), rng)?;
        }
        if !learner.ready().is_empty() {
            learner.send()?;
        }
        let batch = learner.recv(TIMEOUT)?;
        if rng.random_ratio(1, 5) {
            kept = Some(Kept::new(batch, learner));
        }
    }
    Ok(())
}

#[test]
fn every_way_of_branching_shows_the_bits_of_the_reference() {
    let dir = TestDir::new();
    let mut rng = Pcg64::seed_from_u64(1);
    for autoreset in [Autoreset::NextStep, Autoreset::SameStep, Autoreset::Disabled] {
        for threads in [1, 2, 4] {
            for batch_size in [12, 5, 1] {
                let plan = LanePlan {
                    autoreset,
                    batch_size,
                    episode_limit: Some(9),
                    obs_last_actions: threads - 1,
                    ..lane("2s3z", 12)
                };
                let pool = PoolPlan::new([plan]).threads(threads);
                let _embedded = dir.start(&pool);
                let mut learner = dir.learner(&pool.lanes[0]);
                let result = run(&mut learner, &pool.lanes[0], 400 / batch_size, &mut rng);
                result
                    .unwrap_or_else(|e| panic!("{threads} threads, {batch_size} of 12, {autoreset:?}: {e}"));
            }
        }
    }
}

#[test]
fn learners_that_take_part_and_other_processes_see_the_same_bits() {
    let mut rng = Pcg64::seed_from_u64(2);
    for batch_size in [6, 2] {
        let dir = TestDir::new();
        let plan = PoolPlan::new([LanePlan { batch_size, ..lane("MMM", 6) }]).threads(2);
        {
            let pool = dir.start(&plan);
            let client = pool.connect(Some("MMM"), Default::default()).expect("a client");
            let mut learner = Learner::new(client, &plan.lanes[0]);
            run(&mut learner, &plan.lanes[0], 100, &mut rng).expect("frames as in the reference");
        }
        let _supervisor = Child::supervisor(&dir, &plan);
        let mut learner = dir.learner(&plan.lanes[0]);
        run(&mut learner, &plan.lanes[0], 100, &mut rng).expect("frames as in the reference");
    }
}

/// A snapshot is plain data: a pool that starts later, with other settings, continues from it.
#[test]
fn a_snapshot_survives_its_pool() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([lane("3s5z", 4)]);
    let (records, states) = {
        let _pool = dir.start(&plan);
        let mut learner = dir.learner(&plan.lanes[0]);
        learner.reset(Some(5), TIMEOUT).expect("a reset");
        (0..8).for_each(|_| drop(learner.step(TIMEOUT).expect("a step")));
        let kept = Kept::new(learner.step(TIMEOUT).expect("a step"), &learner);
        let records: Vec<u8> = (0..4).flat_map(|slot| snapshot(&kept.batch, slot)).copied().collect();
        (records, kept.states)
    };
    let plan = PoolPlan::new([LanePlan { batch_size: 2, seed: 99, ..lane("3s5z", 4) }]).threads(2);
    let _pool = dir.start(&plan);
    let mut learner = dir.learner(&plan.lanes[0]);
    learner.reset(None, TIMEOUT).expect("a reset");
    learner.send_restore(&records, &states, &[3, 2, 1, 0], None).expect("sent");
    (0..2).for_each(|_| drop(learner.recv(TIMEOUT).expect("the states of before")));
    (0..40).for_each(|_| drop(learner.step(TIMEOUT).expect("the future of before")));
}

#[test]
fn what_cannot_be_restored_is_an_error_and_no_environment_changes() {
    let dir = TestDir::new();
    let same_step = LanePlan { name: "same".into(), autoreset: Autoreset::SameStep, ..lane("2s3z", 3) };
    let lanes = [
        LanePlan { episode_limit: Some(2), ..lane("2s3z", 3) },
        LanePlan { name: "history".into(), obs_last_actions: 1, ..lane("2s3z", 3) },
        LanePlan { episode_limit: Some(2), ..same_step },
        lane("3s5z", 3),
        LanePlan { name: "none".into(), ..LanePlan::new("2s3z", 3) },
    ];
    let plan = PoolPlan::new(lanes);
    let _pool = dir.start(&plan);
    let [mut learner, mut history, mut same, mut other, mut none] =
        [0, 1, 2, 3, 4].map(|lane| dir.learner(&plan.lanes[lane]));
    let records = |learner: &mut Learner| {
        learner.reset(None, TIMEOUT).expect("a reset");
        learner.step(TIMEOUT).expect("a step");
        let batch = learner.step(TIMEOUT).expect("a step");
        batch.field::<u8>(Field::Snapshot).map(<[u8]>::to_vec).unwrap_or_default()
    };
    let (good, longer, foreign) = (records(&mut learner), records(&mut history), records(&mut other));
    records(&mut same);
    records(&mut none);
    let refusal = |learner: &mut Learner, records: &[u8], expected: &str| {
        let sent = learner.client().send(
            Order::Restore { snapshots: records, seeds: Seeds::Continue },
            None,
            WaitOptions::forever(),
        );
        let error = match sent {
            Err(error) => error.to_string(),
            Ok(()) => learner.recv(TIMEOUT).expect_err("a refusal").to_string(),
        };
        assert!(error.contains(expected), "{error:?} does not contain {expected:?}");
    };
    let size = good.len() / 3;
    let changed = |at: usize, value: u8| {
        let mut records = good.clone();
        records[2 * size + at] ^= value;
        records
    };
    refusal(&mut learner, &changed(size - 9, 1), "environment 2 cannot be restored: the snapshot is damaged");
    refusal(&mut learner, &changed(0, 1), "environment 2 cannot be restored: these bytes are no snapshot");
    refusal(&mut learner, &changed(8, 1), "environment 2 cannot be restored: the snapshot has version 6");
    let layout = RecordLayout::of(&good[..size]).expect("a snapshot");
    let mut edited = good.clone();
    layout.column_mut(&mut edited[size..2 * size], Column::Shield)[16..24]
        .copy_from_slice(&(-1f64).to_le_bytes());
    layout.seal(&mut edited[size..2 * size]);
    refusal(
        &mut learner,
        &edited,
        "environment 1 cannot be restored: snapshot column 'shield' must be between 0",
    );
    refusal(&mut learner, &foreign, "battles of 8 agents and 8 enemies, and these have 5 and 5");
    refusal(&mut history, &good, "of a lane with `obs_last_actions` 0, and this one has 1");
    refusal(&mut learner, &longer, "of a lane with `obs_last_actions` 1, and this one has 0");
    refusal(&mut learner, &good[size..], "take 3 snapshots of");
    refusal(&mut same, &good, "environment 0 cannot be restored: the episode of the snapshot is over");
    refusal(&mut none, &good, "no snapshots: name the field `snapshot`");
    // The first snapshot of each was good; no environment took it, and the lanes go on.
    for learner in [&mut learner, &mut history, &mut same, &mut other, &mut none] {
        (0..3).for_each(|_| drop(learner.step(TIMEOUT).expect("as if nothing had been asked")));
    }
}
