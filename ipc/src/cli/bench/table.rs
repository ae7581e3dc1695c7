//! `smaclite-pool bench --table`: the speed table of the SMAClite paper (table "Average seconds per
//! timestep"), with this machine's column beside it.

use super::resident_bytes;
use crate::cli::{Outcome, heading, megabytes, print_table};
use smaclite_engine::{Arena, Battle, Rules, Scratch, policy};
use smaclite_scenarios::Scenario;
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Seconds per timestep that the paper reports, on an AMD Ryzen 3700X: SMAC, SMAClite, SMAClite with its C++
/// addon.
const PAPER: [(&str, [f64; 3]); 6] = [
    ("2s_vs_1sc", [0.004, 0.007, 0.003]),
    ("3s5z", [0.013, 0.018, 0.007]),
    ("MMM2", [0.017, 0.028, 0.010]),
    ("corridor", [0.014, 0.092, 0.010]),
    ("3s_vs_5z", [0.006, 0.013, 0.005]),
    ("bane_vs_bane", [0.049, 0.086, 0.024]),
];

/// Episodes of each scenario, as in the paper.
const EPISODES: usize = 20;

pub(super) fn print(json: bool) -> Outcome {
    let mut rows =
        vec![heading(["scenario", "SMAC", "SMAClite", "SMAClite_plus", "here", "faster than SMAClite_plus"])];
    for (name, [smac, smaclite, plus]) in PAPER {
        let here = seconds_per_step(&Scenario::resolve(name)?);
        if json {
            let row = serde_json::json!({
                "scenario": name, "episodes": EPISODES, "seconds_per_step": here,
                "paper": { "smac": smac, "smaclite": smaclite, "smaclite_plus": plus },
                "rss_bytes": resident_bytes(std::process::id()),
            });
            out!("{row}")?;
        }
        let paper = [smac, smaclite, plus].map(|seconds| format!("{seconds:.3}"));
        let mut row = vec![name.to_owned()];
        row.extend(paper);
        row.extend([format!("{here:.7}"), format!("{:.0} x", plus / here)]);
        rows.push(row);
    }
    if !json {
        out!("Average seconds per timestep, random legal agents, {EPISODES} episodes each, one thread.")?;
        out!("The paper's columns were measured on an AMD Ryzen 3700X, `here` on this machine.\n")?;
        print_table(&rows)?;
        let resident = megabytes(resident_bytes(std::process::id()) as usize);
        out!("\nresident memory: {resident} here; about 600 MB (SMAC) and 100 MB (SMAClite) in the paper")?;
    }
    Ok(())
}

/// Everything but choosing actions: the step, and all observations, the state and the masks.
fn seconds_per_step(scenario: &Scenario) -> f64 {
    let arena = Arc::new(Arena::new(scenario, Rules::default()));
    let s = arena.sizes();
    let mut battle = Battle::new(arena, 0);
    let (mut scratch, mut random) = (Scratch::new(), policy::Random::new(0));
    let (mut obs, mut state) = (vec![0.0; s.n_agents * s.obs_size], vec![0.0; s.state_size]);
    let (mut avail, mut actions) = (vec![0; s.n_agents * s.n_actions], vec![0; s.n_agents]);
    let (mut steps, mut time) = (0u32, Duration::ZERO);
    for _ in 0..EPISODES {
        battle.reset();
        while !battle.is_over() {
            random.act(&battle, &mut actions);
            let begin = Instant::now();
            battle.step(&actions, &mut scratch).expect("the sampled actions are legal");
            battle.write_obs(&mut obs, &mut scratch);
            battle.write_state(&mut state);
            battle.write_avail_actions(&mut avail);
            black_box((&obs, &state, &avail));
            time += begin.elapsed();
            steps += 1;
        }
    }
    time.as_secs_f64() / f64::from(steps)
}
