//! The torture run: pools whose supervisors, learners and spectators are killed, stopped and restarted at
//! random, while everything that is promised is checked.
//!
//! Two pools share a room. The supervisor of `steady` is stopped now and then but never killed, so that what
//! it holds can be watched; `shaky` loses its supervisor too. Every learner compares every frame with an
//! undisturbed run. One learner forks while it steps, one comes from another process namespace, another user
//! tries to open all files of the room, and beside them pools are killed at chosen system calls (`crash`).

pub mod actors;
mod cast;
mod gauge;

use super::crash::{CALLS, has_strace, survives};
use super::dice::Dice;
use super::games::Oddity;
use super::process::SOON;
use super::{Child, LanePlan, PoolPlan, Room};
use cast::Cast;
use gauge::Gauge;
use smaclite_pool::Autoreset;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
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
    /// Children that read a batch of their parent's.
    pub forks: u64,
    /// Visits from another process namespace.
    pub visits: u64,
    /// Pools killed at a system call.
    pub crashes: u64,
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
        writeln!(
            f,
            "forks: {}; visits from a namespace: {}; crash points: {}",
            self.forks, self.visits, self.crashes
        )?;
        let (silence, whose) = &self.longest_silence;
        writeln!(f, "longest silence: {silence:?} ({whose})")?;
        write!(f, "surviving supervisor: {}", self.held)
    }
}

/// Kills pools at system calls drawn at random, in rooms of their own, until it is told to end.
struct Crashing {
    over: Arc<AtomicBool>,
    thread: JoinHandle<Result<u64, String>>,
}

impl Crashing {
    fn begin(seed: u64) -> Crashing {
        let over = Arc::new(AtomicBool::new(!has_strace()));
        let (ended, mut dice) = (Arc::clone(&over), Dice::new(seed));
        let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
        let thread = std::thread::spawn(move || {
            let mut points = 0;
            while !ended.load(Ordering::Relaxed) {
                let (call, most) = dice.pick(&CALLS);
                points += u64::from(survives(&plan, call, 1 + dice.below(*most))?);
            }
            Ok(points)
        });
        Crashing { over, thread }
    }

    fn end(self) -> Result<u64, String> {
        self.over.store(true, Ordering::Relaxed);
        self.thread.join().expect("no panic")
    }
}

fn pools() -> [PoolPlan; 2] {
    let short = |lane: LanePlan| LanePlan { episode_limit: Some(15), ..lane };
    let asynchronous = LanePlan { batch_size: 4, autoreset: Autoreset::SameStep, ..LanePlan::new("3s5z", 8) };
    let sleepy = LanePlan { oddity: Oddity::Sleeps { env: 1, millis: 1 }, ..LanePlan::new("2s_vs_1sc", 2) };
    let other = |scenario| LanePlan { name: "other".to_owned(), ..LanePlan::new(scenario, 4) };
    let steady = [short(LanePlan::new("2s3z", 8)), short(asynchronous.clone()), other("2s3z")];
    let shaky =
        [short(LanePlan { batch_size: 2, ..LanePlan::new("2s3z", 6) }), short(sleepy), other("2s_vs_1sc")];
    let pool =
        |name: &str, lanes: [LanePlan; 3]| PoolPlan { name: name.into(), ..PoolPlan::new(lanes).threads(2) };
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
    let folder = tempfile::tempdir_in("/tmp").map_err(|error| error.to_string())?;
    let mut stranger =
        Child::stranger(folder.path(), &format!("watcher {}", room.runtime_dir().shm_prefix()));
    stranger.answer(SOON)?;
    let crashing = Crashing::begin(seed);
    let begin = Instant::now();
    let mut early = Some(duration / 5);
    while begin.elapsed() < duration {
        if early.take_if(|early| begin.elapsed() > *early).is_some() {
            cast.calm(&mut summary)?;
            gauge.look(&room);
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
    gauge.look(&room);
    summary.held = gauge.verdict()?;
    summary.crashes = crashing.end()?;
    let seen = stranger.ask("what could you open?")?;
    if !seen.ends_with(" nothing") {
        return Err(format!("another user could open: {seen}"));
    }
    cast.leave()?;
    let left = || room.files();
    if !super::process::eventually(|| left().is_empty()) {
        return Err(format!("left behind: {:#?}", left()));
    }
    Ok(summary)
}
