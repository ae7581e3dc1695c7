//! What a child process does, by its role.

use super::player::Player;
use super::process::{ANSWER, ROLE_VARIABLE, SOON};
use super::torture::actors;
use super::{LanePlan, PoolPlan, stranger};
use smaclite_ipc::{Batch, ConnectError, RuntimeDir, Spectator, Supervisor};
use std::io::Write;
use std::time::Duration;

/// Plays this process's role, if it has one, and ends the process.
pub fn play_if_asked() {
    let Ok(text) = std::env::var(ROLE_VARIABLE) else { return };
    let (role, argument) = text.split_once(' ').unwrap_or((&text, ""));
    let status = match role {
        "supervisor" => supervisor(argument),
        "program" => smaclite_cli::run(argument.split(' ').map(Into::into)),
        "learner" => learner(argument),
        "spectator" => spectator(argument),
        "watcher" => stranger::watcher(argument),
        "planter" => stranger::planter(),
        "tortured" => match argument.split_once(' ') {
            Some(("learner", rest)) => actors::learner(rest),
            Some(("spectator", rest)) => actors::spectator(rest),
            Some(("liar", rest)) => actors::liar(rest),
            Some(("forker", rest)) => actors::forker(rest),
            Some(("visitor", rest)) => actors::visitor(rest),
            _ => panic!("there is no such victim: {argument}"),
        },
        other => panic!("there is no role {other}"),
    };
    std::process::exit(status);
}

/// Answers the parent. A child whose parent is gone goes too.
pub(super) fn answer<T: std::fmt::Display, E: std::fmt::Display>(result: Result<T, E>) {
    let line = match result {
        Ok(said) => format!("ok {said}"),
        Err(error) => format!("error {error}"),
    };
    let mut out = std::io::stdout().lock();
    if writeln!(out, "{ANSWER}{}", line.trim_end()).and_then(|()| out.flush()).is_err() {
        std::process::exit(0);
    }
}

fn runtime_dir() -> Result<RuntimeDir, ConnectError> {
    Ok(RuntimeDir::for_current_user()?)
}

/// Runs a pool until the parent closes the input.
fn supervisor(plan: &str) -> i32 {
    let plan: PoolPlan = serde_json::from_str(plan).expect("a plan");
    let started = RuntimeDir::for_current_user().map_err(|e| e.to_string());
    let started = started
        .and_then(|runtime_dir| Supervisor::start(plan.config(&runtime_dir)).map_err(|e| e.to_string()));
    let supervisor = match started {
        Ok(supervisor) => supervisor,
        Err(error) => {
            answer::<&str, _>(Err(error));
            return 1;
        }
    };
    answer::<_, String>(Ok(""));
    for _line in std::io::stdin().lines() {}
    drop(supervisor);
    0
}

/// What a spectator says when it has seen a frame.
pub const WATCHING: &str = "watching";

/// Watches a lane and keeps looking, until the parent closes the input.
fn spectator(lane: &str) -> i32 {
    let mut spectator =
        match runtime_dir().and_then(|runtime_dir| Spectator::connect(&runtime_dir, "train", Some(lane))) {
            Ok(spectator) => spectator,
            Err(error) => {
                answer::<&str, _>(Err(error));
                return 1;
            }
        };
    answer::<_, String>(Ok("connected"));
    let mut said = false;
    loop {
        match spectator.latest() {
            Ok(Some(_)) if !said => {
                answer::<_, String>(Ok(WATCHING));
                said = true;
            }
            Ok(_) => std::thread::sleep(Duration::from_millis(1)),
            Err(error) => {
                answer::<&str, _>(Err(error));
                return 0;
            }
        }
    }
}

/// A learner that obeys.
struct Learner {
    plan: LanePlan,
    player: Option<Player>,
    /// Batches it keeps, with what was in them.
    held: Vec<(Batch, Vec<u8>)>,
}

fn learner(plan: &str) -> i32 {
    let plan: LanePlan = serde_json::from_str(plan).expect("a plan");
    let mut learner = Learner { plan, player: None, held: Vec::new() };
    for line in std::io::stdin().lines() {
        let Ok(line) = line else { break };
        answer(learner.obey(&line));
    }
    0
}

type Said = Result<String, String>;

impl Learner {
    fn obey(&mut self, line: &str) -> Said {
        let (verb, argument) = line.split_once(' ').unwrap_or((line, ""));
        let number = argument.parse::<u64>().ok();
        match verb {
            "connect" => self.connect(argument),
            "disconnect" => {
                self.player = None;
                said("")
            }
            "reset" => self.player()?.reset(number, SOON).map(|()| String::new()).map_err(|e| e.to_string()),
            "step" => self.step(number.unwrap_or(1)),
            "send" => self.player()?.send().map(|()| String::new()).map_err(|e| e.to_string()),
            "recv" => self.recv(number),
            "run" => self.run(),
            "hold" => self.hold(number.unwrap_or(1)),
            "check" => self.check(),
            "drop" => {
                self.held.clear();
                said("")
            }
            other => Err(format!("nobody taught it to {other}")),
        }
    }

    fn player(&mut self) -> Result<&mut Player, String> {
        self.player.as_mut().ok_or_else(|| "not attached".to_owned())
    }

    /// `POOL`, or `POOL WAIT` for a way of waiting.
    fn connect(&mut self, argument: &str) -> Said {
        let (pool, wait) = argument.split_once(' ').unwrap_or((argument, "adaptive"));
        let wait = wait.parse().map_err(|error: smaclite_pool::UnknownWaitStrategy| error.to_string())?;
        let player = runtime_dir()
            .and_then(|runtime_dir| Player::connect_waiting(&runtime_dir, pool, &self.plan, wait))
            .map_err(|e| e.to_string())?;
        self.player = Some(player);
        said("")
    }

    fn step(&mut self, count: u64) -> Said {
        let player = self.player()?;
        for _ in 0..count {
            player.step(SOON).map_err(|e| e.to_string())?;
        }
        said("")
    }

    /// Receives without a timeout, or with one in milliseconds.
    fn recv(&mut self, millis: Option<u64>) -> Said {
        let timeout = millis.map_or(Duration::from_secs(3600), Duration::from_millis);
        let batch = self.player()?.recv(timeout).map_err(|e| e.to_string())?;
        said(batch.sequence())
    }

    /// Steps until something goes wrong.
    fn run(&mut self) -> Said {
        let player = self.player()?;
        player.step(SOON).map_err(|e| e.to_string())?;
        answer::<_, String>(Ok("running"));
        loop {
            player.step(SOON * 100).map_err(|e| e.to_string())?;
        }
    }

    fn hold(&mut self, count: u64) -> Said {
        for _ in 0..count {
            let batch = self.player()?.step(SOON).map_err(|e| e.to_string())?;
            let bytes = batch.bytes().to_vec();
            self.held.push((batch, bytes));
        }
        said(self.held.len())
    }

    /// Are the held batches as they were?
    fn check(&mut self) -> Said {
        for (batch, bytes) in &self.held {
            if batch.bytes() != bytes {
                return Err(format!("frame {} changed while it was held", batch.sequence()));
            }
        }
        said(self.held.len())
    }
}

fn said(what: impl std::fmt::Display) -> Said {
    Ok(what.to_string())
}
