//! What a child process does. Its role is a text `NAME ARGUMENT`:
//!
//! | name | argument | the process |
//! | --- | --- | --- |
//! | `supervisor` | a [`PoolPlan`] as JSON | runs a pool |
//! | `program` | its arguments | runs the program `smaclite-pool` |
//! | `learner` | a [`LanePlan`] as JSON | carries out commands: attach, reset, step, hold frames and others |
//! | `spectator` | a lane | reads the newest frame again and again |
//! | `file_opener`, `file_creator` | see [`other_user`] | what another user may try |
//! | `chaos` | see [`chaos::roles`] | a process of the chaos test |

use crate::process::{ROLE_VARIABLE, TIMEOUT, answer};
use crate::{LanePlan, Learner, PoolPlan, chaos, other_user};
use smaclite_ipc::{Batch, ConnectError, RuntimeDir, Spectator, Supervisor, WaitOptions};
use smaclite_units::UnknownKeyword;
use std::sync::Arc;
use std::time::Duration;

/// If this process has a role, carries it out and ends the process.
pub fn run_if_child() {
    let Ok(text) = std::env::var(ROLE_VARIABLE) else { return };
    let (role, argument) = text.split_once(' ').unwrap_or((&text, ""));
    let status = match role {
        "supervisor" => supervisor(argument),
        #[cfg(feature = "program")]
        "program" => program(argument),
        "learner" => learner(argument),
        "spectator" => spectator(argument),
        "file_opener" => other_user::file_opener(argument),
        "file_creator" => other_user::file_creator(),
        "chaos" => chaos::roles::run(argument),
        other => panic!("there is no role {other}"),
    };
    std::process::exit(status);
}

#[cfg(feature = "program")]
fn program(arguments: &str) -> i32 {
    let arguments = std::iter::once("smaclite-pool").chain(arguments.split(' '));
    smaclite_cli::run(arguments.map(Into::into), &[])
}

fn runtime_dir() -> Result<RuntimeDir, ConnectError> {
    Ok(RuntimeDir::for_current_user()?)
}

/// Runs a pool until the parent closes its input.
fn supervisor(plan: &str) -> i32 {
    let plan: PoolPlan = serde_json::from_str(plan).expect("a plan");
    let runtime_dir = RuntimeDir::for_current_user().map_err(|e| e.to_string());
    let start = |dir: RuntimeDir| {
        let prepared = plan.prepare(&dir).map_err(|e| e.to_string())?;
        Supervisor::start_prepared(prepared, &mut || false).map_err(|e| e.to_string())
    };
    let supervisor = match runtime_dir.and_then(start) {
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

/// The answer of a spectator that has read its first frame.
pub const FIRST_FRAME: &str = "first frame";

/// Reads the newest frame of a lane again and again, until there is an error.
fn spectator(lane: &str) -> i32 {
    let mut spectator = match runtime_dir().and_then(|runtime_dir| {
        Spectator::connect(&runtime_dir, "train", Some(lane), WaitOptions::for_response())
    }) {
        Ok(spectator) => spectator,
        Err(error) => {
            answer::<&str, _>(Err(error));
            return 1;
        }
    };
    answer::<_, String>(Ok("connected"));
    let mut has_answered = false;
    loop {
        match spectator.latest() {
            Ok(Some(_)) if !has_answered => {
                answer::<_, String>(Ok(FIRST_FRAME));
                has_answered = true;
            }
            Ok(_) => std::thread::sleep(Duration::from_millis(1)),
            Err(error) => {
                answer::<&str, _>(Err(error));
                return 0;
            }
        }
    }
}

/// A learner that carries out the parent's commands.
struct CommandedLearner {
    plan: LanePlan,
    /// While it is attached.
    learner: Option<Learner>,
    /// Batches that it holds, with a copy of their bytes.
    held: Vec<(Arc<Batch>, Vec<u8>)>,
}

fn learner(plan: &str) -> i32 {
    let plan: LanePlan = serde_json::from_str(plan).expect("a plan");
    let mut learner = CommandedLearner { plan, learner: None, held: Vec::new() };
    for line in std::io::stdin().lines() {
        let Ok(line) = line else { break };
        answer(learner.run_command(&line));
    }
    0
}

type Answer = Result<String, String>;

impl CommandedLearner {
    fn run_command(&mut self, line: &str) -> Answer {
        let (command, argument) = line.split_once(' ').unwrap_or((line, ""));
        let number = argument.parse::<u64>().ok();
        match command {
            "connect" => self.connect(argument),
            "disconnect" => {
                self.learner = None;
                done("")
            }
            "reset" => {
                self.learner()?.reset(number, TIMEOUT).map(|()| String::new()).map_err(|e| e.to_string())
            }
            "step" => self.step(number.unwrap_or(1)),
            "send" => self.learner()?.send().map(|()| String::new()).map_err(|e| e.to_string()),
            "recv" => self.recv(number),
            "run" => self.run(),
            "hold" => self.hold(number.unwrap_or(1)),
            "check" => self.check(),
            "drop" => {
                self.held.clear();
                done("")
            }
            other => Err(format!("there is no command {other}")),
        }
    }

    fn learner(&mut self) -> Result<&mut Learner, String> {
        self.learner.as_mut().ok_or_else(|| "not attached".to_owned())
    }

    /// `POOL`, or `POOL WAIT` with a wait strategy.
    fn connect(&mut self, argument: &str) -> Answer {
        let (pool, wait) = argument.split_once(' ').unwrap_or((argument, "adaptive"));
        let wait = wait.parse().map_err(|error: UnknownKeyword| error.to_string())?;
        let learner = runtime_dir()
            .and_then(|runtime_dir| Learner::connect_waiting(&runtime_dir, pool, &self.plan, wait))
            .map_err(|e| e.to_string())?;
        self.learner = Some(learner);
        done("")
    }

    fn step(&mut self, count: u64) -> Answer {
        let learner = self.learner()?;
        for _ in 0..count {
            learner.step(TIMEOUT).map_err(|e| e.to_string())?;
        }
        done("")
    }

    /// Receives with a timeout in milliseconds; without one it waits for an hour.
    fn recv(&mut self, millis: Option<u64>) -> Answer {
        let timeout = millis.map_or(Duration::from_secs(3600), Duration::from_millis);
        let batch = self.learner()?.recv(timeout).map_err(|e| e.to_string())?;
        done(batch.sequence())
    }

    /// Answers after one step, then steps until an error.
    fn run(&mut self) -> Answer {
        let learner = self.learner()?;
        learner.step(TIMEOUT).map_err(|e| e.to_string())?;
        answer::<_, String>(Ok("running"));
        loop {
            learner.step(TIMEOUT * 100).map_err(|e| e.to_string())?;
        }
    }

    fn hold(&mut self, count: u64) -> Answer {
        for _ in 0..count {
            let batch = self.learner()?.step(TIMEOUT).map_err(|e| e.to_string())?;
            let bytes = batch.bytes().to_vec();
            self.held.push((batch, bytes));
        }
        done(self.held.len())
    }

    /// Compares the held batches with the copies of their bytes.
    fn check(&mut self) -> Answer {
        for (batch, bytes) in &self.held {
            if batch.bytes() != bytes {
                return Err(format!("frame {} changed while it was held", batch.sequence()));
            }
        }
        done(self.held.len())
    }
}

fn done(value: impl std::fmt::Display) -> Answer {
    Ok(value.to_string())
}
