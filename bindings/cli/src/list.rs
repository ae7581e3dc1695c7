//! `smaclite-pool list` and `status`: which pools run on this machine, and their statistics.

use super::output::print_json;
use super::table::{Table, percent};
use super::{CommandResult, completions, megabytes, runtime_dir};
use clap::Args;
use smaclite_ipc::{
    ConnectError, ControlSocketError, LaneStatus, PoolStatus, RuntimeDir, WaitOptions, running_pools, status,
};
use std::thread::ScopedJoinHandle;

#[derive(Args)]
pub(super) struct List {
    /// Print one JSON object per pool
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
pub(super) struct Status {
    /// Name of the pool [default: the only one that runs]
    #[arg(add = completions::pool())]
    name: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl List {
    pub(super) fn run(self) -> CommandResult {
        let (pools, errors) = request_all(&runtime_dir()?);
        if self.json {
            for pool in &pools {
                print_json(pool)?;
            }
        } else if !pools.is_empty() {
            print_pools(&pools)?;
        } else if errors.is_empty() {
            out!("no pool is running")?;
        }
        errors.iter().for_each(|error| err!("smaclite-pool: {error}"));
        match errors.len() {
            0 => Ok(()),
            silent => Err(format!("{silent} of {} pools did not answer", pools.len() + silent).into()),
        }
    }
}

fn print_pools(pools: &[PoolStatus]) -> std::io::Result<()> {
    let mut table = Table::new(["pool", "process", "lane", "environments", "learner", "steps/s"]);
    for pool in pools {
        for lane in &pool.lanes {
            table.push([
                pool.pool.clone(),
                pool.pid.to_string(),
                lane.description.lane.clone(),
                environments(lane),
                learner(lane),
                format!("{:.0}", lane.steps_per_s),
            ]);
        }
    }
    table.print()
}

impl Status {
    pub(super) fn run(self) -> CommandResult {
        let runtime_dir = runtime_dir()?;
        let pool =
            status(&runtime_dir, &given_or_only_pool(self.name, &runtime_dir)?, WaitOptions::for_response())?;
        if self.json {
            out!("{}", serde_json::to_string_pretty(&pool)?)?;
            return Ok(());
        }
        out!(
            "pool `{}`: process {}, running for {:.0} s, worker threads: {}, {} of shared memory",
            pool.pool,
            pool.pid,
            pool.uptime_s,
            pool.threads,
            megabytes(pool.shared_memory)
        )?;
        print_lanes(&pool.lanes)?;
        for lane in &pool.lanes {
            if let Some(failure) = &lane.failure {
                out!("lane `{}` failed: {failure}", lane.description.lane)?;
            }
        }
        Ok(())
    }
}

/// No pool is named, and it is not clear which one is meant.
#[derive(Debug, thiserror::Error)]
pub(super) enum NoPoolNamed {
    #[error("no pool is running; start one with `smaclite-pool serve`")]
    NoPool,
    #[error("several pools run; name one of them: {}", .0.join(", "))]
    SeveralPools(Vec<String>),
}

/// The pool that was named, or the only one that runs.
pub(super) fn given_or_only_pool(
    name: Option<String>,
    runtime_dir: &RuntimeDir,
) -> Result<String, NoPoolNamed> {
    if let Some(name) = name {
        return Ok(name);
    }
    let mut pools = running_pools(runtime_dir);
    match pools.len() {
        0 => Err(NoPoolNamed::NoPool),
        1 => Ok(pools.remove(0)),
        _ => Err(NoPoolNamed::SeveralPools(pools)),
    }
}

fn print_lanes(lanes: &[LaneStatus]) -> std::io::Result<()> {
    let mut table = Table::new(
        "lane|environments|learner|steps/s|queue wait|steps|episodes|win rate|mean return|refused requests"
            .split('|'),
    );
    for lane in lanes {
        table.push([
            lane.description.lane.clone(),
            environments(lane),
            learner(lane),
            format!("{:.0}", lane.steps_per_s),
            format!("{:.0} us", lane.queue_wait_us),
            lane.stats.steps.to_string(),
            lane.stats.episodes.to_string(),
            win_rate(lane),
            mean_return(lane),
            lane.stats.rejected.to_string(),
        ]);
    }
    table.print()
}

fn environments(lane: &LaneStatus) -> String {
    format!("{} x {}", lane.description.settings.num_envs, lane.description.scenario)
}

fn learner(lane: &LaneStatus) -> String {
    match &lane.failure {
        Some(_) => "failed".to_owned(),
        None => lane.learner_pid.map_or("none".to_owned(), |pid| format!("process {pid}")),
    }
}

fn win_rate(lane: &LaneStatus) -> String {
    match lane.stats.episodes {
        0 => "-".to_owned(),
        episodes => percent(lane.stats.wins as f64 / episodes as f64),
    }
}

fn mean_return(lane: &LaneStatus) -> String {
    match lane.stats.episodes {
        0 => "-".to_owned(),
        episodes => format!("{:.2}", lane.stats.returns / episodes as f64),
    }
}

/// Requests the status of all running pools: those that answer, and the errors of the others. All are
/// requested at the same time, so that suspended pools cost one timeout together.
fn request_all(runtime_dir: &RuntimeDir) -> (Vec<PoolStatus>, Vec<ConnectError>) {
    let names = running_pools(runtime_dir);
    let results: Vec<_> = std::thread::scope(|scope| {
        let request = |name: &String| status(runtime_dir, name, WaitOptions::for_response());
        let begin = |name| std::thread::Builder::new().spawn_scoped(scope, move || request(name));
        let threads: Vec<_> = names.iter().map(|name| (name, begin(name))).collect();
        let answer = |(name, thread): (&String, std::io::Result<ScopedJoinHandle<_>>)| match thread {
            Ok(thread) => thread.join().expect("a request does not panic"),
            Err(_) => request(name), // one after the other where threads are refused
        };
        threads.into_iter().map(answer).collect()
    });
    let (mut pools, mut errors) = (Vec::new(), Vec::new());
    for result in results {
        match result {
            Ok(pool) => pools.push(pool),
            // It ended in the meantime.
            Err(ConnectError::Control(
                ControlSocketError::NoSuchPool { .. } | ControlSocketError::Gone { .. },
            )) => {}
            Err(error) => errors.push(error),
        }
    }
    (pools, errors)
}
