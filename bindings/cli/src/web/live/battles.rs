//! What the battles of a lane have in common.

use smaclite_engine::{Arena, BattleSetup};
use smaclite_scenarios::{Problems, Scenario};
use std::sync::Arc;

pub(super) struct Battles {
    pub(super) scenario: Scenario,
    pub(super) arena: Arc<Arena>,
}

impl Battles {
    pub(super) fn of(setup: &BattleSetup) -> Result<Battles, Problems> {
        let (scenario, arena) = setup.arena()?;
        Ok(Battles { scenario, arena: Arc::new(arena) })
    }
}
