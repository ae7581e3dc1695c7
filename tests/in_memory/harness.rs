//! Pools in this process, and learners without the checks of the real client.

use smaclite_pool::layout::Layout;
use smaclite_pool::transport::{Doorbell, Epoch, RequestKind, RequestNumber, SessionId};
use smaclite_pool::{Pool, PoolOptions, Rejection, WaitStrategy};
use smaclite_tests::conformance::Stepping;
use smaclite_tests::in_memory::{Bell, Frame, InMemory, LearnerSide, SentMessage, lane};
use smaclite_tests::{LanePlan, Row};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Long enough for valgrind and Miri; only a test that fails waits for it.
const TIMEOUT: Duration = Duration::from_secs(30);

/// Starts a pool and attaches a learner to each lane.
pub fn start(threads: usize, lanes: &[LanePlan]) -> (Pool<InMemory>, Vec<Learner>) {
    start_waiting(WaitStrategy::default(), threads, lanes)
}

/// [`start`] with a wait strategy.
pub fn start_waiting(
    wait: WaitStrategy,
    threads: usize,
    lanes: &[LanePlan],
) -> (Pool<InMemory>, Vec<Learner>) {
    let bell = Bell::default();
    let mut parts = Vec::new();
    let mut learners = Vec::new();
    for plan in lanes {
        let spec = plan.spec();
        let layout = spec.layout();
        let (part, side) = lane(spec);
        parts.push(part);
        let (bell, num_envs) = (bell.clone(), plan.num_envs);
        learners.push(Learner { side, bell, layout, num_envs, session: 1, number: 0, epoch: 0 });
    }
    let pool = Pool::start(parts, bell, PoolOptions { threads, wait }).expect("worker threads");
    (0..lanes.len()).for_each(|lane| pool.lane(lane).set_session(Some(SessionId(1))));
    (pool, learners)
}

/// Starts a pool with one lane.
pub fn start_one(threads: usize, plan: &LanePlan) -> (Pool<InMemory>, Learner) {
    let (pool, mut learners) = start(threads, std::slice::from_ref(plan));
    (pool, learners.remove(0))
}

/// A learner that may send anything.
pub struct Learner {
    side: LearnerSide,
    bell: Bell,
    pub layout: Layout,
    num_envs: usize,
    pub session: u64,
    pub number: u64,
    epoch: u64,
}

impl Learner {
    /// Resets every environment.
    pub fn send_reset_all(&mut self, seed: Option<u64>) {
        self.epoch = self.number + 1;
        self.send_reset(seed, &all(self.num_envs));
    }

    /// Resets these environments.
    pub fn send_reset(&mut self, seed: Option<u64>, env_ids: &[i32]) {
        self.send(RequestKind::Reset { seeds: seed.into(), levels: false }, env_ids, &[]);
    }

    /// Sends actions.
    pub fn send_step(&mut self, env_ids: &[i32], actions: &[i32]) {
        self.send(RequestKind::Step, env_ids, actions);
    }

    /// Sends legal actions to the environments of these rows.
    pub fn step_rows(&mut self, rows: &[Row]) {
        let env_ids: Vec<_> = rows.iter().map(Row::env).collect();
        self.send_step(&env_ids, &legal_actions(rows));
    }

    fn send(&mut self, kind: RequestKind, env_ids: &[i32], actions: &[i32]) {
        self.number += 1;
        self.send_raw(SentMessage {
            session: self.session,
            number: self.number,
            kind: Some(kind),
            env_ids: env_ids.to_vec(),
            actions: actions.to_vec(),
        });
    }

    /// Sends any message.
    pub fn send_raw(&self, message: SentMessage) {
        self.side.requests.send(message).expect("the pool lives");
        self.bell.ring();
    }

    /// The next frame.
    pub fn frame(&self) -> Frame {
        self.side.frames.recv_timeout(TIMEOUT).expect("a frame")
    }

    /// The next batch of this epoch.
    pub fn batch(&self) -> Vec<Row> {
        loop {
            let frame = self.frame();
            if let Some((request, rejection)) = frame.rejection() {
                panic!("request {request} was rejected: {rejection}");
            }
            if frame.epoch
                == Some(Epoch { session: SessionId(self.session), reset: Some(RequestNumber(self.epoch)) })
            {
                return self.rows(&frame);
            }
        }
    }

    /// The rows of as many batches as hold every environment, sorted by environment.
    pub fn rows_of_all(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        while rows.len() < self.num_envs {
            rows.extend(self.batch());
        }
        rows.sort_by_key(Row::env);
        rows
    }

    /// The slots of a batch.
    pub fn rows(&self, frame: &Frame) -> Vec<Row> {
        (0..self.layout.slots()).map(|slot| Row::read(frame.bytes(), &self.layout, slot)).collect()
    }

    /// The rejection that answers the last request.
    pub fn rejection(&self) -> Rejection {
        let (request, rejection) = self.frame().rejection().expect("a rejection, not a batch");
        assert_eq!(request, self.number, "{rejection}");
        rejection
    }

    /// The rejections among the frames that came.
    pub fn rejections(&self) -> Vec<Rejection> {
        self.side.frames.try_iter().filter_map(|frame| frame.rejection()).map(|(_, why)| why).collect()
    }

    /// Withholds the lane's frames, or returns them.
    pub fn set_shortage(&self, on: bool) {
        self.side.shortage.on.store(on, Ordering::SeqCst);
    }

    /// Withholds the frames of an idle synchronous lane, also the one that it loaned ahead: in that comes
    /// the result of a step.
    pub fn begin_shortage_of_all(&mut self, actions: &[i32]) -> Vec<Row> {
        let spare_and_next = 2;
        let has_both = || self.side.shortage.lent.load(Ordering::SeqCst) == spare_and_next;
        wait_until("the lane loans a frame ahead", has_both);
        self.set_shortage(true);
        self.send_step(&all(self.num_envs), actions);
        let rows = self.rows_of_all();
        self.wait_for_shortage();
        self.side.shortage.refused.store(0, Ordering::SeqCst);
        rows
    }

    /// Waits until a worker did not get a frame.
    pub fn wait_for_shortage(&self) {
        wait_until("a worker asks for a frame", || self.side.shortage.refused.load(Ordering::SeqCst) > 0);
    }

    /// Whether there is nothing to receive.
    pub fn has_no_frame(&self) -> bool {
        self.side.frames.try_recv().is_err()
    }
}

impl Stepping for Learner {
    fn send_reset(&mut self, seed: Option<u64>, env_ids: Option<&[i32]>) {
        match env_ids {
            Some(env_ids) => Learner::send_reset(self, seed, env_ids),
            None => self.send_reset_all(seed),
        }
    }

    fn send_step(&mut self, env_ids: &[i32], actions: &[i32]) {
        Learner::send_step(self, env_ids, actions);
    }

    fn batch(&mut self) -> Vec<Row> {
        Learner::batch(self)
    }
}

/// Fails if a row differs from what was expected.
#[track_caller]
pub fn assert_same(row: &Row, expected: &Row, context: &str) {
    let difference = row.difference(expected);
    assert_eq!(difference, None, "environment {}: {context}", row.env());
}

/// `0..num_envs` as ids.
pub fn all(num_envs: usize) -> Vec<i32> {
    (0..num_envs as i32).collect()
}

/// A legal action for every agent of these rows.
pub fn legal_actions(rows: &[Row]) -> Vec<i32> {
    rows.iter().flat_map(Row::legal_actions).collect()
}

/// Waits until the condition is true, for counters that change after the frame that they count was sent.
#[track_caller]
pub fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !condition() {
        assert!(begin.elapsed() < TIMEOUT, "not within {TIMEOUT:?}: {what}");
        std::thread::yield_now();
    }
}
