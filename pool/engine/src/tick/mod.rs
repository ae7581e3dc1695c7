//! One tick, 1/16 s of a battle, in five phases; this file is their table of contents.
//!
//! Every phase runs over all living units in ascending battle-wide id before the next begins. Only phase 4
//! has an order of its own, which is part of the rules and is handed in.

mod avoid;
mod choose;
mod deaths;
mod execute;
mod preferred;
mod targeters;
mod targets;

use glam::Vec2;

use crate::arena::Arena;
use crate::command::Command;
use crate::neighbour_order::NeighbourOrder;
use crate::units::{AliveIds, Units, make_room};

/// What a tick works on.
pub(crate) struct World<'a> {
    pub arena: &'a Arena,
    pub units: &'a mut Units,
    pub living: &'a mut AliveIds,
    pub neighbour_order: &'a mut NeighbourOrder,
    pub plan: &'a mut Plan,
}

/// What units intend to do in a tick, by battle-wide id; nothing of it outlives the step.
///
/// Entries of dead units are stale.
#[derive(Debug, Default)]
pub(crate) struct Plan {
    /// What each unit is told to do in this step.
    pub commands: Vec<Command>,
    /// Ids in the order of phase 4.
    pub order: Vec<u32>,
    /// The target of each unit before phase 1.
    previous_target: Vec<Option<u32>>,
    /// The position of each unit at the start of the tick, where searches see it.
    start: Vec<Vec2>,
    /// Preferred velocity, of phase 2.
    pub preferred: Vec<Vec2>,
    /// Whom the unit attacks or heals in its turn.
    attack: Vec<Option<u32>>,
    /// Units that were dead when their turn came, and the velocities with which they last moved.
    unmoved: Vec<(u32, Vec2)>,
    target_search: choose::TargetSearch,
    avoid: avoid::Workspace,
}

impl Plan {
    /// Makes room for a battle in this arena, so that whatever happens in it nothing is allocated later.
    pub fn fit(&mut self, arena: &Arena) {
        let n_units = arena.sizes().n_units();
        make_room(&mut self.previous_target, n_units);
        make_room(&mut self.start, n_units);
        make_room(&mut self.unmoved, n_units);
        make_room(&mut self.order, n_units);
        make_room(&mut self.commands, n_units);
        self.target_search.fit(n_units);
        self.avoid.fit(n_units, arena.edges.longest_list());
        self.preferred.resize(n_units, Vec2::ZERO);
        self.attack.resize(n_units, None);
    }
}

/// Plays one tick with the execution order in the plan and returns the reward it earned, unscaled and without
/// the one for winning.
pub(crate) fn run(world: &mut World) -> f64 {
    targets::clean_up(world);
    preferred::declare(world);
    avoid::plan_velocities(world);
    let earned = execute::all(world);
    deaths::take_out(world);
    earned
}
