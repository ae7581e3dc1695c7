//! One tick, 1/16 s of a battle, in five phases; [`run`] lists them.
//!
//! Every phase processes all living units in ascending battle-wide id before the next phase begins. Only
//! phase 4 has another order, the execution order, which is an input of the tick.

mod avoid;
mod crowd;
mod deaths;
mod execute;
mod preferred;
mod target_choice;
mod targeters;
mod targets;

use glam::Vec2;

pub(crate) use crowd::search_bound;

use crate::arena::Arena;
use crate::command::Command;
use crate::neighbour_order::NeighbourOrder;
use crate::units::{AliveIds, Units, clear_and_reserve};

/// The parts of a battle that a tick reads and changes.
pub(crate) struct World<'a> {
    pub arena: &'a Arena,
    pub units: &'a mut Units,
    pub alive_ids: &'a mut AliveIds,
    pub neighbour_order: &'a mut NeighbourOrder,
    pub scratch: &'a mut TickScratch,
}

/// Plays one tick with the execution order in the scratch. Returns its reward, unscaled and without that for
/// winning.
pub(crate) fn run(world: &mut World) -> f64 {
    targets::drop_lost(world);
    preferred::decide(world);
    avoid::plan_velocities(world);
    let earned = execute::take_turns(world);
    deaths::remove_dead(world);
    earned
}

/// Working memory of a tick: what units intend to do, by battle-wide id. Nothing of it outlives the step.
///
/// Entries of dead units are stale.
#[derive(Debug, Default)]
pub(crate) struct TickScratch {
    /// The command of each unit for this step.
    pub commands: Vec<Command>,
    /// The execution order: ids in the order of phase 4.
    pub order: Vec<u32>,
    /// The target of each unit before phase 1.
    previous_target: Vec<Option<u32>>,
    /// The position of each unit at the start of the tick, which the searches of phase 4 use.
    start: Vec<Vec2>,
    /// Preferred velocity, set in phase 2.
    pub preferred: Vec<Vec2>,
    /// The declared attack or heal: the target that the unit acts on in phase 4.
    attack: Vec<Option<u32>>,
    /// Units that had no health when their turn came, and the velocities with which they last moved.
    unmoved: Vec<(u32, Vec2)>,
    /// The numbers of units and edges that memory is reserved for.
    reserved: (usize, usize),
    /// Whether a unit may be without health: in the first tick of a step, and where one lost its last health.
    may_have_dead: bool,
    target_choice: target_choice::TargetChoiceScratch,
    avoid: avoid::AvoidScratch,
}

impl TickScratch {
    /// Prepares the ticks of a step: they allocate nothing then, in any battle of this arena.
    #[inline]
    pub fn prepare(&mut self, arena: &Arena) {
        let sizes = (arena.sizes().n_units(), arena.edges.longest_list());
        if self.reserved != sizes {
            self.reserve(sizes.0, sizes.1);
            self.reserved = sizes;
        }
        self.may_have_dead = true;
    }

    /// Reserves memory for battles of `n_units` units, each of which sees at most `n_edges` edges.
    #[cold]
    fn reserve(&mut self, n_units: usize, n_edges: usize) {
        clear_and_reserve(&mut self.previous_target, n_units);
        clear_and_reserve(&mut self.start, n_units);
        clear_and_reserve(&mut self.unmoved, n_units);
        clear_and_reserve(&mut self.order, n_units);
        clear_and_reserve(&mut self.commands, n_units);
        self.target_choice.reserve(n_units);
        self.avoid.reserve(n_units, n_edges);
        self.preferred.resize(n_units, Vec2::ZERO);
        self.attack.resize(n_units, None);
    }
}
