//! One tick, 1/16 s of a battle, in five phases; [`run`] lists them.
//!
//! Every phase processes all living units before the next phase begins, and its results are those of
//! ascending battle-wide ids. Only phase 4 has another order, the execution order, which is an input of the
//! tick.

mod avoid;
mod deaths;
mod execute;
mod preferred;
pub(crate) mod starcraft;
mod target_choice;
mod targeters;
mod targets;

use glam::Vec2;
use smaclite_scenarios::Faction;

use crate::arena::Arena;
use crate::buffers::clear_and_reserve;
use crate::command::Command;
use crate::neighbour_order::NeighbourOrder;
use crate::simd::Level;
use crate::units::{AliveIds, Units};

/// The parts of a battle that a tick reads and changes.
pub(crate) struct World<'a> {
    pub arena: &'a Arena,
    pub units: &'a mut Units,
    pub alive_ids: &'a mut AliveIds,
    pub neighbour_order: &'a mut NeighbourOrder,
    pub scratch: &'a mut TickScratch,
}

/// What the sides earn, unscaled and without the reward for winning.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Earned {
    pub allies: f64,
    pub enemies: f64,
}

impl Earned {
    pub fn add(&mut self, side: Faction, amount: f64) {
        match side {
            Faction::Ally => self.allies += amount,
            Faction::Enemy => self.enemies += amount,
        }
    }
}

/// Plays one tick with the execution order in the scratch. Returns what it earns.
pub(crate) fn run(world: &mut World) -> Earned {
    targets::drop_lost(world);
    preferred::decide(world);
    avoid::plan_velocities(world);
    let earned = execute::take_turns(world);
    deaths::remove_dead(world);
    world.scratch.is_first_tick = false;
    earned
}

/// Removes the units without health between two ticks.
pub(crate) fn remove_all_dead(world: &mut World) {
    world.scratch.may_have_dead = true;
    deaths::remove_dead(world);
}

/// Working memory of a tick: what units intend to do, by battle-wide id. Nothing of it outlives the step.
///
/// Entries of dead units are stale.
#[derive(Debug, Default)]
pub(crate) struct TickScratch {
    /// The widest instruction set of the processor.
    level: Level,
    /// The command of each unit for this step; those of dead units are stale.
    commands: Vec<Command>,
    // The living units by their command, but those that stop.
    /// Those that move to a point, and that point.
    moving: Vec<(u32, [f64; 2])>,
    /// Those with a target command, and that target.
    targeting: Vec<(u32, u32)>,
    /// Those that attack-move, by ascending id. Only enemies do.
    attack_moving: Vec<u32>,
    /// Whether this is the first tick with these commands.
    is_first_tick: bool,
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
    /// Under rules `starcraft`, the units that have exploded in this tick.
    exploded: Vec<u32>,
    /// Under rules `starcraft`, what each unit does in this tick.
    postures: Vec<starcraft::Posture>,
    /// Under rules `starcraft`, the units that stand in this tick and those that walk, by plane.
    standing: [starcraft::Crowd; 3],
    walking: [starcraft::Crowd; 3],
    /// Under rules `starcraft`, those that stand near one unit.
    near: starcraft::Near,
    /// Under rules `starcraft`, whether a unit may have hits in flight; stale in the first tick of a step.
    may_have_hits: bool,
    /// Under rules `starcraft`, the units that choose a target in this tick, and how many units attack each.
    choosers: Vec<starcraft::Chooser>,
    attackers: Vec<i32>,
    /// Under rules `starcraft`, health and shield of each unit before the hits of this tick.
    vitality: Vec<f64>,
    /// The units of each faction that were killed in this step, also those that were healed to life then.
    pub killed: [u32; 2],
    /// What the hits of each unit earned in this step; empty unless the battle wants to know it.
    pub credits: Vec<f64>,
    /// Health and shield of each unit at the start of the step; stale unless losses count.
    pub before: Vec<f64>,
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
        self.is_first_tick = true;
        self.killed = [0; 2];
        self.credits.clear();
        self.commands.resize(sizes.0, Command::Stop);
        self.moving.clear();
        self.targeting.clear();
        self.attack_moving.clear();
    }

    /// Sets the command of a living unit. Those that attack-move come by ascending id.
    #[inline]
    pub fn command(&mut self, id: u32, command: Command) {
        self.commands[id as usize] = command;
        match command {
            Command::Stop => {}
            Command::MoveTo(destination) => self.moving.push((id, destination)),
            Command::Target(target) => self.targeting.push((id, target)),
            Command::AttackMove(_) => self.attack_moving.push(id),
        }
    }

    /// Removes units that are no longer alive from those that follow commands.
    fn remove_dead(&mut self, alive: &[bool]) {
        self.moving.retain(|(id, _)| alive[*id as usize]);
        self.targeting.retain(|(id, _)| alive[*id as usize]);
        self.attack_moving.retain(|id| alive[*id as usize]);
    }

    /// Reserves memory for battles of `n_units` units, each of which sees at most `n_edges` edges.
    #[cold]
    fn reserve(&mut self, n_units: usize, n_edges: usize) {
        clear_and_reserve(&mut self.previous_target, n_units);
        clear_and_reserve(&mut self.start, n_units);
        clear_and_reserve(&mut self.unmoved, n_units);
        clear_and_reserve(&mut self.order, n_units);
        clear_and_reserve(&mut self.exploded, n_units);
        clear_and_reserve(&mut self.choosers, n_units);
        clear_and_reserve(&mut self.attackers, n_units + 1);
        self.vitality.resize(n_units, 0.0);
        self.postures.resize(n_units, starcraft::Posture::default());
        self.standing.iter_mut().chain(&mut self.walking).for_each(|crowd| crowd.reserve(n_units));
        self.near.reserve(n_units);
        clear_and_reserve(&mut self.credits, n_units);
        clear_and_reserve(&mut self.before, n_units);
        clear_and_reserve(&mut self.commands, n_units);
        clear_and_reserve(&mut self.moving, n_units);
        clear_and_reserve(&mut self.targeting, n_units);
        clear_and_reserve(&mut self.attack_moving, n_units);
        self.target_choice.reserve(n_units);
        self.avoid.reserve(n_units, n_edges);
        self.preferred.resize(n_units, Vec2::ZERO);
        self.attack.resize(n_units, None);
    }
}
