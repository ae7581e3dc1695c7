//! `smaclite-pool list` and `status`: which pools run here, and how they do.

use super::{Outcome, heading, megabytes, print_table, runtime_dir};
use crate::control::client::ControlSocketError;
use crate::{ConnectError, LaneStatus, PoolStatus, RuntimeDir, running_pools, status};
use clap::Args;

#[derive(Args)]
pub(super) struct List {
    /// One JSON object a pool
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
pub(super) struct Status {
    /// The pool's name
    #[arg(default_value = "default")]
    name: String,
    /// As JSON
    #[arg(long)]
    json: bool,
}

impl List {
    pub(super) fn run(self) -> Outcome {
        let (pools, silent) = ask_all(&runtime_dir()?);
        if self.json {
            for pool in &pools {
                out!("{}", serde_json::to_string(pool)?)?;
            }
        } else if !pools.is_empty() {
            print_pools(&pools)?;
        } else if silent.is_empty() {
            out!("no pool runs here")?;
        }
        silent.iter().for_each(|error| eprintln!("smaclite-pool: {error}"));
        match silent.len() {
            0 => Ok(()),
            count => Err(format!("of {} pools, {count} did not answer", pools.len() + count).into()),
        }
    }
}

fn print_pools(pools: &[PoolStatus]) -> std::io::Result<()> {
    let mut rows = vec![heading(["pool", "process", "lane", "environments", "learner", "steps/s"])];
    for pool in pools {
        for lane in &pool.lanes {
            let d = &lane.description;
            rows.push(vec![
                pool.pool.clone(),
                pool.pid.to_string(),
                d.lane.clone(),
                format!("{} x {}", d.settings.num_envs, d.scenario),
                learner(lane),
                format!("{:.0}", lane.steps_per_s),
            ]);
        }
    }
    print_table(&rows)
}

impl Status {
    pub(super) fn run(self) -> Outcome {
        let pool = status(&runtime_dir()?, &self.name)?;
        if self.json {
            out!("{}", serde_json::to_string_pretty(&pool)?)?;
            return Ok(());
        }
        out!(
            "pool `{}`: process {}, up {:.0} s, worker threads: {}, {} of shared memory",
            pool.pool,
            pool.pid,
            pool.uptime_s,
            pool.threads,
            megabytes(pool.shared_memory)
        )?;
        let mut rows = vec![heading([
            "lane",
            "environments",
            "learner",
            "steps/s",
            "queue wait",
            "steps",
            "episodes",
            "won",
            "refused",
        ])];
        rows.extend(pool.lanes.iter().map(lane_row));
        print_table(&rows)?;
        for lane in &pool.lanes {
            if let Some(failure) = &lane.failure {
                out!("lane `{}` failed: {failure}", lane.description.lane)?;
            }
        }
        Ok(())
    }
}

fn lane_row(lane: &LaneStatus) -> Vec<String> {
    let (d, f) = (&lane.description, lane.stats);
    let won = if f.episodes == 0 {
        "-".to_owned()
    } else {
        format!("{:.1} %", 100.0 * f.wins as f64 / f.episodes as f64)
    };
    vec![
        d.lane.clone(),
        format!("{} x {}", d.settings.num_envs, d.scenario),
        learner(lane),
        format!("{:.0}", lane.steps_per_s),
        format!("{:.0} us", lane.queue_wait_us),
        f.steps.to_string(),
        f.episodes.to_string(),
        won,
        f.rejected.to_string(),
    ]
}

fn learner(lane: &LaneStatus) -> String {
    match (&lane.failure, lane.learner_pid) {
        (Some(_), _) => "failed".to_owned(),
        (None, Some(pid)) => format!("process {pid}"),
        (None, None) => "none".to_owned(),
    }
}

/// The pools that answer, and why the others that run do not. All are asked at the same time, so that those
/// that are stopped cost their 10 seconds together.
fn ask_all(runtime_dir: &RuntimeDir) -> (Vec<PoolStatus>, Vec<ConnectError>) {
    let names = running_pools(runtime_dir);
    let answers: Vec<_> = std::thread::scope(|scope| {
        let asked: Vec<_> = names.iter().map(|name| scope.spawn(move || status(runtime_dir, name))).collect();
        asked.into_iter().map(|thread| thread.join().expect("asking does not panic")).collect()
    });
    let (mut pools, mut silent) = (Vec::new(), Vec::new());
    for answer in answers {
        match answer {
            Ok(pool) => pools.push(pool),
            Err(ConnectError::Control(
                ControlSocketError::NoSuchPool { .. } | ControlSocketError::Gone { .. },
            )) => {}
            Err(error) => silent.push(error),
        }
    }
    (pools, silent)
}
