//! What the battles of a lane have in common.

use smaclite_engine::{Arena, BattleSetup};
use smaclite_scenarios::{Problems, Scenario};
use std::sync::Arc;

pub(super) struct Battles {
    pub(super) scenario: Scenario,
    pub(super) arena: Arc<Arena>,
    /// Joint actions that observations and snapshots of the lane have besides the state.
    pub(super) n_past: usize,
}

impl Battles {
    pub(super) fn of(setup: &BattleSetup, n_past: usize) -> Result<Battles, Problems> {
        let (scenario, arena) = setup.arena()?;
        Ok(Battles { scenario, arena: Arc::new(arena), n_past })
    }
}
