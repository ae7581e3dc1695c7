//! What all pages share: the status of the pool, its history, and the lanes that are watched.

use super::lane::{WatchError, WatchedLane};
use crate::web::protocol::{LaneState, Point, PoolInfo, PoolResponse, PoolState};
use smaclite_ipc::{LaneStatus, PoolStatus, RuntimeDir, WaitOptions, status};
use smaclite_pool::LaneStats;
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError, Weak};
use std::time::{Duration, Instant};

/// How often the status is requested.
pub(super) const STATUS_INTERVAL: Duration = Duration::from_millis(500);

/// Points of the history: ten minutes.
const MAX_POINTS: usize = 1200;

/// How long the pool may take to respond.
const TIMEOUT: Duration = Duration::from_secs(2);

pub(super) struct WatchedPool {
    runtime_dir: RuntimeDir,
    name: String,
    begin: Instant,
    status: Mutex<Status>,
    /// When the status was last requested. Who requests it holds the lock, and no other one.
    requested: Mutex<Option<Instant>>,
    /// The lock of an entry is held while its lane is connected; pages that want another lane do not wait.
    lanes: Mutex<HashMap<String, Arc<Mutex<SharedLane>>>>,
}

/// A lane, as long as a page watches it.
type SharedLane = Weak<Mutex<WatchedLane>>;

/// The newest status.
#[derive(Default)]
struct Status {
    /// None before the first request.
    response: Option<Result<PoolStatus, String>>,
    /// The pool that responded last, and how many others of the name did before.
    instance: String,
    pools_before: u32,
    /// By lane.
    history: HashMap<String, VecDeque<Point>>,
}

/// What no other pool has, also one of the same name that the same process started.
fn instance(pool: &PoolStatus) -> &str {
    pool.lanes.first().map_or("", |lane| &lane.description.instance)
}

fn point(time: f64, pool: u32, lane: &LaneStatus) -> Point {
    let LaneStats { steps, episodes, wins, returns, lengths, .. } = lane.stats;
    Point { time, pool, steps_per_s: lane.steps_per_s, steps, episodes, wins, returns, lengths }
}

/// The status as a page gets it.
pub(super) struct StatusNews {
    pub(super) state: PoolState,
    /// The time of the newest point, to ask for later ones.
    pub(super) time: f64,
    /// What tells the pool from others, if it answered.
    pub(super) instance: Option<String>,
}

impl WatchedPool {
    pub(super) fn new(runtime_dir: RuntimeDir, name: String) -> WatchedPool {
        let status = Mutex::new(Status::default());
        let (requested, lanes) = (Mutex::new(None), Mutex::new(HashMap::new()));
        WatchedPool { runtime_dir, name, begin: Instant::now(), status, requested, lanes }
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn runtime_dir(&self) -> &RuntimeDir {
        &self.runtime_dir
    }

    /// The status of the pool and of one lane, with the points of its history after a time.
    pub(super) fn status(&self, lane: &str, after: f64) -> StatusNews {
        self.refresh();
        let status = lock(&self.status);
        let points = status.history.get(lane).map(|points| points.iter()).unwrap_or_default();
        let points: Vec<Point> = points.skip_while(|point| point.time <= after).copied().collect();
        let time = points.last().map_or(after, |point| point.time);
        let pool = match &status.response {
            Some(Ok(pool)) => PoolResponse::Pool(pool_info(pool, lane)),
            Some(Err(error)) => PoolResponse::Error(error.clone()),
            None => PoolResponse::Error("the pool has not responded yet".to_owned()),
        };
        let instance = match &status.response {
            Some(Ok(pool)) => Some(instance(pool).to_owned()),
            _ => None,
        };
        StatusNews { state: PoolState { points, pool }, time, instance }
    }

    /// Requests the status if it is old and no other page does so now. A pool that does not respond delays
    /// only the page that requests it; the others get what is known. Only the first status is waited for.
    fn refresh(&self) {
        let mut requested = match self.requested.try_lock() {
            Ok(requested) => requested,
            Err(TryLockError::WouldBlock) if lock(&self.status).is_known() => return,
            Err(_) => lock(&self.requested),
        };
        if requested.is_none_or(|at| at.elapsed() >= STATUS_INTERVAL.mul_f32(0.8)) {
            let response = status(&self.runtime_dir, &self.name, patience(&mut || false));
            *requested = Some(Instant::now());
            let time = self.begin.elapsed().as_secs_f64();
            lock(&self.status).set(time, response.map_err(|error| error.to_string()));
        }
    }

    /// Watches a lane, or shares it with the pages that do.
    pub(super) fn lane(&self, name: &str) -> Result<Arc<Mutex<WatchedLane>>, WatchError> {
        let pool = status(&self.runtime_dir, &self.name, patience(&mut || false))?;
        if !pool.lanes.iter().any(|lane| lane.description.lane == name) {
            return Err(WatchedLane::not_found(&pool, name)); // pages add no entries by names
        }
        let entry = Arc::clone(lock(&self.lanes).entry(name.to_owned()).or_default());
        let mut entry = lock(&entry);
        if let Some(lane) = entry.upgrade()
            && lock(&lane).is_alive()
            && lock(&lane).instance() == instance(&pool)
        {
            return Ok(lane);
        }
        let lane = Arc::new(Mutex::new(WatchedLane::connect(&self.runtime_dir, &pool, name)?));
        *entry = Arc::downgrade(&lane);
        Ok(lane)
    }
}

impl Status {
    /// Whether the status was requested once.
    fn is_known(&self) -> bool {
        self.response.is_some()
    }

    /// Takes a status, and adds a point to the history of every lane.
    fn set(&mut self, time: f64, response: Result<PoolStatus, String>) {
        if let Ok(pool) = &response {
            if self.instance != instance(pool) {
                self.pools_before += u32::from(!self.instance.is_empty());
                instance(pool).clone_into(&mut self.instance);
            }
            for lane in &pool.lanes {
                let points = self.history.entry(lane.description.lane.clone()).or_default();
                points.push_back(point(time, self.pools_before, lane));
                if points.len() > MAX_POINTS {
                    points.pop_front();
                }
            }
        }
        self.response = Some(response);
    }
}

fn patience(interrupted: &mut dyn FnMut() -> bool) -> WaitOptions<'_> {
    WaitOptions { timeout: Some(TIMEOUT), interrupted }
}

fn pool_info(pool: &PoolStatus, lane: &str) -> PoolInfo {
    let current = pool.lanes.iter().find(|other| other.description.lane == lane);
    PoolInfo {
        pid: pool.pid,
        threads: pool.threads,
        uptime_s: pool.uptime_s,
        lanes: pool.lanes.iter().map(|lane| lane.description.lane.clone()).collect(),
        lane: current.map(|lane| LaneState {
            learner_pid: lane.learner_pid,
            spectators: lane.spectators,
            steps_per_s: lane.steps_per_s,
            queue_wait_us: lane.queue_wait_us,
            stats: lane.stats,
            failure: lane.failure.clone(),
        }),
    }
}

/// A value that stays valid when a thread panics: it is replaced or refreshed as a whole.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
