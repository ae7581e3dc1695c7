//! The scenario as plain, checked data. `read` reads it from a file.

use crate::{Generation, Rewards, Smacv2, Teams, Terrain};
use serde::{Deserialize, Serialize};
use smaclite_units::{Keyword, UnitType};
use std::collections::BTreeSet;

/// The faction that a unit fights for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Faction {
    /// Controlled by the agents.
    #[serde(rename = "allies")]
    Ally,
    /// Controlled by the built-in opponent.
    #[serde(rename = "enemies")]
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
    /// Start position `[x, y]` in squares. Under rules `starcraft` units start elsewhere around `centre`.
    pub position: [f64; 2],
    /// The centre of its group.
    pub centre: [f64; 2],
}

/// What enemies do that nothing else plays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum March {
    /// They attack-move to the attack point.
    ToAttackPoint,
    /// They attack-move to the nearest agent.
    ToNearestAgent,
}

impl Keyword for March {
    const KEYWORDS: &'static [(&'static str, March)] =
        &[("attack_move", March::ToAttackPoint), ("attack_nearest", March::ToNearestAgent)];
}

/// Where enemies march to, if it is not the attack point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Destination {
    /// The nearest agent.
    Agents,
    /// A point on the line between these two, drawn in each episode.
    Line([[f64; 2]; 2]),
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
    /// Where they march to instead under rules `starcraft`.
    pub march_to: Option<Destination>,
    /// Who plays the enemies unless a user says otherwise; `None` if the file does not say it.
    pub opponent: Option<March>,
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
    /// What is drawn at each reset; then `units` are one sample.
    pub generation: Option<Generation>,
    /// The options of SMACv2's interface; `None` for SMAClite's.
    pub smacv2: Option<Smacv2>,
    /// What both sides are rewarded for; with `smacv2` its own options are used instead.
    pub rewards: Rewards,
    /// The height of each square, row y = 0 first, as SMACv2's option `obs_terrain_height` shows it: 0 to
    /// 255; `None` if all are 127.
    pub heights: Option<Vec<u8>>,
}

impl Scenario {
    /// Number of allied units: one agent each.
    pub fn n_agents(&self) -> usize {
        self.count(Faction::Ally)
    }

    /// Whether the enemies have the types of the agents, one by one, and shields as they do.
    pub fn has_equal_sides(&self) -> bool {
        let types =
            |side| self.units.iter().filter(move |unit| unit.faction == side).map(|unit| unit.unit_type);
        self.ally_has_shields == self.enemy_has_shields
            && (self.draws_teams() || types(Faction::Ally).eq(types(Faction::Enemy)))
    }

    /// Whether each episode draws the types of the units.
    pub fn draws_teams(&self) -> bool {
        self.generation.as_ref().is_some_and(|drawn| drawn.teams != Teams::OfGroups)
    }

    /// Whether each unit type has a number of its own in observations and states.
    pub fn tells_types_apart(&self) -> bool {
        let numbers: BTreeSet<&usize> = self.type_ids.iter().collect();
        numbers.len() == self.unit_types.len()
    }

    /// Number of enemy units.
    pub fn n_enemies(&self) -> usize {
        self.count(Faction::Enemy)
    }

    /// The same battle with the sides exchanged: agents are enemies, and enemies are agents. Units keep their
    /// ids and positions; those that are enemies now march to the middle of those that were.
    ///
    /// Laws from which types and positions are drawn (`generation`) stay as they are.
    pub fn exchanged(&self) -> Scenario {
        let mut exchanged = self.clone();
        exchanged.units.iter_mut().for_each(|unit| unit.faction = unit.faction.opponent());
        std::mem::swap(&mut exchanged.ally_has_shields, &mut exchanged.enemy_has_shields);
        let enemies = self.units.iter().filter(|unit| unit.faction == Faction::Enemy);
        let (x, y) = enemies.fold((0.0, 0.0), |(x, y), unit| (x + unit.position[0], y + unit.position[1]));
        exchanged.attack_point = [x, y].map(|sum| sum / self.n_enemies() as f64);
        exchanged.march_to = None;
        exchanged
    }

    /// The same battle after half a turn of the map: north is south, and east is west.
    ///
    /// Laws from which types and positions are drawn (`generation`) stay as they are.
    pub fn turned(&self) -> Scenario {
        let sides = [self.terrain.width(), self.terrain.height()].map(f64::from);
        let turn = |[x, y]: [f64; 2]| [sides[0] - x, sides[1] - y];
        let mut turned = Scenario { terrain: self.terrain.turned(), ..self.clone() };
        for unit in &mut turned.units {
            (unit.position, unit.centre) = (turn(unit.position), turn(unit.centre));
        }
        turned.heights.iter_mut().for_each(|heights| heights.reverse());
        turned.attack_point = turn(self.attack_point);
        if let Some(Destination::Line(ends)) = &mut turned.march_to {
            *ends = ends.map(turn);
        }
        turned
    }

    fn count(&self, faction: Faction) -> usize {
        self.units.iter().filter(|unit| unit.faction == faction).count()
    }
}
