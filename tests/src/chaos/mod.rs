//! The chaos test: processes of two pools are killed, stopped and restarted at random, while every process
//! checks what it can see.
//!
//! # Processes
//!
//! Two supervisors share one runtime directory. That of pool `permanent` is stopped at times but never
//! killed, so that the resources it holds can be measured; that of pool `restarted` is also killed, or ended
//! normally, and started again under the same name. Each pool has three lanes. Clients of each pool are child
//! processes, with these [`roles`]:
//!
//! | role | per pool | what it does |
//! | --- | --- | --- |
//! | `learner` | lanes 1 and 2 | attaches, resets, steps and holds batches, in sessions of random length |
//! | `spectator` | lanes 1 and 2 | reads the newest frame at random times |
//! | `invalid_sender` | 1 | sends malformed requests, and requests of unknown sessions, to a random lane |
//! | `forking_learner` | `permanent`, lane 3 | steps, and forks children that read its newest batch |
//! | `namespace_learner` | `restarted`, lane 3 | attaches from another process namespace, repeatedly |
//!
//! Besides these, another user tries to open every file of the pools in `/dev/shm`, and one thread starts
//! pools in other directories and kills them at a random system call
//! ([`crash_points`](crate::crash_points)). Without root, `unshare` or `strace` these do less; the summary
//! counts what was done.
//!
//! # One run
//!
//! 1. Start everything.
//! 2. Until the time is over: do one random thing to one random process (kill a client and start another with
//!    its role, stop a process for a fraction of a second, kill, end or stop a supervisor), then read all
//!    messages for up to 120 ms.
//! 3. After a fifth of the time, and at the end: continue all stopped processes, wait until every client has
//!    made progress, and measure the resources of the supervisor of `permanent`.
//! 4. End all processes normally.
//!
//! What is done, to which process and when it is next done follows from the seed; how the processes are
//! scheduled does not, so a run cannot be repeated exactly.
//!
//! # Invariants
//!
//! A run fails with the first that does not hold:
//!
//! - Every frame of a learner has the bits of the reference ([`Reference`](crate::Reference)), and none is
//!   lost or repeated.
//! - A batch that a learner holds does not change, also after its client, its pool or its supervisor is gone.
//! - A forked child reads the bytes of its parent's batch, and does not hang.
//! - An attached learner gets no error except that its pool is gone.
//! - No process is silent for longer than `max_silence`: each has something to report many times per second.
//! - After disturbances every client makes progress again.
//! - A supervisor can be started under the name of one that was killed or ended, and ends normally when
//!   asked.
//! - File descriptors, private memory, mappings and files of the supervisor that is never killed do not grow
//!   between the two measurements.
//! - Another user can open no file.
//! - After a kill at any system call, `smaclite-pool clean` removes everything, and the next start works.
//! - At the end no file is left.

mod processes;
pub mod roles;
mod summary;

pub use summary::Summary;

use crate::crash_points::{CALLS, check, has_strace};
use crate::fault::Fault;
use crate::process::{TIMEOUT, eventually};
use crate::resources::ResourceMonitor;
use crate::{Child, LanePlan, PoolPlan, TestDir};
use processes::Processes;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use smaclite_pool::Autoreset;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Kills pools at random system calls, each in its own directory, until it is asked to end.
struct CrashThread {
    end: Arc<AtomicBool>,
    thread: JoinHandle<Result<u64, String>>,
}

impl CrashThread {
    fn start(seed: u64) -> CrashThread {
        let end = Arc::new(AtomicBool::new(!has_strace()));
        let (ended, mut rng) = (Arc::clone(&end), Pcg64::seed_from_u64(seed));
        let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
        let thread = std::thread::spawn(move || {
            let mut killed = 0;
            while !ended.load(Ordering::Relaxed) {
                let (call, most) = CALLS.choose(&mut rng).expect("not empty");
                killed += u64::from(check(&plan, call, rng.random_range(1..=*most))?);
            }
            Ok(killed)
        });
        CrashThread { end, thread }
    }

    /// How many pools were killed.
    fn end(self) -> Result<u64, String> {
        self.end.store(true, Ordering::Relaxed);
        self.thread.join().expect("no panic")
    }
}

/// The pools `permanent` and `restarted`.
fn pools() -> [PoolPlan; 2] {
    let short = |lane: LanePlan| LanePlan { episode_limit: Some(15), ..lane };
    let asynchronous = LanePlan { batch_size: 4, autoreset: Autoreset::SameStep, ..LanePlan::new("3s5z", 8) };
    let slow = LanePlan::new("2s_vs_1sc", 2).fault(1, Fault::Sleep(Duration::from_millis(1)));
    let third = |scenario| LanePlan { name: "third".to_owned(), ..LanePlan::new(scenario, 4) };
    let permanent = [short(LanePlan::new("2s3z", 8)), short(asynchronous), third("2s3z")];
    let restarted =
        [short(LanePlan { batch_size: 2, ..LanePlan::new("2s3z", 6) }), short(slow), third("2s_vs_1sc")];
    let pool =
        |name: &str, lanes: [LanePlan; 3]| PoolPlan { name: name.into(), ..PoolPlan::new(lanes).threads(2) };
    [pool("permanent", permanent), pool("restarted", restarted)]
}

/// Runs for `duration`. A process that is silent for longer than `max_silence` hangs.
///
/// # Errors
/// The first invariant that did not hold.
pub fn run(duration: Duration, seed: u64, max_silence: Duration) -> Result<Summary, String> {
    let dir = TestDir::new();
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut summary = Summary::default();
    let mut processes = Processes::start(&dir, pools(), max_silence)?;
    let mut resources = ResourceMonitor::new(processes.permanent_supervisor());
    let folder = tempfile::tempdir_in("/tmp").map_err(|error| error.to_string())?;
    let role = format!("file_opener {}", dir.runtime_dir().shm_prefix());
    let mut other_user = Child::other_user(&dir, folder.path(), &role);
    other_user.answer(TIMEOUT)?;
    let crashes = CrashThread::start(seed);
    let begin = Instant::now();
    let mut first_measurement = Some(duration / 5);
    while begin.elapsed() < duration {
        if first_measurement.take_if(|time| begin.elapsed() > *time).is_some() {
            processes.recover(&mut summary)?;
            resources.measure(&dir);
        }
        processes.disturb(&mut rng, &mut summary)?;
        let end = Instant::now() + Duration::from_millis(rng.random_range(0..120));
        while Instant::now() < end {
            processes.read_messages(&mut summary)?;
            std::thread::sleep(Duration::from_millis(5));
        }
    }
    processes.recover(&mut summary)?;
    resources.measure(&dir);
    summary.resources = resources.check()?;
    summary.crash_points = crashes.end()?;
    let opened = other_user.ask("report")?;
    if !opened.ends_with(" nothing") {
        return Err(format!("another user could open: {opened}"));
    }
    processes.end()?;
    if !eventually(|| dir.files().is_empty()) {
        return Err(format!("left behind: {:#?}", dir.files()));
    }
    Ok(summary)
}
