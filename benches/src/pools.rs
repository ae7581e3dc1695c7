//! Pools compared with the engine alone, with each other, and by their number of environments.

use crate::second_process;
use smaclite_cli::bench::policy::Policy;
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
            let wait = workload.options.wait.to_string();
            second_process(&[
                "pool",
                name,
                &workload.scenario_argument,
                &num_envs,
                &batch_size,
                &threads,
                &wait,
            ])
        };
        Ok(workload.measure(&pool, &self.interrupted)?)
    }

    /// Measures the workloads in turn, once per round, and returns the median steps/s of each. The number of
    /// a workload is how many copies of it run at once, each on its own thread; their steps/s are added.
    fn in_turn(&self, workloads: &[(usize, Workload)]) -> Result<Vec<f64>, Box<dyn Error>> {
        let mut results = vec![Vec::new(); workloads.len()];
        for _ in 0..self.rounds {
            for (results, (copies, workload)) in results.iter_mut().zip(workloads) {
                results.push(self.at_once(*copies, workload)?);
            }
        }
        Ok(results.into_iter().map(median).collect())
    }

    fn at_once(&self, copies: usize, workload: &Workload) -> Result<f64, String> {
        let measure = || self.measure(workload).map_err(|error| error.to_string());
        std::thread::scope(|scope| {
            let threads: Vec<_> = (0..copies).map(|_| scope.spawn(measure)).collect();
            let results = threads.into_iter().map(|thread| thread.join().expect("a measurement panicked"));
            results.map(|result| result.map(|result| result.steps_per_s)).sum()
        })
    }
}

/// Prints steps/s of pools with 1, 2, 4, ... threads, up to the number of cores, and of as many engines at
/// once.
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
            let mut workloads = vec![(1, engine(Mode::InTurn))];
            workloads.extend(threads.iter().map(|&threads| (threads, engine(Mode::Engine))));
            for mode in [Mode::Embedded, Mode::Attached] {
                workloads.extend(threads.iter().map(|&threads| {
                    let options = PoolOptions { threads, ..workload.options };
                    (1, Workload { policy, mode, options, ..workload.clone() })
                }));
            }
            let steps = meter.in_turn(&workloads)?;
            let [engines, embedded, attached] = std::array::from_fn(|i| &steps[1 + i * threads.len()..]);
            let (alone, in_turn) = (engines[0], steps[0] / engines[0]);
            let policy = policy.name();
            println!("{scenario}, {policy}: engine alone {alone:.0} steps/s, in turn {in_turn:.2} x");
            for (i, n) in threads.iter().enumerate() {
                let at_once = engines[i] / alone;
                let efficiency = embedded[i] / engines[i];
                let ratio = attached[i] / embedded[i];
                println!("  {n} threads: engines  {:8.0} steps/s, {at_once:.2} x alone", engines[i]);
                println!("  {n} threads: embedded {:8.0} steps/s, {efficiency:.2} x engines", embedded[i]);
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
        let workloads = batch_sizes.map(|batch_size| (1, Workload { batch_size, ..workload.clone() }));
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
