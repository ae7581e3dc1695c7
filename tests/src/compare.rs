//! Comparing a battle with a recorded one, bit for bit.

use std::fmt;

use smaclite_engine::{Battle, Faction, Scratch, Units};

use crate::Recording;

/// The result of [`units`] and [`frame`].
#[derive(Clone, Debug, Default)]
pub struct Comparison {
    /// The first quantity whose bits differ.
    pub difference: Option<Difference>,
    /// The largest difference of a living unit's coordinate, in squares.
    pub worst_position: f64,
}

/// One quantity that differs.
#[derive(Clone, Debug)]
pub struct Difference {
    /// The quantity, and its unit or agent.
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

/// Equality of bits: 0.0 differs from -0.0, and a NaN equals itself.
pub trait SameBits: fmt::Debug {
    /// Whether both have the same bits.
    fn same_bits(&self, other: &Self) -> bool;
}

macro_rules! same_bits {
    ($($name:ty: $bits:expr),* $(,)?) => {$(
        impl SameBits for $name {
            fn same_bits(&self, other: &Self) -> bool {
                let bits: fn(&$name) -> _ = $bits;
                bits(self) == bits(other)
            }
        }
    )*};
}

same_bits! {
    f32: |x| x.to_bits(),
    f64: |x| x.to_bits(),
    glam::Vec2: |v| v.to_array().map(f32::to_bits),
    bool: |x| *x,
    u8: |x| *x,
    Option<u32>: |x| *x,
}

impl SameBits for &[u32] {
    fn same_bits(&self, other: &Self) -> bool {
        self == other
    }
}

impl Comparison {
    /// Compares two values, and notes the difference if it is the first.
    pub fn same<T: SameBits>(&mut self, what: impl fmt::Display, recorded: T, found: T) {
        if !recorded.same_bits(&found) {
            self.difference.get_or_insert_with(|| Difference {
                what: what.to_string(),
                recorded: format!("{recorded:?}"),
                found: format!("{found:?}"),
            });
        }
    }
}

/// Compares units with recorded ones. Of dead units only the health is compared: their other values are
/// stale.
///
/// `declared` is compared where the recording contains it.
pub fn units(recorded: &Units, found: &Units) -> Comparison {
    let mut comparison = Comparison::default();
    for unit in 0..recorded.alive.len() {
        comparison.same(format_args!("alive of unit {unit}"), recorded.alive[unit], found.alive[unit]);
        comparison.same(format_args!("hp of unit {unit}"), recorded.hp[unit], found.hp[unit]);
        if !recorded.alive[unit] {
            continue;
        }
        comparison.same(format_args!("target of unit {unit}"), recorded.target[unit], found.target[unit]);
        if let Some(&declared) = recorded.declared.get(unit) {
            comparison.same(format_args!("declared of unit {unit}"), declared, found.declared[unit]);
        }
        for (column, recorded, found) in [
            ("shield", &recorded.shield, &found.shield),
            ("energy", &recorded.energy, &found.energy),
            ("cooldown", &recorded.cooldown, &found.cooldown),
            ("shield_cooldown", &recorded.shield_cooldown, &found.shield_cooldown),
            ("healing", &recorded.healing, &found.healing),
        ] {
            comparison.same(format_args!("{column} of unit {unit}"), recorded[unit], found[unit]);
        }
        comparison.same(format_args!("pos of unit {unit}"), recorded.pos[unit], found.pos[unit]);
        comparison.same(format_args!("vel of unit {unit}"), recorded.vel[unit], found.vel[unit]);
        let apart = (recorded.pos[unit].as_dvec2() - found.pos[unit].as_dvec2()).abs().max_element();
        comparison.worst_position = comparison.worst_position.max(apart);
    }
    comparison
}

/// Compares a battle, its units and what agents see of them, with what was recorded before step `t`.
pub fn frame(recording: &Recording, t: usize, battle: &Battle) -> Comparison {
    let mut comparison = units(&recording.frames[t], battle.units());
    let sizes = battle.arena().sizes();
    let mut avail = vec![0; sizes.n_agents * sizes.n_actions];
    battle.write_avail_actions(Faction::Ally, &mut avail);
    for (i, (&recorded, found)) in recording.avail[t].iter().zip(avail).enumerate() {
        let (agent, action) = (i / sizes.n_actions, i % sizes.n_actions);
        comparison.same(format_args!("avail_actions[{action}] of agent {agent}"), recorded, found);
    }
    let mut obs = vec![f32::NAN; sizes.n_agents * sizes.obs_size];
    battle.write_obs(Faction::Ally, &mut obs, &mut Scratch::new());
    for (i, (&recorded, found)) in recording.obs[t].iter().zip(obs).enumerate() {
        let (agent, entry) = (i / sizes.obs_size, i % sizes.obs_size);
        comparison.same(format_args!("obs[{entry}] of agent {agent}"), recorded, found);
    }
    let mut state = vec![f32::NAN; sizes.state_size];
    battle.write_state(Faction::Ally, &mut state);
    for (entry, (&recorded, found)) in recording.state[t].iter().zip(state).enumerate() {
        comparison.same(format_args!("state[{entry}]"), recorded, found);
    }
    comparison
}
