//! A learner of the pool's own process steps environments while it waits. No thread waits forever, also if
//! the learner or the pool fails. Every frame is compared with the [reference](smaclite_tests::reference).
//! That such a learner sees the same bits as any other is tested in `stepping`.

use smaclite_ipc::{ClientError, Supervisor, WaitStrategy};
use smaclite_tests::fault::Fault;
use smaclite_tests::learner::LearnerError;
use smaclite_tests::process::TIMEOUT;
use smaclite_tests::{LanePlan, Learner, PoolPlan, TestDir};
use std::time::Duration;

fn local_learner(pool: &Supervisor, plan: &LanePlan, wait: WaitStrategy) -> Learner {
    Learner::new(pool.connect(Some(&plan.name), wait).expect("a client"), plan)
}

/// Resets, then steps until `steps` batches came.
fn run(learner: &mut Learner, steps: usize) -> Result<(), LearnerError> {
    learner.reset(Some(3), TIMEOUT)?;
    (0..steps).try_for_each(|_| learner.step(TIMEOUT).map(drop))
}

/// More learners than workers, each on its own thread, and one on a thread that serves two lanes in turn.
#[test]
fn several_learners_take_part_in_a_pool() {
    for threads in [1, 2, 3] {
        let dir = TestDir::new();
        let lane = |name: &str, num_envs, batch_size| LanePlan {
            name: name.to_owned(),
            batch_size,
            ..LanePlan::new("3m", num_envs)
        };
        let lanes = [lane("a", 20, 20), lane("b", 1, 1), lane("c", 9, 4), lane("d", 6, 6), lane("e", 6, 6)];
        let pool = dir.start(&PoolPlan::new(lanes.clone()).threads(threads));
        std::thread::scope(|scope| {
            for plan in &lanes[..3] {
                let mut learner = local_learner(&pool, plan, WaitStrategy::Adaptive);
                scope.spawn(move || run(&mut learner, 300).expect("frames as in the reference"));
            }
            let mut pair = [3, 4].map(|lane| local_learner(&pool, &lanes[lane], WaitStrategy::Adaptive));
            scope.spawn(move || {
                pair.iter_mut().for_each(|learner| learner.reset(None, TIMEOUT).expect("a reset"));
                pair[0].send().expect("sent");
                for step in 0..300 {
                    pair[(step + 1) % 2].send().expect("sent");
                    pair[step % 2].recv(TIMEOUT).expect("a frame as in the reference");
                }
            });
        });
    }
}

/// A lane's requests are received again when the learner that calls is gone, and one that sends comes.
#[test]
fn a_lane_serves_learners_that_call_and_learners_that_send_in_turn() {
    for threads in [1, 2] {
        let dir = TestDir::new();
        let plan = LanePlan::new("2s3z", 6);
        let pool = dir.start(&PoolPlan::new([plan.clone()]).threads(threads));
        for _ in 0..3 {
            run(&mut local_learner(&pool, &plan, WaitStrategy::Block), 5).expect("takes part");
            run(&mut dir.learner(&plan), 5).expect("is served");
        }
    }
}

/// Work that a learner leaves behind is done without it, also if it never waits.
#[test]
fn workers_go_on_while_a_learner_does_something_else() {
    for threads in [1, 2] {
        let dir = TestDir::new();
        let plan = LanePlan { batch_size: 2, ..LanePlan::new("2s3z", 8) };
        let pool = dir.start(&PoolPlan::new([plan.clone()]).threads(threads));
        let mut learner = local_learner(&pool, &plan, WaitStrategy::Adaptive);
        learner.reset(None, TIMEOUT).expect("a reset");
        learner.send().expect("sent");
        learner.recv(TIMEOUT).expect("the first two");
        let all_done = || dir.status().lanes[0].stats.steps == 8;
        assert!(smaclite_tests::process::eventually(all_done), "the other six wait for the learner");
    }
}

#[test]
fn a_panic_on_the_learners_thread_fails_its_lane() {
    for threads in [1, 2] {
        let dir = TestDir::new();
        let lanes = [LanePlan::new("2s3z", 4).fault(2, Fault::PanicInStep(4)), LanePlan::new("3s5z", 4)];
        let pool = dir.start(&PoolPlan::new(lanes.clone()).threads(threads));
        let [mut failed, mut other] =
            [0, 1].map(|lane| local_learner(&pool, &lanes[lane], WaitStrategy::Adaptive));
        failed.reset(None, TIMEOUT).expect("a reset");
        (0..3).for_each(|_| drop(failed.step(TIMEOUT).expect("a step")));
        let error = failed.step(TIMEOUT).expect_err("it panicked").to_string();
        assert!(error.contains("environment 2 broke in step 4"), "{error}");
        run(&mut other, 20).expect("the other lane goes on");
    }
}

#[test]
fn a_pool_ends_while_its_learners_take_part() {
    for threads in [1, 2] {
        let dir = TestDir::new();
        let slow = Fault::Sleep(Duration::from_millis(300));
        let plan = LanePlan::new("2s3z", 4).fault(0, slow);
        let pool = dir.start(&PoolPlan::new([plan.clone()]).threads(threads));
        let mut learner = local_learner(&pool, &plan, WaitStrategy::Adaptive);
        learner.reset(None, TIMEOUT).expect("a reset");
        let ended = std::thread::scope(|scope| {
            let waiting = scope.spawn(|| {
                loop {
                    if let Err(error) = learner.step(TIMEOUT) {
                        return error;
                    }
                }
            });
            std::thread::sleep(Duration::from_millis(100));
            drop(pool);
            waiting.join().expect("no panic")
        });
        assert!(matches!(ended, LearnerError::Client(ClientError::PoolDied { .. })), "{ended}");
        drop(learner);
        dir.assert_empty();
    }
}
