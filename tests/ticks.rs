//! The engine beside battles that were recorded tick by tick: for finding where in a step something goes wrong.

use std::sync::Arc;

use smaclite_engine::{Arena, Battle, ExecutionOrder, Rules, Scratch, TICKS_PER_STEP};
use smaclite_tests::Recording;
use smaclite_tests::compare::{self, Bounds};
use smaclite_tests::recording::{self, Ticks};

const BOUNDS: Bounds = Bounds { figures: 1e-6, places: 1e-5 };

#[test]
fn every_tick_is_that_of_the_published_environment() {
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

fn first_difference(recording: &Recording, ticks: &Ticks) -> Option<String> {
    let arena = Arc::new(Arena::new(&recording.load_scenario(), Rules::Smaclite));
    let mut battle = Battle::new(arena, recording.seed);
    let mut scratch = Scratch::new();
    let mut first = None;
    for t in 0..recording.n_steps() {
        battle.restore(&recording.snapshot(t)).expect("a recorded snapshot");
        let order = recording.order(t);
        let order = ExecutionOrder::Given(&order);
        let step = battle.step_observed(&recording.actions[t], order, &mut scratch, |seen| {
            let tick = t * TICKS_PER_STEP + seen.index;
            let mut comparison = compare::units(&ticks.frames[tick + 1], seen.units, BOUNDS);
            comparison.figure("reward", ticks.earned[tick], seen.earned, BOUNDS.figures);
            for unit in (0..seen.units.pos.len()).filter(|&unit| ticks.frames[tick].alive[unit]) {
                let (recorded, found) = (ticks.preferred[tick][unit], seen.preferred[unit]);
                comparison.equal(format_args!("preferred velocity of unit {unit}"), recorded, found);
            }
            if let (None, Some(difference)) = (&first, comparison.difference()) {
                first = Some(format!("step {t}, tick {tick}: {difference}"));
            }
        });
        step.expect("recorded actions are legal");
    }
    first
}
