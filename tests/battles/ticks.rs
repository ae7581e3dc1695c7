//! Comparison of the engine with battles that were recorded tick by tick, which finds the first tick and
//! quantity that differ.

use std::sync::Arc;

use smaclite_engine::{Arena, Battle, ExecutionOrder, Rules, Scratch, TICKS_PER_STEP};
use smaclite_tests::Recording;
use smaclite_tests::compare;
use smaclite_tests::recording::{self, Ticks};

#[test]
fn every_tick_equals_that_of_the_published_environment() {
    let mut differences = Vec::new();
    let mut n_ticks = 0;
    for recording in &recording::all() {
        if let Some(ticks) = &recording.ticks {
            n_ticks += ticks.earned.len();
            if let Some(difference) = first_difference(recording, ticks) {
                differences.push(format!("{}: {difference}", recording.name()));
            }
        }
    }
    println!("{n_ticks} ticks");
    assert!(differences.is_empty(), "{}", differences.join("\n"));
}

/// Plays the whole episode from its reset, with the recorded actions alone.
fn first_difference(recording: &Recording, ticks: &Ticks) -> Option<String> {
    let arena = Arc::new(Arena::new(&recording.load_scenario(), Rules::Smaclite));
    let mut battle = Battle::new(arena, recording.seed);
    let mut scratch = Scratch::new();
    let mut first = None;
    for (t, actions) in recording.actions.iter().enumerate() {
        let step = battle.step_observed(actions, ExecutionOrder::Drawn, &mut scratch, |played| {
            let tick = t * TICKS_PER_STEP + played.index;
            let mut comparison = compare::Comparison::default();
            for unit in (0..played.units.pos.len()).filter(|&unit| ticks.frames[tick].alive[unit]) {
                let (recorded, found) = (ticks.preferred[tick][unit], played.preferred[unit]);
                comparison.same(format_args!("preferred velocity of unit {unit}"), recorded, found);
            }
            comparison.same("execution order", &recording.orders[t][played.index][..], played.order);
            let units = compare::units(&ticks.frames[tick + 1], played.units);
            comparison.difference = comparison.difference.or(units.difference);
            comparison.same("reward", ticks.earned[tick], played.earned);
            if let (None, Some(difference)) = (&first, comparison.difference) {
                first = Some(format!("step {t}, tick {tick}: {difference}"));
            }
        });
        if let (None, Err(illegal)) = (&first, step) {
            first = Some(format!("step {t}: {illegal}"));
        }
        if first.is_some() {
            break;
        }
    }
    first
}
