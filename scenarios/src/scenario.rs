//! The scenario as plain, checked data. `read` reads it from a file.

use crate::Terrain;
use smaclite_units::{Keyword, UnitType};

/// The faction that a unit fights for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Faction {
    /// Controlled by the agents.
    Ally,
    /// Controlled by the built-in opponent.
    Enemy,
}

impl Faction {
    /// The faction that this one fights.
    pub const fn opponent(self) -> Faction {
        match self {
            Faction::Ally => Faction::Enemy,
            Faction::Enemy => Faction::Ally,
        }
    }
}

impl Keyword for Faction {
    const KEYWORDS: &'static [(&'static str, Faction)] =
        &[("ALLY", Faction::Ally), ("ENEMY", Faction::Enemy)];
}

/// One unit at the start of an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Index into [`Scenario::unit_types`].
    pub unit_type: usize,
    /// Its faction.
    pub faction: Faction,
    /// Its number within its faction, from 0 in battle-wide order.
    pub id_in_faction: usize,
    /// Start position `[x, y]` in squares.
    pub position: [f64; 2],
}

/// A checked scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// The `name` of its file.
    pub name: String,
    /// The map.
    pub terrain: Terrain,
    /// Every type on the field, each once, in order of first mention in the groups.
    pub unit_types: Vec<UnitType>,
    /// Every unit; its index is its battle-wide id.
    pub units: Vec<Placement>,
    /// Where the enemies march to, `[x, y]` in squares.
    pub attack_point: [f64; 2],
    /// Length of the type one-hot in observations and state; 0 for none, otherwise at least 2.
    pub num_unit_types: usize,
    /// Position in the one-hot of each entry of `unit_types`; all 0 when `num_unit_types` is 0.
    pub type_ids: Vec<usize>,
    /// Whether observations and state have the shields of allies.
    pub ally_has_shields: bool,
    /// Whether observations and state have the shields of enemies.
    pub enemy_has_shields: bool,
    /// Steps after which an episode is truncated.
    pub episode_limit: Option<u32>,
}

impl Scenario {
    /// Number of allied units: one agent each.
    pub fn n_agents(&self) -> usize {
        self.count(Faction::Ally)
    }

    /// Number of enemy units.
    pub fn n_enemies(&self) -> usize {
        self.count(Faction::Enemy)
    }

    fn count(&self, faction: Faction) -> usize {
        self.units.iter().filter(|unit| unit.faction == faction).count()
    }
}
