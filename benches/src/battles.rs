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
fn in_turn<const N: usize>(rounds: usize, args: [&str; N]) -> Result<[f64; N], Box<dyn Error>> {
    let mut runs = [const { Vec::new() }; N];
    for _ in 0..rounds {
        for (run, args) in runs.iter_mut().zip(args) {
            run.push(steps_per_s(args)?);
        }
    }
    Ok(runs.map(median))
}

pub(crate) fn efficiency(rounds: usize) -> Result<(), Box<dyn Error>> {
    println!("64 environments of 3s5z, median of {rounds} rounds");
    for policy in ["nearest", "random"] {
        let common = format!("3s5z --seconds 1 --policy {policy}");
        let [engine, one, two, one_away, two_away] = in_turn(
            rounds,
            [
                &format!("{common} --mode engine"),
                &format!("{common} --mode embedded --threads 1"),
                &format!("{common} --mode embedded --threads 2"),
                &format!("{common} --mode attached --threads 1"),
                &format!("{common} --mode attached --threads 2"),
            ],
        )?;
        println!("{policy}: one bare engine {engine:.0} steps/s");
        println!("  embedded, 1 thread   {one:8.0} steps/s, efficiency {:.2}", one / engine);
        println!("  embedded, 2 threads  {two:8.0} steps/s, efficiency {:.2}", two / engine / 2.0);
        println!("  attached, 1 thread   {one_away:8.0} steps/s, {:.2} x embedded", one_away / one);
        println!("  attached, 2 threads  {two_away:8.0} steps/s, {:.2} x embedded", two_away / two);
    }
    Ok(())
}

pub(crate) fn asynchronous(rounds: usize) -> Result<(), Box<dyn Error>> {
    println!("64 environments, 2 threads, random actions sampled by the learner, median of {rounds} rounds");
    for scenario in ["MMM2", "2c_vs_64zg"] {
        let common = format!("{scenario} --seconds 2 --threads 2 --mode embedded");
        let [sync, half, quarter] = in_turn(
            rounds,
            [&common, &format!("{common} --batch-size 32"), &format!("{common} --batch-size 16")],
        )?;
        println!("{scenario}: synchronous {sync:.0} steps/s");
        println!("  asynchronous in batches of 32: {half:.0} steps/s, {:.2} x", half / sync);
        println!("  asynchronous in batches of 16: {quarter:.0} steps/s, {:.2} x", quarter / sync);
    }
    Ok(())
}

pub(crate) fn many(rounds: usize) -> Result<(), Box<dyn Error>> {
    println!("2s3z, random actions, 1 thread, median of {rounds} rounds");
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
