//! What the clients of a chaos run do. Each sends its parent a message whenever something happened, so that
//! silence means that it hangs, and an error as soon as an invariant does not hold. It ends when the parent
//! closes its input.

use crate::fork::child_reads;
use crate::learner::LearnerError;
use crate::process::answer;
use crate::{LanePlan, Learner, PoolPlan, raw_client};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use smaclite_ipc::wire::RequestHeader;
use smaclite_ipc::{Batch, ClientError, LaneDescription, RuntimeDir, Spectator, WaitOptions, status};
use smaclite_pool::transport::{RequestKind, RequestNumber, SessionId};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// The first words of messages that show progress.
pub(super) const PROGRESS: [&str; 5] = ["frames", "read", "sent", "forked", "attempt"];

/// Set when the process is to end.
static END: AtomicBool = AtomicBool::new(false);

/// How often a learner reports its frames.
const REPORT_INTERVAL: Duration = Duration::from_millis(50);

/// Longer than any silence that the parent accepts: the parent detects hangs.
const NO_TIMEOUT: Duration = Duration::from_secs(60);

/// Limit for a forked child.
const FORK_TIMEOUT: Duration = Duration::from_secs(5);

fn is_over() -> bool {
    END.load(Ordering::Relaxed)
}

fn report(message: impl std::fmt::Display) {
    answer::<_, String>(Ok(message));
}

fn sleep(millis: u64) {
    std::thread::sleep(Duration::from_millis(millis));
}

/// A client of a pool.
struct Client {
    runtime_dir: RuntimeDir,
    rng: Pcg64,
    plan: PoolPlan,
}

/// Runs a client: `ROLE SEED PLAN`, where the plan is a [`PoolPlan`] as JSON with the lanes that it uses.
pub fn run(argument: &str) -> i32 {
    let mut words = argument.splitn(3, ' ');
    let role = words.next().unwrap_or_default();
    let seed = words.next().and_then(|seed| seed.parse().ok()).expect("a seed");
    let plan = serde_json::from_str(words.next().unwrap_or_default()).expect("a plan");
    std::thread::spawn(|| {
        for _line in std::io::stdin().lines() {}
        END.store(true, Ordering::Relaxed);
    });
    let runtime_dir = RuntimeDir::for_current_user().expect("a runtime directory");
    let mut client = Client { runtime_dir, rng: Pcg64::seed_from_u64(seed), plan };
    let mut result = Ok(());
    while result.is_ok() && !is_over() {
        result = match role {
            "learner" => client.learner(),
            "spectator" => client.spectator(),
            "invalid_sender" => client.invalid_sender(),
            "forking_learner" => client.forking_learner(),
            "namespace_learner" => client.namespace_learner(),
            other => panic!("there is no role {other}"),
        };
    }
    let Err(error) = result else { return 0 };
    answer::<&str, _>(Err(error));
    1
}

/// The end of a pool is no failure of its client; any other error is.
fn unless_gone(result: Result<(), LearnerError>) -> Result<(), String> {
    match result {
        Ok(()) | Err(LearnerError::Client(ClientError::PoolDied { .. })) => Ok(()),
        Err(error) => Err(error.to_string()),
    }
}

impl Client {
    fn lane(&self) -> &LanePlan {
        &self.plan.lanes[0]
    }

    /// Attaches to the lane. `None` if it is in use or the pool is gone: the parent knows whether that lasts
    /// too long.
    fn connect(&self) -> Option<Learner> {
        match Learner::connect(&self.runtime_dir, &self.plan.name, self.lane()) {
            Ok(learner) => Some(learner),
            Err(error) => {
                report(format!("waits: {error}"));
                sleep(10);
                None
            }
        }
    }

    /// One session, which ends at random, with the pool, or with this process.
    fn learner(&mut self) -> Result<(), String> {
        let Some(mut learner) = self.connect() else { return Ok(()) };
        report("session");
        let max_held = self.lane().max_held_batches - 1;
        let mut held: Vec<(Arc<Batch>, Vec<u8>)> = Vec::new();
        let mut frames = 0u64;
        let mut reported = Instant::now();
        let is_short = self.rng.random_ratio(1, 3);
        let mut steps = if is_short { self.rng.random_range(0..300) } else { u64::MAX };
        let mut must_reset = true;
        while !is_over() && steps > 0 {
            steps -= 1;
            let received = match must_reset {
                true => learner.reset(Some(self.rng.random_range(0..1000)), NO_TIMEOUT).map(|()| None),
                false => learner.step(NO_TIMEOUT).map(Some),
            };
            must_reset = self.rng.random_ratio(1, 200);
            match received {
                Ok(batch) => {
                    frames += 1;
                    self.hold_some(batch, &mut held, max_held)?;
                }
                Err(LearnerError::Client(ClientError::PoolDied { .. })) => {
                    check_unchanged(&held)?; // batches outlive the pool
                    report(format!("gone {frames}"));
                    return Ok(());
                }
                Err(error) => return Err(error.to_string()),
            }
            if self.rng.random_ratio(1, 400) {
                // The client is dropped while a request is being processed.
                let _ = learner.send();
                break;
            }
            if reported.elapsed() >= REPORT_INTERVAL {
                reported = Instant::now();
                report(format!("frames {frames}"));
                frames = 0;
            }
        }
        report(format!("frames {frames}"));
        drop(learner);
        check_unchanged(&held)
    }

    /// Holds some of the batches for a while.
    fn hold_some(
        &mut self,
        batch: Option<Arc<Batch>>,
        held: &mut Vec<(Arc<Batch>, Vec<u8>)>,
        max_held: usize,
    ) -> Result<(), String> {
        if let Some(batch) = batch
            && held.len() < max_held
            && self.rng.random_ratio(1, 4)
        {
            let bytes = batch.bytes().to_vec();
            held.push((batch, bytes));
        }
        if !held.is_empty() && self.rng.random_ratio(1, 10) {
            check_unchanged(held)?;
            held.swap_remove(self.rng.random_range(0..held.len()));
        }
        Ok(())
    }

    /// One session, in which another thread forks children that read the newest batch.
    fn forking_learner(&mut self) -> Result<(), String> {
        let Some(mut learner) = self.connect() else { return Ok(()) };
        let newest = Mutex::new(None::<Arc<(Arc<Batch>, Vec<u8>)>>);
        let ended = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let forks = scope.spawn(|| -> Result<(), String> {
                while !is_over() && !ended.load(Ordering::Relaxed) {
                    let held = newest.lock().expect("no panic").clone();
                    if let Some(held) = held {
                        child_reads(&held.0, &held.1, FORK_TIMEOUT)?;
                        report("forked");
                    }
                    sleep(20);
                }
                Ok(())
            });
            let mut received = learner.reset(None, NO_TIMEOUT);
            while received.is_ok() && !is_over() && !forks.is_finished() {
                received = learner.step(NO_TIMEOUT).map(|batch| {
                    let bytes = batch.bytes().to_vec();
                    *newest.lock().expect("no panic") = Some(Arc::new((batch, bytes)));
                });
            }
            ended.store(true, Ordering::Relaxed);
            forks.join().expect("no panic")?;
            unless_gone(received)
        })
    }

    /// One attempt to attach, which may be refused but must be answered, and a step.
    fn namespace_learner(&mut self) -> Result<(), String> {
        if let Ok(mut learner) = Learner::connect(&self.runtime_dir, &self.plan.name, self.lane()) {
            let reset = learner.reset(None, NO_TIMEOUT);
            unless_gone(reset.and_then(|()| learner.step(NO_TIMEOUT).map(drop)))?;
        }
        report("attempt");
        sleep(20);
        Ok(())
    }

    /// Reads the newest frame of the lane for as long as the pool lives.
    fn spectator(&mut self) -> Result<(), String> {
        let lane = self.lane().name.clone();
        match Spectator::connect(&self.runtime_dir, &self.plan.name, Some(&lane), WaitOptions::for_response())
        {
            Ok(mut spectator) => {
                report("connected");
                while !is_over() && spectator.latest().is_ok() {
                    report("read");
                    sleep(self.rng.random_range(0..100));
                }
            }
            Err(error) => {
                report(format!("waits: {error}"));
                sleep(50);
            }
        }
        Ok(())
    }

    /// Sends requests that no lane may accept to one lane of the pool.
    fn invalid_sender(&mut self) -> Result<(), String> {
        report("chooses a lane");
        sleep(100);
        let Ok(status) = status(&self.runtime_dir, &self.plan.name, WaitOptions::for_response()) else {
            return Ok(());
        };
        let lane = status.lanes.choose(&mut self.rng).expect("a lane").description.clone();
        // `raw_client` panics if the pool goes while it is used. That is expected, so it is not printed.
        std::panic::set_hook(Box::new(|_| {}));
        if catch_unwind(AssertUnwindSafe(|| self.send_invalid(&lane))).is_err() {
            report("the lane is gone");
        }
        Ok(())
    }

    fn send_invalid(&mut self, lane: &LaneDescription) {
        let node = raw_client::node(&self.runtime_dir);
        let requests = raw_client::requests(&node, lane, 4096);
        let layout = lane.layout().expect("a layout");
        let rng = &mut self.rng;
        for number in 0..20 {
            // Sessions are counted from 1, so these do not exist.
            let session = (1 << 40) + rng.random_range(0..100);
            let count = rng.random_range(0..9);
            let mut header = RequestHeader::new(
                &layout,
                SessionId(session),
                RequestNumber(number),
                RequestKind::Step,
                count,
            );
            if rng.random_ratio(1, 2) {
                header.layout_hash ^= 1 << rng.random_range(0..64);
            }
            let payload = vec![rng.random(); rng.random_range(1..=4000)];
            if requests.try_send(header, &payload).is_some() {
                report("sent");
            }
            sleep(1);
        }
    }
}

fn check_unchanged(held: &[(Arc<Batch>, Vec<u8>)]) -> Result<(), String> {
    match held.iter().find(|(batch, bytes)| batch.bytes() != bytes) {
        Some((batch, _)) => Err(format!("WRONG: frame {} changed while it was held", batch.sequence())),
        None => Ok(()),
    }
}
