//! How long a small lane waits for a big one: steps of one environment, alone and while another learner steps
//! a thousand environments of the same pool.

use smaclite_engine::BattleSetup;
use smaclite_ipc::{Client, LaneConfig, RuntimeDir, Supervisor, SupervisorConfig, WaitOptions, WaitStrategy};
use smaclite_pool::PoolOptions;
use smaclite_scenarios::ScenarioFiles;
use std::error::Error;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const BIG: (&str, usize) = ("27m_vs_30m", 1024);
const SMALL: (&str, usize) = ("3m", 1);

/// Most environments that a thread takes at a time.
const CHUNK: f64 = 16.0;

/// Of each measurement.
const TIME: Duration = Duration::from_secs(2);

/// Prints the times of a step of the small lane for pools with these numbers of threads.
pub(crate) fn measure(rounds: usize) -> Result<(), Box<dyn Error>> {
    println!("step of {} x {} in microseconds, {rounds} rounds", SMALL.1, SMALL.0);
    for threads in [1, 2] {
        let name = format!("beside-{}", std::process::id());
        let runtime_dir = RuntimeDir::for_current_user()?;
        let lane = |name: &str, (scenario, num_envs)| -> Result<LaneConfig, Box<dyn Error>> {
            let (_, files) = ScenarioFiles::resolve(scenario)?;
            Ok(LaneConfig::new(name, BattleSetup::new(files), num_envs))
        };
        let lanes = vec![lane("big", BIG)?, lane("small", SMALL)?];
        let options = PoolOptions { threads, ..PoolOptions::default() };
        let config =
            SupervisorConfig { name: name.clone(), lanes, options, runtime_dir: runtime_dir.clone() };
        let _supervisor = Supervisor::start(config)?;
        // As from other processes: neither learner works in the pool.
        let connect = |lane| {
            Client::connect(&runtime_dir, &name, Some(lane), WaitStrategy::default(), WaitOptions::no_wait())
        };
        let (mut big, mut small) = (connect("big")?, connect("small")?);
        let (mut alone, mut beside, mut steps, mut seconds) = (Vec::new(), Vec::new(), 0, 0.0);
        for _ in 0..rounds {
            alone.extend(times(&mut small, &|| true)?);
            let ended = AtomicBool::new(false);
            let begin = Instant::now();
            let (of_small, of_big) = std::thread::scope(|scope| {
                let trainer = scope
                    .spawn(|| times(&mut big, &|| !ended.load(Ordering::Relaxed)).map_err(|e| e.to_string()));
                let of_small = times(&mut small, &|| true);
                ended.store(true, Ordering::Relaxed);
                (of_small, trainer.join().expect("the trainer panicked"))
            });
            beside.extend(of_small?);
            steps += of_big?.len() * BIG.1;
            seconds += begin.elapsed().as_secs_f64();
        }
        let chunk = CHUNK * threads as f64 * seconds * 1e6 / steps as f64;
        println!("{threads} threads, a chunk of {} takes {chunk:.0}:", BIG.0);
        for (what, times) in [("alone", &mut alone), ("beside", &mut beside)] {
            times.sort_by(f64::total_cmp);
            let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
            let (half, most) = (at(0.5), at(0.99));
            println!(
                "  {what:8} median {half:7.0}, 99 % within {most:7.0}: {:.2} and {:.2} chunks",
                half / chunk,
                most / chunk
            );
        }
    }
    Ok(())
}

/// The times of the steps of a lane in microseconds, for as long as `go_on` says, but at most [`TIME`].
fn times(client: &mut Client, go_on: &dyn Fn() -> bool) -> Result<Vec<f64>, Box<dyn Error>> {
    client.reset(Some(1), None, WaitOptions::forever())?;
    let lane = client.description();
    let mut actions = vec![0; lane.settings.num_envs * lane.sizes.n_agents];
    let (begin, mut times) = (Instant::now(), Vec::new());
    while begin.elapsed() < TIME && go_on() {
        client.sample_actions(None, &mut actions)?;
        let step = Instant::now();
        drop(client.step(&actions, None, WaitOptions::forever())?);
        times.push(step.elapsed().as_secs_f64() * 1e6);
    }
    Ok(times)
}
