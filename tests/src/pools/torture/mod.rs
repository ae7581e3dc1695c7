//! The torture run: pools whose supervisors, learners and spectators are killed, stopped and restarted at random, while
//! everything that is promised is checked.
//!
//! Two pools share a room. The supervisor of `steady` is stopped now and then but never killed, so that what it holds can
//! be watched; `shaky` loses its supervisor too. Every learner compares every frame with an undisturbed run.

pub mod actors;
mod cast;
mod gauge;

use super::dice::Dice;
use super::games::Oddity;
use super::{LanePlan, PoolPlan, Room};
use cast::Cast;
use gauge::Gauge;
use smaclite_pool::Autoreset;
use std::fmt;
use std::time::{Duration, Instant};

/// What happened in a run.
#[derive(Debug, Default)]
pub struct Summary {
    /// Processes killed: learners, spectators and liars; supervisors.
    pub killed: (u64, u64),
    /// Processes stopped for a while.
    pub stopped: u64,
    /// Supervisors that ended by SIGTERM and were started again.
    pub terminated: u64,
    /// Frames that were compared.
    pub frames: u64,
    /// Sessions that learners began.
    pub sessions: u64,
    /// Learners told that their pool died.
    pub told: u64,
    /// The longest silence of a process that should speak, and whose.
    pub longest_silence: (Duration, String),
    /// What the surviving supervisor held at the start and at the end.
    pub held: String,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (others, supervisors) = self.killed;
        writeln!(f, "killed: {others} learners, spectators and liars, {supervisors} supervisors")?;
        writeln!(f, "stopped for a while: {}; ended by SIGTERM: {}", self.stopped, self.terminated)?;
        writeln!(f, "sessions: {}; learners told of a death: {}", self.sessions, self.told)?;
        writeln!(f, "frames compared: {}, none wrong, lost or doubled", self.frames)?;
        let (silence, whose) = &self.longest_silence;
        writeln!(f, "longest silence: {silence:?} ({whose})")?;
        write!(f, "surviving supervisor: {}", self.held)
    }
}

fn pools() -> [PoolPlan; 2] {
    let short = |lane: LanePlan| LanePlan { episode_limit: Some(15), ..lane };
    let asynchronous = LanePlan { batch_size: 4, autoreset: Autoreset::SameStep, ..LanePlan::new("3s5z", 8) };
    let sleepy = LanePlan { oddity: Oddity::Sleeps { env: 1, millis: 1 }, ..LanePlan::new("2s_vs_1sc", 2) };
    let steady = [short(LanePlan::new("2s3z", 8)), short(asynchronous.clone())];
    let shaky = [short(LanePlan { batch_size: 2, ..LanePlan::new("2s3z", 6) }), short(sleepy)];
    let pool =
        |name: &str, lanes: [LanePlan; 2]| PoolPlan { name: name.into(), ..PoolPlan::new(lanes).threads(2) };
    [pool("steady", steady), pool("shaky", shaky)]
}

/// Tortures pools for so long. Who is silent for longer than `hang` hangs.
///
/// # Errors
/// The first invariant that did not hold.
pub fn run(duration: Duration, seed: u64, hang: Duration) -> Result<Summary, String> {
    let room = Room::new();
    let mut dice = Dice::new(seed);
    let mut summary = Summary::default();
    let [steady, shaky] = pools();
    let mut cast = Cast::enter(&room, [steady, shaky], hang)?;
    let mut gauge = Gauge::new(cast.steady_supervisor());
    let begin = Instant::now();
    let mut early = Some(duration / 5);
    while begin.elapsed() < duration {
        if early.take_if(|early| begin.elapsed() > *early).is_some() {
            cast.calm(&mut summary)?;
            gauge.look();
        }
        cast.disturb(&mut dice, &mut summary)?;
        let pause = Duration::from_millis(dice.below(120));
        let end = Instant::now() + pause;
        while Instant::now() < end {
            cast.listen(&mut summary)?;
            std::thread::sleep(Duration::from_millis(5));
        }
    }
    cast.calm(&mut summary)?;
    gauge.look();
    summary.held = gauge.verdict()?;
    cast.leave()?;
    let left = || room.files();
    if !super::process::eventually(|| left().is_empty()) {
        return Err(format!("left behind: {:#?}", left()));
    }
    Ok(summary)
}
