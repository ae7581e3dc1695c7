//! Pools compared with the engine alone, with each other, and by their number of environments.

use crate::second_process;
use smaclite_cli::bench::play::Policy;
use smaclite_cli::bench::throughput::median;
use smaclite_cli::bench::throughput::{Mode, Throughput, Workload};
use smaclite_cli::process::interrupt_flag;
use smaclite_pool::PoolOptions;
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Measures workloads until the program is interrupted.
struct Meter {
    rounds: usize,
    interrupted: Arc<AtomicBool>,
}

impl Meter {
    fn new(rounds: usize) -> std::io::Result<Meter> {
        Ok(Meter { rounds, interrupted: interrupt_flag()? })
    }

    fn measure(&self, workload: &Workload) -> Result<Throughput, Box<dyn Error>> {
        let pool = |workload: &Workload, name: &str| {
            let numbers = [workload.num_envs, workload.batch_size, workload.options.threads];
            let [num_envs, batch_size, threads] = numbers.map(|number| number.to_string());
            let wait = workload.options.wait.name();
            second_process(&[
                "pool",
                name,
                &workload.scenario_argument,
                &num_envs,
                &batch_size,
                &threads,
                wait,
            ])
        };
        Ok(workload.measure(&pool, &self.interrupted)?)
    }

    /// Measures the workloads in turn, once per round, and returns the median steps/s of each.
    fn in_turn(&self, workloads: &[Workload]) -> Result<Vec<f64>, Box<dyn Error>> {
        let mut results = vec![Vec::new(); workloads.len()];
        for _ in 0..self.rounds {
            for (results, workload) in results.iter_mut().zip(workloads) {
                results.push(self.measure(workload)?.steps_per_s);
            }
        }
        Ok(results.into_iter().map(median).collect())
    }
}

/// Prints steps/s of pools with 1, 2, 4, ... threads, up to the number of cores, and of the engine alone.
pub(crate) fn efficiency(rounds: usize, scenarios: &[String]) -> Result<(), Box<dyn Error>> {
    let meter = Meter::new(rounds)?;
    let cores = std::thread::available_parallelism()?.get();
    let threads: Vec<usize> = (0..).map(|i| 1 << i).take_while(|threads| *threads <= cores).collect();
    println!("64 environments, median of {rounds} rounds, {cores} cores");
    for scenario in scenarios {
        let time = Duration::from_secs(1);
        let workload = Workload { time, ..Workload::new(scenario)? };
        for policy in [Policy::Nearest, Policy::Random, Policy::Sampled] {
            let engine = |mode| Workload { policy, mode, ..workload.clone() };
            let mut workloads = vec![engine(Mode::Engine), engine(Mode::InTurn)];
            for mode in [Mode::Embedded, Mode::Attached] {
                workloads.extend(threads.iter().map(|&threads| {
                    let options = PoolOptions { threads, ..workload.options };
                    Workload { policy, mode, options, ..workload.clone() }
                }));
            }
            let steps = meter.in_turn(&workloads)?;
            let (embedded, attached) = steps[2..].split_at(threads.len());
            let (alone, in_turn) = (steps[0], steps[1] / steps[0]);
            let policy = policy.name();
            println!("{scenario}, {policy}: engine alone {alone:.0} steps/s, in turn {in_turn:.2} x");
            for (i, n) in threads.iter().enumerate() {
                let efficiency = embedded[i] / alone / *n as f64;
                let ratio = attached[i] / embedded[i];
                println!("  {n} threads: embedded {:8.0} steps/s, efficiency {efficiency:.2}", embedded[i]);
                println!("  {n} threads: attached {:8.0} steps/s, {ratio:.2} x embedded", attached[i]);
            }
        }
    }
    Ok(())
}

/// Prints steps/s of batches that are smaller than the number of environments.
pub(crate) fn asynchronous(rounds: usize) -> Result<(), Box<dyn Error>> {
    let meter = Meter::new(rounds)?;
    println!("64 environments, 2 threads, random actions sampled by the learner, median of {rounds} rounds");
    for scenario in ["MMM2", "2c_vs_64zg"] {
        let options = PoolOptions { threads: 2, ..PoolOptions::default() };
        let workload = Workload { options, time: Duration::from_secs(2), ..Workload::new(scenario)? };
        let batch_sizes = [64, 32, 16];
        let workloads = batch_sizes.map(|batch_size| Workload { batch_size, ..workload.clone() });
        let steps = meter.in_turn(&workloads)?;
        println!("{scenario}: synchronous {:.0} steps/s", steps[0]);
        for (batch_size, steps_per_s) in batch_sizes.iter().zip(&steps).skip(1) {
            let ratio = steps_per_s / steps[0];
            println!("  asynchronous in batches of {batch_size}: {steps_per_s:.0} steps/s, {ratio:.2} x");
        }
    }
    Ok(())
}

/// Prints steps/s and memory by the number of environments.
pub(crate) fn many(rounds: usize) -> Result<(), Box<dyn Error>> {
    let meter = Meter::new(rounds)?;
    println!("2s3z, random actions sampled by the learner, 1 thread, median of {rounds} rounds");
    let options = PoolOptions { threads: 1, ..PoolOptions::default() };
    let workload = Workload { options, time: Duration::from_secs(2), ..Workload::new("2s3z")? };
    let mut of_64 = None;
    for num_envs in [64, 256, 1024, 4096, 10_000] {
        let workload = Workload { num_envs, batch_size: num_envs, ..workload.clone() };
        let results = (0..rounds).map(|_| meter.measure(&workload)).collect::<Result<Vec<_>, _>>()?;
        let steps = median(results.iter().map(|result| result.steps_per_s).collect());
        let memory = median(results.iter().map(|result| result.rss_bytes as f64 / 1e6).collect());
        let ratio = steps / *of_64.get_or_insert(steps);
        println!("{num_envs:6} environments: {steps:8.0} steps/s, {ratio:.2} x 64; resident {memory:.0} MB");
    }
    Ok(())
}
