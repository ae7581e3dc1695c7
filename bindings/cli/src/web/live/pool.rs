//! What all pages share: the status of the pool, its history, and the lanes that are watched.

use super::lane::{WatchError, WatchedLane};
use serde_json::{Value, json};
use smaclite_ipc::{LaneStatus, PoolStatus, RuntimeDir, WaitOptions, status_within};
use smaclite_pool::LaneStats;
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

/// How often the status is requested.
pub(super) const STATUS_INTERVAL: Duration = Duration::from_millis(500);

/// Points of the history: ten minutes.
const MAX_POINTS: usize = 1200;

/// How long the pool may take to answer.
const TIMEOUT: Duration = Duration::from_secs(2);

pub(super) struct WatchedPool {
    runtime_dir: RuntimeDir,
    name: String,
    begin: Instant,
    status: Mutex<Status>,
    lanes: Mutex<HashMap<String, Weak<Mutex<WatchedLane>>>>,
}

/// The newest status.
struct Status {
    requested: Option<Instant>,
    answer: Result<PoolStatus, String>,
    /// By lane.
    history: HashMap<String, VecDeque<Point>>,
}

/// A lane at one time.
#[derive(Clone, Copy)]
struct Point {
    /// Seconds since this program started.
    time: f64,
    /// The supervisor's process: counts of another one begin at 0.
    pid: u32,
    steps_per_s: f64,
    steps: u64,
    episodes: u64,
    wins: u64,
    returns: f64,
}

impl Point {
    fn new(time: f64, pid: u32, lane: &LaneStatus) -> Point {
        let LaneStats { steps, episodes, wins, returns, .. } = lane.stats;
        Point { time, pid, steps_per_s: lane.steps_per_s, steps, episodes, wins, returns }
    }

    fn row(&self) -> Value {
        json!([self.time, self.pid, self.steps_per_s, self.steps, self.episodes, self.wins, self.returns])
    }
}

/// The status as a page gets it.
pub(super) struct StatusNews {
    pub(super) event: Value,
    /// The time of the newest point, to ask for later ones.
    pub(super) time: f64,
    /// The supervisor's process, if it answered.
    pub(super) pid: Option<u32>,
}

impl WatchedPool {
    pub(super) fn new(runtime_dir: RuntimeDir, name: String) -> WatchedPool {
        let status = Status { requested: None, answer: Err(String::new()), history: HashMap::new() };
        let (status, lanes) = (Mutex::new(status), Mutex::new(HashMap::new()));
        WatchedPool { runtime_dir, name, begin: Instant::now(), status, lanes }
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn runtime_dir(&self) -> &RuntimeDir {
        &self.runtime_dir
    }

    /// The status of the pool and of one lane, with the points of its history after a time.
    pub(super) fn status(&self, lane: &str, after: f64) -> StatusNews {
        let mut status = lock(&self.status);
        let is_old = status.requested.is_none_or(|at| at.elapsed() >= STATUS_INTERVAL.mul_f32(0.8));
        if is_old {
            self.request(&mut status);
        }
        let points = status.history.get(lane).map(|points| points.iter()).unwrap_or_default();
        let points = points.skip_while(|point| point.time <= after);
        let time = points.clone().last().map_or(after, |point| point.time);
        let mut event = match &status.answer {
            Ok(pool) => pool_info(pool, lane),
            Err(error) => json!({"error": error}),
        };
        event["points"] = points.map(Point::row).collect();
        StatusNews { event, time, pid: status.answer.as_ref().ok().map(|pool| pool.pid) }
    }

    /// Requests the status, and adds a point to the history of every lane.
    fn request(&self, status: &mut Status) {
        let answer = status_within(&self.runtime_dir, &self.name, patience(&mut || false));
        status.answer = answer.map_err(|error| error.to_string());
        status.requested = Some(Instant::now());
        let Ok(pool) = &status.answer else { return };
        let time = self.begin.elapsed().as_secs_f64();
        for lane in &pool.lanes {
            let name = &lane.description.lane;
            let points = status.history.entry(name.clone()).or_default();
            points.push_back(Point::new(time, pool.pid, lane));
            if points.len() > MAX_POINTS {
                points.pop_front();
            }
        }
    }

    /// Watches a lane, or shares it with the pages that do.
    pub(super) fn lane(&self, name: &str) -> Result<Arc<Mutex<WatchedLane>>, WatchError> {
        let pool = status_within(&self.runtime_dir, &self.name, patience(&mut || false))?;
        let mut lanes = lock(&self.lanes);
        if let Some(lane) = lanes.get(name).and_then(Weak::upgrade)
            && lock(&lane).is_alive()
            && lock(&lane).pid() == pool.pid
        {
            return Ok(lane);
        }
        let lane = WatchedLane::connect(&self.runtime_dir, &pool, name)?;
        let lane = Arc::new(Mutex::new(lane));
        lanes.insert(name.to_owned(), Arc::downgrade(&lane));
        Ok(lane)
    }
}

fn patience(interrupted: &mut dyn FnMut() -> bool) -> WaitOptions<'_> {
    WaitOptions { timeout: Some(TIMEOUT), interrupted }
}

fn pool_info(pool: &PoolStatus, lane: &str) -> Value {
    let names = pool.lanes.iter().map(|lane| &lane.description.lane).collect::<Vec<_>>();
    let current = pool.lanes.iter().find(|other| other.description.lane == lane);
    json!({
        "pid": pool.pid,
        "threads": pool.threads,
        "uptime_s": pool.uptime_s,
        "lanes": names,
        "lane": current.map(|lane| json!({
            "learner_pid": lane.learner_pid,
            "spectators": lane.spectators,
            "steps_per_s": lane.steps_per_s,
            "queue_wait_us": lane.queue_wait_us,
            "stats": lane.stats,
            "failure": lane.failure,
        })),
    })
}

/// A value that stays valid when a thread panics: it is replaced or refreshed as a whole.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
