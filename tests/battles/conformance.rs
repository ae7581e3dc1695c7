//! Comparison of the engine with recorded battles of the published environment, bit for bit: step by step,
//! and over whole episodes.
//!
//! `SMACLITE_TRACES=folder cargo test --release -p smaclite-tests --test conformance -- --nocapture` compares
//! with other recordings, which have a `<scenario>.json` beside those of custom scenarios.

use std::fmt;
use std::sync::Arc;

use smaclite_engine::{Arena, Battle, ExecutionOrder, Rules, Scratch, TICKS_PER_STEP};
use smaclite_tests::compare::{self, Comparison};
use smaclite_tests::{Recording, recording};

#[test]
fn battles_equal_those_of_the_published_environment() {
    let mut total = Tally::default();
    let mut whole_episodes = 0;
    let recordings = recording::all();
    for recording in &recordings {
        let mut replay = Replay::new(recording);
        replay.run();
        let Replay { tally, episode_difference, .. } = replay;
        let is_whole = if episode_difference.is_none() { "yes" } else { "no" };
        println!("{:32} {tally}  whole episode {is_whole}", recording.name());
        for difference in tally.first_difference.iter().chain(&episode_difference) {
            println!("    {difference}");
        }
        whole_episodes += usize::from(episode_difference.is_none());
        total.add(&tally);
    }
    let files = recordings.len();
    println!("total: {files} files, {total}, whole episodes {whole_episodes} of {files}");
    assert_eq!(total.same, total.steps, "steps equal to the recorded ones, see above");
    assert_eq!(whole_episodes, files, "whole episodes equal to the recorded ones, see above");
}

/// Number of steps that equal the recording.
#[derive(Default)]
struct Tally {
    steps: usize,
    same: usize,
    worst_position: f64,
    first_difference: Option<String>,
}

impl Tally {
    fn count(&mut self, step: &str, comparison: &Comparison) {
        self.steps += 1;
        self.same += usize::from(comparison.difference.is_none());
        self.worst_position = self.worst_position.max(comparison.worst_position);
        if let Some(difference) = &comparison.difference {
            self.first_difference.get_or_insert_with(|| format!("first difference, in {step}: {difference}"));
        }
    }

    fn add(&mut self, other: &Tally) {
        self.steps += other.steps;
        self.same += other.same;
        self.worst_position = self.worst_position.max(other.worst_position);
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = 100.0 * self.same as f64 / self.steps.max(1) as f64;
        write!(f, "{:4} steps, same {percent:6.2} %, worst position {:.1e}", self.steps, self.worst_position)
    }
}

/// A recording replayed in two ways: as one episode from its reset, and each step from its recorded snapshot.
struct Replay<'a> {
    recording: &'a Recording,
    /// Played from the reset with the recorded actions alone.
    episode: Battle,
    /// Restored from each recorded snapshot in turn.
    step: Battle,
    scratch: Scratch,
    tally: Tally,
    /// The first difference between the episode and the recording.
    episode_difference: Option<String>,
}

impl<'a> Replay<'a> {
    fn new(recording: &'a Recording) -> Replay<'a> {
        let arena = Arena::new(&recording.load_scenario(), Rules::Smaclite).with_episode_limit(None);
        check_sizes(recording, &arena);
        let arena = Arc::new(arena);
        Replay {
            recording,
            episode: Battle::new(arena.clone(), recording.seed),
            step: Battle::new(arena, recording.seed),
            scratch: Scratch::new(),
            tally: Tally::default(),
            episode_difference: None,
        }
    }

    fn run(&mut self) {
        let reset = compare::frame(self.recording, 0, &self.episode);
        self.tally.count("the reset", &reset);
        self.note("the reset", reset);
        for t in 0..self.recording.n_steps() {
            let name = format!("step {t} (ticks {} to {})", t * TICKS_PER_STEP, (t + 1) * TICKS_PER_STEP - 1);
            self.play_step(t, &name);
            self.play_episode(t, &name);
        }
    }

    /// From the recorded snapshot with the recorded orders, one step must lead to the next recorded snapshot.
    fn play_step(&mut self, t: usize, name: &str) {
        let recording = self.recording;
        let snapshot = recording.snapshot(t, &self.episode);
        let fail = |e: &dyn fmt::Display| -> ! { panic!("{}, {name}: {e}", recording.name()) };
        self.step.restore(&snapshot).unwrap_or_else(|e| fail(&e));
        let order = recording.order(t);
        let order = ExecutionOrder::Given(&order);
        let step = self.step.step_observed(&recording.actions[t], order, &mut self.scratch, |_| {});
        let step = step.unwrap_or_else(|e| fail(&e));
        let mut comparison = compare::frame(recording, t + 1, &self.step);
        comparison.same("reward", recording.rewards[t], step.reward);
        comparison.same("terminated", recording.terminated[t], step.terminated);
        if t + 1 == recording.n_steps() {
            comparison.same("won", recording.won, step.battle_won);
        }
        self.tally.count(name, &comparison);
    }

    /// Plays one step of the episode: it must have the recorded orders, and lead to the recorded snapshot.
    fn play_episode(&mut self, t: usize, name: &str) {
        if self.episode_difference.is_some() {
            return;
        }
        let recording = self.recording;
        let mut orders = Comparison::default();
        let step = self.episode.step_observed(
            &recording.actions[t],
            ExecutionOrder::Drawn,
            &mut self.scratch,
            |tick| {
                let what = format_args!("execution order of tick {}", t * TICKS_PER_STEP + tick.index);
                orders.same(what, &recording.orders[t][tick.index][..], tick.order);
            },
        );
        let step = match step {
            Ok(step) => step,
            Err(e) => return self.episode_difference = Some(format!("whole episode, in {name}: {e}")),
        };
        let mut comparison = compare::frame(recording, t + 1, &self.episode);
        comparison.difference = orders.difference.or(comparison.difference);
        comparison.same("reward", recording.rewards[t], step.reward);
        self.note(name, comparison);
    }

    fn note(&mut self, name: &str, comparison: Comparison) {
        self.episode_difference = comparison.difference.map(|d| format!("whole episode, in {name}: {d}"));
    }
}

fn check_sizes(recording: &Recording, arena: &Arena) {
    let sizes = arena.sizes();
    let found = [sizes.n_agents, sizes.n_enemies, sizes.n_actions, sizes.obs_size, sizes.state_size];
    assert_eq!(recording.sizes, found, "{}: agents, enemies, actions, obs, state", recording.name());
    assert_eq!(recording.max_reward, arena.max_reward(), "{}: greatest reward", recording.name());
}
