//! What one page asks for, and what it is sent while it is visible: cells of the grid, the status of the
//! pool, and the list of a followed environment's episodes.

use super::follow::Follow;
use super::lane::WatchedLane;
use super::pool::{STATUS_INTERVAL, WatchedPool, lock};
use crate::web::{Closed, Page, Request};
use serde_json::{Value, json};
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

pub(super) struct Conversation<'a> {
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

impl<'a> Conversation<'a> {
    pub(super) fn new(pool: &'a WatchedPool, page: &'a Page) -> Conversation<'a> {
        let now = Instant::now();
        Conversation {
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

    /// Talks until the page is closed.
    pub(super) fn run(mut self) -> Closed {
        loop {
            let done = self.page.receive(self.deadline()).and_then(|request| match request {
                Some(request) => self.reply(&request),
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

    fn reply(&mut self, request: &Request) -> Result<(), Closed> {
        let answer = match request.action.as_str() {
            "lane" => self.choose_lane(request),
            "look" => self.look(request),
            "follow" => self.begin_follow(request),
            "unfollow" => {
                self.follow = None;
                Ok(json!({}))
            }
            "steps" => self.steps(request),
            "observe" => self.observe(request),
            other => Err(format!("there is no request `{other}`")),
        };
        match answer {
            Ok(answer) => self.page.answer(request, answer),
            Err(why) => self.page.refuse(request, why),
        }
    }

    fn choose_lane(&mut self, request: &Request) -> Result<Value, String> {
        let name = request.text("name")?;
        (self.lane, self.watched, self.follow) = (Some(name.to_owned()), None, None);
        (self.sequence, self.time) = (0, -1.0);
        let now = Instant::now();
        self.next = Deadlines { grid: now, status: now, follow: now, connect: now };
        Ok(json!({}))
    }

    /// What the page shows: whether it is visible, and which cells.
    fn look(&mut self, request: &Request) -> Result<Value, String> {
        let first = request.number("first")?;
        let count = request.number("count")?.min(MAX_CELLS);
        let grid = first..first.saturating_add(count);
        if grid != self.grid {
            // Cells that were not shown have changed since the frames that they were sent for.
            (self.grid, self.sequence) = (grid, 0);
        }
        self.is_visible = request.arguments.get("visible").and_then(Value::as_bool).unwrap_or(true);
        Ok(json!({}))
    }

    fn begin_follow(&mut self, request: &Request) -> Result<Value, String> {
        let env = request.number("env")?;
        self.follow = None; // the old one ends before the new one begins, so that both fit the pool's limit
        let lane = self.lane.as_deref().ok_or("choose a lane first")?;
        let watched = self.watched.as_ref().ok_or_else(|| format!("lane `{lane}` is not connected"))?;
        let battles = Arc::clone(lock(watched).battles());
        let (runtime_dir, pool) = (self.pool.runtime_dir(), self.pool.name());
        self.follow = Some(Follow::connect(runtime_dir, pool, lane, env, battles)?);
        self.next.follow = Instant::now();
        Ok(json!({}))
    }

    fn steps(&mut self, request: &Request) -> Result<Value, String> {
        let (number, step) = (request.number("number")?, request.number("step")?);
        let follow = self.follow.as_mut().ok_or(NOT_FOLLOWING)?;
        follow.steps(number as u64, step).map_err(|error| error.to_string())
    }

    fn observe(&mut self, request: &Request) -> Result<Value, String> {
        let (number, step) = (request.number("number")?, request.number("step")?);
        let follow = self.follow.as_mut().ok_or(NOT_FOLLOWING)?;
        let obs = follow.observation(number as u64, step, request.number("agent")?);
        Ok(json!({"obs": obs.map_err(|error| error.to_string())?}))
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
        if self.watched.as_ref().is_some_and(|lane| news.pid.is_some_and(|pid| lock(lane).pid() != pid)) {
            (self.watched, self.follow) = (None, None); // the pool was started again
        }
        self.page.push("status", news.event)
    }

    /// Begins to watch the lane.
    fn connect(&mut self) -> Result<(), Closed> {
        self.next.connect = Instant::now() + RETRY_INTERVAL;
        match self.pool.lane(self.lane.as_deref().unwrap_or_default()) {
            Ok(lane) => {
                let info = lock(&lane).info();
                (self.watched, self.sequence) = (Some(lane), 0);
                self.page.push("lane", info)
            }
            Err(error) => self.page.push("lost", json!({"error": error.to_string()})),
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
                if cells.is_empty() { Ok(()) } else { self.page.push("grid", json!({"cells": cells})) }
            }
            Err(error) => {
                self.watched = None;
                self.page.push("lost", json!({"error": error}))
            }
        }
    }

    fn send_episodes(&mut self) -> Result<(), Closed> {
        let Some(follow) = &mut self.follow else { return Ok(()) };
        match follow.read() {
            Ok(_) => self.page.push("episodes", follow.list()),
            Err(error) => {
                (self.follow, self.watched) = (None, None);
                self.page.push("lost", json!({"error": error}))
            }
        }
    }
}

const NOT_FOLLOWING: &str = "no environment is followed";
