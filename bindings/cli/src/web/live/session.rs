//! What one page requests, and what it is sent while it is visible: cells of the grid, the status of the
//! pool, and the list of a followed environment's episodes.

use super::follow::{Follow, FollowError};
use super::lane::WatchedLane;
use super::pool::{STATUS_INTERVAL, WatchedPool, lock};
use crate::web::protocol::{PageEvent, PageRequest, PageResponse, RequestMessage};
use crate::web::{Closed, Page};
use std::ops::Range;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// How often the grid is sent.
const GRID_INTERVAL: Duration = Duration::from_millis(80);

/// How often the log of a followed environment is read.
const FOLLOW_INTERVAL: Duration = Duration::from_millis(200);

/// How long to wait before connecting again to a pool that is gone.
const RETRY_INTERVAL: Duration = Duration::from_secs(1);

/// The most cells that a page is sent.
const MAX_CELLS: usize = 256;

pub(super) struct Session<'a> {
    pool: &'a WatchedPool,
    page: &'a Page,
    /// The name of the lane that the page shows.
    lane: Option<String>,
    watched: Option<Arc<Mutex<WatchedLane>>>,
    is_visible: bool,
    /// The environments whose cells the page shows.
    grid: Range<usize>,
    /// The newest frame that the page has seen.
    sequence: u64,
    /// The newest point of the history that the page has.
    time: f64,
    follow: Option<Follow>,
    /// When to send what next.
    next: Deadlines,
}

struct Deadlines {
    grid: Instant,
    status: Instant,
    follow: Instant,
    connect: Instant,
}

impl<'a> Session<'a> {
    pub(super) fn new(pool: &'a WatchedPool, page: &'a Page) -> Session<'a> {
        let now = Instant::now();
        Session {
            pool,
            page,
            lane: None,
            watched: None,
            is_visible: false,
            grid: 0..0,
            sequence: 0,
            time: -1.0,
            follow: None,
            next: Deadlines { grid: now, status: now, follow: now, connect: now },
        }
    }

    /// Serves the page until it is closed.
    pub(super) fn run(mut self) -> Closed {
        loop {
            let done = self.page.receive(self.deadline()).and_then(|request| match request {
                Some(message) => self.respond(message),
                None => self.send_due(),
            });
            if let Err(closed) = done {
                return closed;
            }
        }
    }

    /// When there is something to send; never while the page is hidden.
    fn deadline(&self) -> Option<Instant> {
        if !self.is_visible || self.lane.is_none() {
            return None;
        }
        let mut deadline = self.next.status;
        if self.watched.is_none() {
            deadline = deadline.min(self.next.connect);
        } else if !self.grid.is_empty() {
            deadline = deadline.min(self.next.grid);
        }
        if self.follow.is_some() {
            deadline = deadline.min(self.next.follow);
        }
        Some(deadline)
    }

    fn respond(&mut self, RequestMessage { id, request }: RequestMessage) -> Result<(), Closed> {
        let response = match request {
            PageRequest::SelectLane { name } => Ok(self.select_lane(name)),
            PageRequest::SetView { first, count, visible } => Ok(self.set_view(first, count, visible)),
            PageRequest::Follow { env } => self.begin_follow(env),
            PageRequest::Unfollow {} => {
                self.follow = None;
                Ok(PageResponse::Unfollow {})
            }
            PageRequest::GetSteps { number, step } => {
                self.followed(|follow| Ok(PageResponse::GetSteps(follow.steps(number, step)?)))
            }
            PageRequest::GetObservation { number, step, agent } => self.followed(|follow| {
                Ok(PageResponse::GetObservation { obs: follow.observation(number, step, agent)? })
            }),
            PageRequest::GetSnapshot { number, step } => {
                self.followed(|follow| Ok(PageResponse::GetSnapshot(follow.snapshot(number, step)?)))
            }
            _ => Err("this request is one of another page".to_owned()),
        };
        self.page.respond(id, response)
    }

    fn select_lane(&mut self, name: String) -> PageResponse {
        (self.lane, self.watched, self.follow) = (Some(name), None, None);
        (self.sequence, self.time) = (0, -1.0);
        let now = Instant::now();
        self.next = Deadlines { grid: now, status: now, follow: now, connect: now };
        PageResponse::SelectLane {}
    }

    /// What the page shows: whether it is visible, and which cells.
    fn set_view(&mut self, first: usize, count: usize, visible: bool) -> PageResponse {
        let grid = first..first.saturating_add(count.min(MAX_CELLS));
        if grid != self.grid {
            // Cells that were not shown have changed since the frames that they were sent for.
            (self.grid, self.sequence) = (grid, 0);
        }
        self.is_visible = visible;
        PageResponse::SetView {}
    }

    fn begin_follow(&mut self, env: usize) -> Result<PageResponse, String> {
        self.follow = None; // the old one ends before the new one begins, so that both fit the pool's limit
        let lane = self.lane.as_deref().ok_or("select a lane first")?;
        let watched = self.watched.as_ref().ok_or_else(|| format!("lane `{lane}` is not connected"))?;
        let battles = Arc::clone(lock(watched).battles());
        let (runtime_dir, pool) = (self.pool.runtime_dir(), self.pool.name());
        self.follow = Some(Follow::connect(runtime_dir, pool, lane, env, battles)?);
        self.next.follow = Instant::now();
        Ok(PageResponse::Follow {})
    }

    /// What the followed environment responds.
    fn followed(
        &mut self,
        respond: impl FnOnce(&mut Follow) -> Result<PageResponse, FollowError>,
    ) -> Result<PageResponse, String> {
        let follow = self.follow.as_mut().ok_or(FollowError::Nothing);
        follow.and_then(respond).map_err(|error| error.to_string())
    }

    fn send_due(&mut self) -> Result<(), Closed> {
        let now = Instant::now();
        if self.watched.is_none() && now >= self.next.connect {
            self.connect()?;
        }
        if self.watched.is_some() && !self.grid.is_empty() && now >= self.next.grid {
            self.next.grid = now + GRID_INTERVAL;
            self.send_grid()?;
        }
        if self.follow.is_some() && now >= self.next.follow {
            self.next.follow = now + FOLLOW_INTERVAL;
            self.send_episodes()?;
        }
        if now >= self.next.status {
            self.next.status = now + STATUS_INTERVAL;
            self.send_status()?;
        }
        Ok(())
    }

    fn send_status(&mut self) -> Result<(), Closed> {
        let news = self.pool.status(self.lane.as_deref().unwrap_or_default(), self.time);
        self.time = news.time;
        if let (Some(lane), Some(instance)) = (&self.watched, &news.instance)
            && lock(lane).instance() != instance
        {
            (self.watched, self.follow) = (None, None); // the pool was started again
        }
        self.page.push(PageEvent::Status(news.state))
    }

    /// Begins to watch the lane.
    fn connect(&mut self) -> Result<(), Closed> {
        self.next.connect = Instant::now() + RETRY_INTERVAL;
        match self.pool.lane(self.lane.as_deref().unwrap_or_default()) {
            Ok(lane) => {
                let info = lock(&lane).info();
                (self.watched, self.sequence) = (Some(lane), 0);
                self.page.push(PageEvent::Lane(Box::new(info)))
            }
            // The pool is not lost: its status says which lanes it has.
            Err(error) if error.is_missing_lane() => Ok(()),
            Err(error) => self.page.push(PageEvent::Lost { error: error.to_string() }),
        }
    }

    fn send_grid(&mut self) -> Result<(), Closed> {
        let Some(watched) = &self.watched else { return Ok(()) };
        let mut lane = lock(watched);
        let battles = Arc::clone(lane.battles());
        let news = lane.read().map(|cells| cells.news(self.grid.clone(), self.sequence, &battles));
        drop(lane);
        match news {
            Ok((cells, sequence)) => {
                self.sequence = sequence;
                if cells.is_empty() { Ok(()) } else { self.page.push(PageEvent::Grid { cells }) }
            }
            Err(error) => {
                self.watched = None;
                self.page.push(PageEvent::Lost { error })
            }
        }
    }

    fn send_episodes(&mut self) -> Result<(), Closed> {
        let Some(follow) = &mut self.follow else { return Ok(()) };
        match follow.read() {
            Ok(()) => self.page.push(PageEvent::Episodes { episodes: follow.list() }),
            Err(error) => {
                (self.follow, self.watched) = (None, None);
                self.page.push(PageEvent::Lost { error })
            }
        }
    }
}
