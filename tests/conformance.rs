//! The engine beside recorded battles of the published environment, step by step and over whole episodes.
//!
//! `SMACLITE_TRACES=folder cargo test --release -p smaclite-tests --test conformance -- --nocapture` checks any
//! other recordings, with a `<scenario>.json` beside those of custom scenarios.

use std::sync::Arc;

use smaclite_engine::{Arena, Battle, ExecutionOrder, Rules, Scratch, TICKS_PER_STEP};
use smaclite_tests::compare::{self, Bounds, Comparison};
use smaclite_tests::{Recording, recording};

/// From one recorded frame to the next.
const OF_A_STEP: Bounds = Bounds { figures: 1e-6, places: 1e-5 };
/// From the reset to the last frame of an episode.
const OF_AN_EPISODE: Bounds = Bounds { figures: 1e-4, places: 1e-4 };
/// Whole episodes may part from the recording in this share of the files: a rounding can grow into another battle.
const MAY_PART: f64 = 0.06;

#[test]
fn battles_are_those_of_the_published_environment() {
    let mut total = Tally::default();
    let mut whole_episodes = 0;
    let recordings = recording::all();
    for recording in &recordings {
        let arena = Arena::new(&recording.load_scenario(), Rules::Smaclite).with_episode_limit(None);
        let arena = Arc::new(arena);
        check_sizes(recording, &arena);
        let mut tally = Tally::default();
        check_reset(recording, &arena, &mut tally);
        check_steps(recording, &arena, &mut tally);
        let episode = check_episode(recording, &arena);
        println!(
            "{:32} {tally}  whole episode {}",
            recording.name(),
            if episode.is_ok() { "yes" } else { "no" }
        );
        for difference in tally.differences.iter().chain(episode.as_ref().err()) {
            println!("    {difference}");
        }
        whole_episodes += usize::from(episode.is_ok());
        total.add(tally);
    }
    let files = recordings.len();
    println!("total: {files} files, {total}, whole episodes {whole_episodes} of {files}");
    assert!(total.differences.is_empty(), "some steps differ, see above");
    assert!(
        (files - whole_episodes) as f64 <= MAY_PART * files as f64,
        "too many whole episodes differ, see above"
    );
}

/// How many steps agree.
#[derive(Default)]
struct Tally {
    steps: usize,
    discrete: usize,
    places: usize,
    worst_position: f64,
    /// The first of each file.
    differences: Vec<String>,
}

impl Tally {
    fn count(&mut self, step: &str, comparison: &Comparison) {
        self.steps += 1;
        self.discrete += usize::from(comparison.discrete.is_none());
        self.places += usize::from(comparison.places.is_none());
        self.worst_position = self.worst_position.max(comparison.worst_position);
        if let (Some(difference), true) = (comparison.difference(), self.differences.is_empty()) {
            self.differences.push(format!("first difference, in {step}: {difference}"));
        }
    }

    fn add(&mut self, other: Tally) {
        self.steps += other.steps;
        self.discrete += other.discrete;
        self.places += other.places;
        self.worst_position = self.worst_position.max(other.worst_position);
        self.differences.extend(other.differences);
    }
}

impl std::fmt::Display for Tally {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let percent = |count: usize| 100.0 * count as f64 / self.steps.max(1) as f64;
        let (discrete, places) = (percent(self.discrete), percent(self.places));
        let (steps, worst) = (self.steps, self.worst_position);
        write!(f, "{steps:4} steps, discrete {discrete:6.2} %, positions {places:6.2} %, worst {worst:.1e}")
    }
}

fn check_sizes(recording: &Recording, arena: &Arena) {
    let sizes = arena.sizes();
    let found = [sizes.n_agents, sizes.n_enemies, sizes.n_actions, sizes.obs_size, sizes.state_size];
    assert_eq!(recording.sizes, found, "{}: agents, enemies, actions, obs, state", recording.name());
    let (recorded, found) = (recording.max_reward, arena.max_reward());
    assert!(
        (recorded - found).abs() < 1e-6,
        "{}: greatest reward {recorded}, found {found}",
        recording.name()
    );
}

/// A reset must give the first frame; it counts as a step.
fn check_reset(recording: &Recording, arena: &Arc<Arena>, tally: &mut Tally) {
    let battle = Battle::new(arena.clone(), recording.seed);
    tally.count("the reset", &compare::frame(recording, 0, &battle, OF_A_STEP));
    tally.steps -= 1;
    tally.discrete = tally.discrete.saturating_sub(1);
    tally.places = tally.places.saturating_sub(1);
}

/// From every recorded frame, with the recorded orders, one step must lead to the next frame.
fn check_steps(recording: &Recording, arena: &Arc<Arena>, tally: &mut Tally) {
    let mut battle = Battle::new(arena.clone(), recording.seed);
    let mut scratch = Scratch::new();
    for t in 0..recording.n_steps() {
        let name = format!("step {t} (ticks {} to {})", t * TICKS_PER_STEP, (t + 1) * TICKS_PER_STEP - 1);
        battle
            .restore(&recording.snapshot(t))
            .unwrap_or_else(|e| panic!("{}, {name}: {e}", recording.name()));
        let order = recording.order(t);
        let step = battle
            .step_in_order(&recording.actions[t], ExecutionOrder::Given(&order), &mut scratch)
            .unwrap_or_else(|e| panic!("{}, {name}: {e}", recording.name()));
        let mut comparison = compare::frame(recording, t + 1, &battle, OF_A_STEP);
        comparison.figure("reward", recording.rewards[t], step.reward, OF_A_STEP.figures);
        comparison.equal("terminated", recording.terminated[t], step.terminated);
        if t + 1 == recording.n_steps() {
            comparison.equal("won", recording.won, step.battle_won);
        }
        tally.count(&name, &comparison);
    }
}

/// From the reset, with the recorded actions alone, the recorded orders must come out and lead to the last frame.
///
/// The error is where the battle first parts from the recording.
fn check_episode(recording: &Recording, arena: &Arc<Arena>) -> Result<(), String> {
    let mut battle = Battle::new(arena.clone(), recording.seed);
    let mut scratch = Scratch::new();
    for t in 0..recording.n_steps() {
        let mut other_order = None;
        battle
            .step_observed(&recording.actions[t], ExecutionOrder::Drawn, &mut scratch, |tick| {
                let recorded = &recording.orders[t][tick.index];
                if let Some(i) = (0..recorded.len().max(tick.order.len())).find(|&i| recorded.get(i) != tick.order.get(i)) {
                    let units = (recorded.get(i), tick.order.get(i));
                    let tick = t * TICKS_PER_STEP + tick.index;
                    other_order.get_or_insert_with(|| format!("step {t}, tick {tick}: turn {i} of the execution order, recorded and found {units:?}"));
                }
            })
            .map_err(|e| format!("whole episode parts in step {t}: {e}"))?;
        let comparison = compare::frame(recording, t + 1, &battle, OF_AN_EPISODE);
        if let Some(difference) = comparison.difference() {
            return Err(format!("whole episode parts in step {t}: {difference}"));
        }
        if let Some(other) = other_order {
            return Err(format!("whole episode parts in {other}"));
        }
    }
    let (recorded, found) = (recording.rewards.iter().sum::<f64>(), battle.episode_return());
    if (recorded - found).abs() > OF_AN_EPISODE.figures {
        return Err(format!("whole episode: return {found}, recorded {recorded}"));
    }
    Ok(())
}
