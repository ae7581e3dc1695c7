//! What the units of a side receive: observations, the state, and the available actions.

mod avail;
mod bounds;
mod features;
mod obs;
mod state;
#[cfg(test)]
mod tests;
mod unit_layout;
mod unit_tables;
mod universal_rows;

pub(crate) use avail::Available;
pub use bounds::feature_bounds;
pub use features::{action_names, obs_features, state_features};
pub(crate) use obs::{ObsScratch, write_obs};
pub use state::UnitFeatures;
pub(crate) use state::{types_in_state, write_state};
pub use unit_layout::{TargetLayout, UnitLayout, UnitRows};
pub(crate) use unit_tables::UnitTables;
pub use universal_rows::{NotUniversal, RowMap, UniversalForm, UniversalRows};

use crate::arena::Arena;
use crate::units::Units;
use smaclite_scenarios::Faction;
use unit_tables::UnitTable;

/// The parts of a battle that the encoders read, for the side of a faction.
pub(crate) struct View<'a> {
    pub arena: &'a Arena,
    pub units: &'a Units,
    pub tables: &'a UnitTables,
    /// Of the units of the faction.
    pub available: &'a Available,
    pub faction: Faction,
    /// The side sees the battle reflected at the centre of the map.
    pub mirror: bool,
}

impl View<'_> {
    /// The units of the side.
    fn own(&self) -> &UnitTable {
        self.tables.of(self.faction)
    }

    /// The units that the side fights.
    fn others(&self) -> &UnitTable {
        self.tables.of(self.faction.opponent())
    }

    /// What offsets are multiplied by.
    fn sign(&self) -> f32 {
        if self.mirror { -1.0 } else { 1.0 }
    }
}

/// A value divided by its maximum; 0 if the maximum is 0.
fn ratio(value: f64, max: f64) -> f32 {
    if max == 0.0 { 0.0 } else { (value / max) as f32 }
}
