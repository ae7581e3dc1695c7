//! What a step costs: plays every standard scenario with the "nearest" player on one thread and prints
//! nanoseconds per living unit and tick, with observation, state and availability written in every step.
//!
//! `cargo run --release -p smaclite-engine --example speed [SECONDS] [SCENARIO...]`

use std::sync::Arc;
use std::time::{Duration, Instant};

use smaclite_engine::{Arena, Battle, Rules, Scratch, TICKS_PER_STEP, policy};
use smaclite_scenarios::Scenario;

fn main() {
    let mut args = std::env::args().skip(1).peekable();
    let seconds =
        args.next_if(|arg| arg.parse::<f64>().is_ok()).and_then(|arg| arg.parse().ok()).unwrap_or(0.5);
    let mut names: Vec<String> = args.collect();
    if names.is_empty() {
        names = Scenario::standard_names().map(str::to_owned).collect();
    }
    println!(
        "{:16} {:>12} {:>12} {:>12} {:>10}",
        "scenario", "ns/unit/tick", "step only", "encoders", "steps/s"
    );
    let mut log_sum = 0.0;
    for name in &names {
        let figures = measure(name, Duration::from_secs_f64(seconds));
        println!(
            "{name:16} {:12.1} {:12.1} {:12.1} {:10.0}",
            figures.all, figures.step, figures.encoders, figures.steps_per_second
        );
        log_sum += figures.all.ln();
    }
    println!("geometric mean   {:12.1}", (log_sum / names.len() as f64).exp());
}

/// Nanoseconds per living unit and tick.
struct Figures {
    all: f64,
    step: f64,
    encoders: f64,
    steps_per_second: f64,
}

/// Plays the same few episodes again and again and takes the fastest time of each part, as other programs may
/// share the processor.
fn measure(name: &str, at_least: Duration) -> Figures {
    let scenario = Scenario::standard(name).unwrap_or_else(|| panic!("no standard scenario {name}"));
    let start = Battle::new(Arc::new(Arena::new(&scenario, Rules::Smaclite)), 1);
    let mut best: Option<Costs> = None;
    let begun = Instant::now();
    while best.is_none() || begun.elapsed() < at_least {
        let costs = play(start.clone(), 100);
        best = Some(best.map_or(costs, |best| Costs {
            stepping: best.stepping.min(costs.stepping),
            encoding: best.encoding.min(costs.encoding),
            ..costs
        }));
    }
    let Costs { stepping, encoding, n_steps, unit_ticks } = best.expect("played at least once");
    let per_unit_tick = |time: Duration| time.as_nanos() as f64 / unit_ticks as f64;
    Figures {
        all: per_unit_tick(stepping + encoding),
        step: per_unit_tick(stepping),
        encoders: per_unit_tick(encoding),
        steps_per_second: f64::from(n_steps) / (stepping + encoding).as_secs_f64(),
    }
}

#[derive(Clone, Copy)]
struct Costs {
    stepping: Duration,
    encoding: Duration,
    n_steps: u32,
    unit_ticks: usize,
}

fn play(mut battle: Battle, n_steps: u32) -> Costs {
    let sizes = battle.arena().sizes();
    let mut scratch = Scratch::new();
    let mut actions = vec![0; sizes.n_agents];
    let mut obs = vec![0.0; sizes.n_agents * sizes.obs_size];
    let mut state = vec![0.0; sizes.state_size];
    let mut avail = vec![0; sizes.n_agents * sizes.n_actions];
    let mut costs = Costs { stepping: Duration::ZERO, encoding: Duration::ZERO, n_steps, unit_ticks: 0 };
    for _ in 0..n_steps {
        if battle.is_over() {
            battle.reset();
        }
        policy::nearest(&battle, &mut actions);
        costs.unit_ticks += TICKS_PER_STEP * (sizes.n_units - battle.dead_allies() - battle.dead_enemies());
        let start = Instant::now();
        battle.step(&actions, &mut scratch).expect("the player's actions are available");
        let stepped = Instant::now();
        battle.write_obs(&mut obs, &mut scratch);
        battle.write_state(&mut state);
        battle.write_avail_actions(&mut avail);
        costs.encoding += stepped.elapsed();
        costs.stepping += stepped - start;
    }
    costs
}
