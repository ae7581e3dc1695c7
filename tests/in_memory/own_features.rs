//! The layout of what a lane appends to observations, written down by hand.

use crate::harness::{Learner, start_one};
use smaclite_pool::Autoreset;
use smaclite_pool::fields::Field;
use smaclite_tests::{LanePlan, Row};

/// Features of an observation in 2s_vs_1sc: 4 moves, one enemy of 5, one ally of 6, own health and shield.
const FEATURES: usize = 17;
const N_ACTIONS: usize = 7;
const STOP: i32 = 1;

/// What follows the features of both agents, as text: `.` for 0, and `|` between the vectors.
fn appended(row: &Row, field: Field) -> [String; 2] {
    let floats: Vec<f32> = row.value(field).chunks(4).map(float).collect();
    assert_eq!(floats.len(), 2 * (FEATURES + 2 * N_ACTIONS + 2));
    let text = |row: &[f32]| {
        let digit = |x: &f32| if *x == 0.0 { '.' } else { x.to_string().remove(0) };
        let (past, id) = row[FEATURES..].split_at(2 * N_ACTIONS);
        let vectors = past.chunks(N_ACTIONS).chain([id]);
        vectors.map(|vector| vector.iter().map(digit).collect()).collect::<Vec<String>>().join("|")
    };
    [0, 1].map(|agent| text(&floats[agent * floats.len() / 2..][..floats.len() / 2]))
}

fn float(bytes: &[u8]) -> f32 {
    f32::from_ne_bytes(bytes.try_into().unwrap())
}

fn lane(autoreset: Autoreset) -> LanePlan {
    LanePlan {
        autoreset,
        episode_limit: Some(3),
        obs_last_actions: 2,
        obs_agent_id: true,
        ..LanePlan::new("2s_vs_1sc", 1)
    }
}

fn step(learner: &mut Learner, actions: [i32; 2]) -> Row {
    learner.send_step(&[0], &actions);
    learner.batch().remove(0)
}

#[test]
fn the_newest_action_comes_first_and_a_new_episode_forgets() {
    for autoreset in [Autoreset::NextStep, Autoreset::SameStep] {
        let (_pool, mut learner) = start_one(1, &lane(autoreset));
        learner.send_reset_all(None);
        let first = [".......|.......|1.", ".......|.......|.1"];
        assert_eq!(appended(&learner.batch()[0], Field::Obs), first);
        // North is 2, south is 3.
        let row = step(&mut learner, [2, STOP]);
        assert_eq!(appended(&row, Field::Obs), ["..1....|.......|1.", ".1.....|.......|.1"]);
        let row = step(&mut learner, [3, STOP]);
        assert_eq!(appended(&row, Field::Obs), ["...1...|..1....|1.", ".1.....|.1.....|.1"]);
        let row = step(&mut learner, [STOP, 2]);
        assert!(row.ended());
        let last = [".1.....|...1...|1.", "..1....|.1.....|.1"];
        if autoreset == Autoreset::SameStep {
            assert_eq!(appended(&row, Field::FinalObs), last);
            assert_eq!(appended(&row, Field::Obs), first);
        } else {
            assert_eq!(appended(&row, Field::Obs), last);
            // This step only resets: its actions are ignored and not remembered.
            assert_eq!(appended(&step(&mut learner, [STOP, STOP]), Field::Obs), first);
        }
        let row = step(&mut learner, [2, 3]);
        assert_eq!(appended(&row, Field::Obs), ["..1....|.......|1.", "...1...|.......|.1"]);
        learner.send_reset_all(None);
        assert_eq!(appended(&learner.batch()[0], Field::Obs), first);
    }
}

#[test]
fn rows_of_dead_agents_are_zeros() {
    let plan = LanePlan { episode_limit: None, ..lane(Autoreset::NextStep) };
    let (_pool, mut learner) = start_one(1, &plan);
    learner.send_reset_all(None);
    let mut row = learner.batch().remove(0);
    // Agent 0 walks north and attacks until it dies; agent 1 stands, out of reach.
    const NORTH: i32 = 2;
    const ATTACK: i32 = 6;
    for _ in 0..100 {
        let attacks = row.masks().next().unwrap()[ATTACK as usize] == 1;
        row = step(&mut learner, [if attacks { ATTACK } else { NORTH }, STOP]);
        if row.value(Field::Alive)[0] == 0 {
            break;
        }
    }
    assert_eq!(row.value(Field::Alive), [0, 1]);
    let obs = row.value(Field::Obs);
    assert!(obs[..obs.len() / 2].iter().all(|byte| *byte == 0));
    assert_eq!(appended(&row, Field::Obs), [".......|.......|..", ".1.....|.1.....|.1"]);
}
