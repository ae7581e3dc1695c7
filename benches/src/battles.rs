//! Figures of real battles, from `smaclite-pool bench` run in turn with what it is compared to.

use crate::median;
use serde_json::Value;
use std::error::Error;
use std::process::Command;

/// Runs `smaclite-pool bench` and returns its one row.
fn bench(args: &str) -> Result<Value, Box<dyn Error>> {
    let program = std::env::current_exe()?.with_file_name("smaclite-pool");
    let output = Command::new(&program).arg("bench").args(args.split_whitespace()).arg("--json").output();
    let output =
        output.map_err(|e| format!("{}: {e}; build it: cargo build --release", program.display()))?;
    if !output.status.success() {
        return Err(format!("bench {args}: {}", String::from_utf8_lossy(&output.stderr)).into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

fn steps_per_s(args: &str) -> Result<f64, Box<dyn Error>> {
    bench(args)?["steps_per_s"].as_f64().ok_or_else(|| "bench gave no steps_per_s".into())
}

/// Runs the measurements in turn, `rounds` times, and returns the medians of their steps/s.
fn in_turn(rounds: usize, args: &[String]) -> Result<Vec<f64>, Box<dyn Error>> {
    let mut runs = vec![Vec::new(); args.len()];
    for _ in 0..rounds {
        for (run, args) in runs.iter_mut().zip(args) {
            run.push(steps_per_s(args)?);
        }
    }
    Ok(runs.into_iter().map(median).collect())
}

/// Pools of 1, 2, 4, ... threads, as many as there are cores, beside one bare engine.
pub(crate) fn efficiency(rounds: usize, scenarios: &[String]) -> Result<(), Box<dyn Error>> {
    let cores = std::thread::available_parallelism()?.get();
    let threads: Vec<usize> = (0..).map(|i| 1 << i).take_while(|threads| *threads <= cores).collect();
    println!("64 environments, median of {rounds} rounds, {cores} cores");
    for scenario in scenarios {
        for policy in ["nearest", "random", "sampled"] {
            let run = |mode: &str| format!("{scenario} --seconds 1 --policy {policy} --mode {mode}");
            let mut args = vec![run("engine")];
            for mode in ["embedded", "attached"] {
                args.extend(threads.iter().map(|threads| format!("{} --threads {threads}", run(mode))));
            }
            let steps = in_turn(rounds, &args)?;
            let (embedded, attached) = steps[1..].split_at(threads.len());
            println!("{scenario}, {policy}: one bare engine {:.0} steps/s", steps[0]);
            for (i, n) in threads.iter().enumerate() {
                let efficiency = embedded[i] / steps[0] / *n as f64;
                let ratio = attached[i] / embedded[i];
                println!("  {n} threads: embedded {:8.0} steps/s, efficiency {efficiency:.2}", embedded[i]);
                println!("  {n} threads: attached {:8.0} steps/s, {ratio:.2} x embedded", attached[i]);
            }
        }
    }
    Ok(())
}

pub(crate) fn asynchronous(rounds: usize) -> Result<(), Box<dyn Error>> {
    println!("64 environments, 2 threads, random actions drawn by the learner, median of {rounds} rounds");
    for scenario in ["MMM2", "2c_vs_64zg"] {
        let common = format!("{scenario} --seconds 2 --threads 2 --mode embedded");
        let batches = [64, 32, 16];
        let steps = in_turn(rounds, &batches.map(|m| format!("{common} --batch-size {m}")))?;
        println!("{scenario}: synchronous {:.0} steps/s", steps[0]);
        for (m, steps_per_s) in batches.iter().zip(&steps).skip(1) {
            println!(
                "  asynchronous in batches of {m}: {steps_per_s:.0} steps/s, {:.2} x",
                steps_per_s / steps[0]
            );
        }
    }
    Ok(())
}

pub(crate) fn many(rounds: usize) -> Result<(), Box<dyn Error>> {
    println!("2s3z, random actions drawn by the learner, 1 thread, median of {rounds} rounds");
    let mut base = 0.0;
    for envs in [64, 256, 1024, 4096, 10_000] {
        let args = format!("2s3z --seconds 2 --threads 1 --mode embedded --envs {envs}");
        let mut rows = (0..rounds).map(|_| bench(&args)).collect::<Result<Vec<_>, _>>()?;
        let steps = median(rows.iter().filter_map(|row| row["steps_per_s"].as_f64()).collect());
        let row = rows.pop().ok_or("no rounds")?;
        base = if envs == 64 { steps } else { base };
        let memory = row["rss_bytes"].as_f64().unwrap_or(0.0) / 1e6;
        println!(
            "{envs:6} environments: {steps:8.0} steps/s, {:.2} x 64; resident {memory:.0} MB",
            steps / base
        );
    }
    Ok(())
}
