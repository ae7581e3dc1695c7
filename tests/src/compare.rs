//! Setting a battle beside a recorded frame of it.

use std::fmt;

use smaclite_engine::{Battle, Scratch, Units};

use crate::Recording;

/// How far figures may be apart.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Health, shield, energy, cooldowns, healing and rewards.
    pub figures: f64,
    /// Positions, observations and state.
    pub places: f64,
}

/// What [`units`] and [`frame`] found.
#[derive(Clone, Debug, Default)]
pub struct Comparison {
    /// The first difference in who lives, targets, availability or figures.
    pub discrete: Option<Difference>,
    /// The first difference in positions, observations or state.
    pub places: Option<Difference>,
    /// The largest difference of a living unit's coordinate.
    pub worst_position: f64,
}

/// One thing that differs.
#[derive(Clone, Debug)]
pub struct Difference {
    /// What, and of which unit or agent.
    pub what: String,
    /// Its recorded value.
    pub recorded: String,
    /// Its value in the battle.
    pub found: String,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: recorded {}, found {}", self.what, self.recorded, self.found)
    }
}

impl Comparison {
    /// The first difference of any kind.
    pub fn difference(&self) -> Option<&Difference> {
        self.discrete.as_ref().or(self.places.as_ref())
    }

    /// Compares two figures, and notes the difference if none is noted yet.
    pub fn figure(&mut self, what: impl fmt::Display, recorded: f64, found: f64, bound: f64) {
        if (recorded - found).abs() > bound || found.is_nan() {
            note(&mut self.discrete, what, recorded, found);
        }
    }

    /// Compares two things that must be equal.
    pub fn equal<T: PartialEq + fmt::Debug>(&mut self, what: impl fmt::Display, recorded: T, found: T) {
        if recorded != found {
            note(&mut self.discrete, what, recorded, found);
        }
    }

    fn place(&mut self, what: impl fmt::Display, recorded: f32, found: f32, bound: f64) -> f64 {
        let error = (f64::from(recorded) - f64::from(found)).abs();
        if error > bound || error.is_nan() {
            note(&mut self.places, what, recorded, found);
        }
        error
    }
}

fn note<T: fmt::Debug>(slot: &mut Option<Difference>, what: impl fmt::Display, recorded: T, found: T) {
    slot.get_or_insert_with(|| Difference {
        what: what.to_string(),
        recorded: format!("{recorded:?}"),
        found: format!("{found:?}"),
    });
}

/// Compares units with recorded ones. Of the dead only health counts: their other values are stale.
pub fn units(recorded: &Units, found: &Units, bounds: Bounds) -> Comparison {
    let mut comparison = Comparison::default();
    for unit in 0..recorded.alive.len() {
        comparison.equal(format_args!("alive of unit {unit}"), recorded.alive[unit], found.alive[unit]);
        comparison.figure(
            format_args!("hp of unit {unit}"),
            recorded.hp[unit],
            found.hp[unit],
            bounds.figures,
        );
        if !recorded.alive[unit] {
            continue;
        }
        comparison.equal(format_args!("target of unit {unit}"), recorded.target[unit], found.target[unit]);
        let columns = [
            ("shield", &recorded.shield, &found.shield),
            ("energy", &recorded.energy, &found.energy),
            ("cooldown", &recorded.cooldown, &found.cooldown),
            ("shield_cooldown", &recorded.shield_cooldown, &found.shield_cooldown),
            ("healing", &recorded.healing, &found.healing),
        ];
        for (column, recorded, found) in columns {
            let what = format_args!("{column} of unit {unit}");
            comparison.figure(what, recorded[unit], found[unit], bounds.figures);
        }
        for (axis, x) in [(0, "x"), (1, "y")] {
            let what = format_args!("{x} of unit {unit}");
            let error =
                comparison.place(what, recorded.pos[unit][axis], found.pos[unit][axis], bounds.places);
            comparison.worst_position = comparison.worst_position.max(error);
        }
    }
    comparison
}

/// Compares a battle, units and what agents see of them, with what was recorded before step `t`.
pub fn frame(recording: &Recording, t: usize, battle: &Battle, bounds: Bounds) -> Comparison {
    let mut comparison = units(&recording.frames[t], battle.units(), bounds);
    let sizes = battle.arena().sizes();
    let mut avail = vec![0; sizes.n_agents * sizes.n_actions];
    battle.write_avail_actions(&mut avail);
    for (i, (&recorded, found)) in recording.avail[t].iter().zip(avail).enumerate() {
        let (agent, action) = (i / sizes.n_actions, i % sizes.n_actions);
        comparison.equal(format_args!("availability of action {action} to agent {agent}"), recorded, found);
    }
    let mut obs = vec![f32::NAN; sizes.n_agents * sizes.obs_size];
    battle.write_obs(&mut obs, &mut Scratch::new());
    for (i, (&recorded, found)) in recording.obs[t].iter().zip(obs).enumerate() {
        let (agent, entry) = (i / sizes.obs_size, i % sizes.obs_size);
        comparison.place(format_args!("obs[{entry}] of agent {agent}"), recorded, found, bounds.places);
    }
    let mut state = vec![f32::NAN; sizes.state_size];
    battle.write_state(&mut state);
    for (entry, (&recorded, found)) in recording.state[t].iter().zip(state).enumerate() {
        comparison.place(format_args!("state[{entry}]"), recorded, found, bounds.places);
    }
    comparison
}
