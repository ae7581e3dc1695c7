//! A moment from the state that a learner receives, where the battle itself is in another process.

use glam::{DVec2, Vec2};
use smaclite_engine::{FeatureBlock, state_features};
use smaclite_scenarios::{Faction, Scenario};

use crate::{Moment, UnitMoment};

impl Moment {
    /// The moment that a state describes: f32 `[state_size]`, laid out as in [`state_features`].
    ///
    /// A state has neither targets nor attacks, and nothing of dead units: their position is NaN, so that no
    /// picture has a mark of them. What else it does not contain is 0: the tick, shields that the scenario
    /// hides, the energy and cooldown of enemies, the cooldown of healers and the energy of other agents.
    /// Units face their nearest living opponent. Values may differ from those of the battle by rounding: a
    /// position by 1e-5 squares. A state that is all observations (`obs_instead_of_state`) shows no unit.
    ///
    /// # Panics
    /// If `state` does not have `state_size` values.
    pub fn from_state(scenario: &Scenario, state: &[f32]) -> Moment {
        let blocks = state_features(scenario);
        let state_size = blocks.last().map_or(0, FeatureBlock::end);
        assert_eq!(state.len(), state_size, "one state");
        let mut units: Vec<UnitMoment> = (0..scenario.units.len())
            .map(|id| unit_moment(scenario, id, UnitFeatures::new(scenario, id, &blocks, state)))
            .collect();
        let facing: Vec<f32> = (0..units.len()).map(|id| facing(scenario, &units, id)).collect();
        for (unit, facing) in units.iter_mut().zip(facing) {
            unit.facing = facing;
        }
        Moment { tick: 0, units, attacks: Vec::new() }
    }
}

/// The features of a unit in a state.
struct UnitFeatures<'a> {
    names: &'a [String],
    values: &'a [f32],
}

impl<'a> UnitFeatures<'a> {
    fn new(scenario: &Scenario, id: usize, blocks: &'a [FeatureBlock], state: &'a [f32]) -> Self {
        let unit = &scenario.units[id];
        let name = if unit.faction == Faction::Enemy { "enemies" } else { "allies" };
        let Some(block) = blocks.iter().find(|block| block.name == name) else {
            return UnitFeatures { names: &[], values: &[] };
        };
        let start = block.start + unit.id_in_faction * block.features.len();
        UnitFeatures { names: &block.features, values: &state[start..start + block.features.len()] }
    }

    /// A feature; 0 if units of this faction do not have it.
    fn get(&self, name: &str) -> f64 {
        let index = self.names.iter().position(|other| other == name);
        index.map_or(0.0, |index| f64::from(self.values[index]))
    }
}

impl UnitFeatures<'_> {
    /// The type that the one-hot of types names, of a living unit.
    fn unit_type(&self, scenario: &Scenario) -> Option<usize> {
        let n_types = scenario.num_unit_types;
        let place = (0..n_types).find(|i| self.get(&format!("type_{i}")) == 1.0)?;
        scenario.type_ids.iter().position(|id| *id == place)
    }
}

fn unit_moment(scenario: &Scenario, id: usize, features: UnitFeatures<'_>) -> UnitMoment {
    let type_index = features.unit_type(scenario).unwrap_or(scenario.units[id].unit_type);
    let unit_type = &scenario.unit_types[type_index];
    let map = DVec2::new(f64::from(scenario.terrain.width()), f64::from(scenario.terrain.height()));
    // With SMACv2's levels of health, a unit below its own has negative health until the end of the step.
    let alive = features.values.iter().any(|value| *value != 0.0);
    let relative = DVec2::new(features.get("rel_x"), features.get("rel_y"));
    let pos = if alive { relative * map + map / 2.0 } else { DVec2::NAN };
    let energy_or_cooldown = features.get("energy/cooldown");
    let greatest_cooldown =
        if scenario.smacv2.is_some() { unit_type.cooldown } else { unit_type.greatest_cooldown() };
    let (energy, cooldown) =
        if unit_type.is_healer() { (energy_or_cooldown, 0.0) } else { (0.0, energy_or_cooldown) };
    UnitMoment {
        unit_type: type_index,
        pos: pos.as_vec2(),
        facing: 0.0,
        hp: (features.get("health").max(0.0) * unit_type.hp) as f32,
        shield: (features.get("shield") * unit_type.shield) as f32,
        energy: (energy * unit_type.energy) as f32,
        cooldown: (cooldown * greatest_cooldown) as f32,
        alive,
        target: None,
    }
}

/// The direction to the nearest living opponent; without one, east for allies and west for enemies.
fn facing(scenario: &Scenario, units: &[UnitMoment], id: usize) -> f32 {
    let (faction, pos) = (scenario.units[id].faction, units[id].pos);
    let opponents = scenario.units.iter().zip(units).filter(|(unit, _)| unit.faction != faction);
    let offsets = opponents.filter(|(_, state)| state.alive).map(|(_, state)| state.pos - pos);
    let nearest = offsets.min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let default = if faction == Faction::Ally { Vec2::X } else { Vec2::NEG_X };
    nearest.filter(|offset| offset.is_finite() && *offset != Vec2::ZERO).unwrap_or(default).to_angle()
}
