//! The features that describe a unit in observations and state, and the sizes that follow from them.

use crate::command::action;
use crate::sizes::Sizes;
use glam::{DVec2, Vec2};
use smaclite_scenarios::{Faction, Scenario};
use std::sync::Arc;

/// Which optional features observations and state have, and the values that scale positions.
#[derive(Clone, Debug)]
pub(crate) struct Features {
    pub ally_shields: bool,
    pub enemy_shields: bool,
    /// Length of the one-hot of unit types; 0 for none.
    pub n_types: usize,
    /// Position in that one-hot, by type.
    pub of_type: Arc<[usize]>,
    pub width: f64,
    pub height: f64,
}

impl Features {
    pub(super) fn new(scenario: &Scenario) -> Features {
        Features {
            ally_shields: scenario.ally_has_shields,
            enemy_shields: scenario.enemy_has_shields,
            n_types: scenario.num_unit_types,
            of_type: scenario.type_ids.as_slice().into(),
            width: f64::from(scenario.terrain.width()),
            height: f64::from(scenario.terrain.height()),
        }
    }

    /// Whether shields of a faction are features.
    pub fn has_shield(&self, faction: Faction) -> bool {
        match faction {
            Faction::Ally => self.ally_shields,
            Faction::Enemy => self.enemy_shields,
        }
    }

    /// A position relative to the centre of the map, in shares of its sides: -0.5 to 0.5.
    pub fn relative(&self, position: Vec2) -> [f32; 2] {
        let position = position.as_dvec2();
        let x = (position.x - self.width / 2.0) / self.width;
        let y = (position.y - self.height / 2.0) / self.height;
        [x as f32, y as f32]
    }

    /// The position of a [relative](Self::relative) one, up to rounding: less than 1e-6 squares in maps of up
    /// to 32 squares.
    pub fn position(&self, relative: [f32; 2]) -> Vec2 {
        let [x, y] = relative.map(f64::from);
        let squares = DVec2::new(x * self.width + self.width / 2.0, y * self.height + self.height / 2.0);
        squares.as_vec2()
    }

    /// Floats that describe the health, shield and type of a unit of a faction.
    pub fn body(&self, faction: Faction) -> usize {
        1 + usize::from(self.has_shield(faction)) + self.n_types
    }
}

/// The sizes as the units of a faction have them.
pub(super) fn sizes(scenario: &Scenario, own: Faction) -> Sizes {
    let features = Features::new(scenario);
    let (n_agents, n_enemies) = match own {
        Faction::Ally => (scenario.n_agents(), scenario.n_enemies()),
        Faction::Enemy => (scenario.n_enemies(), scenario.n_agents()),
    };
    let n_actions = n_actions(scenario, own);
    let (ally, enemy) = (features.body(own), features.body(own.opponent()));
    Sizes {
        n_agents,
        n_enemies,
        n_actions,
        // The terms are those of `Battle::write_obs` and `Battle::write_state`, in their order.
        obs_size: 4 + n_enemies * (4 + enemy) + n_agents.saturating_sub(1) * (4 + ally) + ally,
        state_size: n_agents * (3 + ally + n_actions) + n_enemies * (2 + enemy),
        perception_size: 0,
        n_phases: 0,
        enemies: None,
    }
}

/// Actions of a unit of a faction, available or not.
pub(crate) fn n_actions(scenario: &Scenario, faction: Faction) -> usize {
    action::FIRST_TARGET + n_targets(scenario, faction)
}

/// Number of target actions: enough for every opponent, and if a unit of the faction is a healer for all that
/// it can heal.
fn n_targets(scenario: &Scenario, faction: Faction) -> usize {
    let of = |faction| scenario.units.iter().filter(move |unit| unit.faction == faction);
    let heals = |unit_type: usize| scenario.unit_types[unit_type].is_healer();
    let n_opponents = of(faction.opponent()).count();
    if scenario.generation.is_some() {
        // Any unit may be drawn as a healer, and any other one can then be healed.
        let any_heals = (0..scenario.unit_types.len()).any(heals);
        return n_opponents.max(if any_heals { of(faction).count() } else { 0 });
    }
    // A target action is numbered by in-faction id, so the last unit that can be healed decides.
    let healable = of(faction).filter(|unit| !heals(unit.unit_type)).map(|unit| unit.id_in_faction + 1).max();
    match healable {
        Some(healable) if of(faction).any(|unit| heals(unit.unit_type)) => healable.max(n_opponents),
        _ => n_opponents,
    }
}
