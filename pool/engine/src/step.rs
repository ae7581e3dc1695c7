//! The outcome of a step, its execution orders, and what an observer of its ticks receives.

use glam::Vec2;

use crate::TICKS_PER_STEP;
use crate::units::Units;

/// The outcome of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// The common reward of all agents, by the [rewards](crate::Rewards) of the scenario: unless it says
    /// otherwise, scaled so that a win over enemies that neither regenerate nor blow themselves up gives 20.
    pub reward: f64,
    /// The common reward of all enemies by the same formula: what they do to the agents, and more if no agent
    /// is alive.
    pub enemy_reward: f64,
    /// No unit of a faction is alive.
    pub terminated: bool,
    /// The episode limit is reached, and both factions have living units.
    pub truncated: bool,
    /// No enemy is alive. An episode that is truncated is never won, however few enemies are left.
    pub battle_won: bool,
}

/// The order in which units move and act in phase 4 of each tick.
#[derive(Clone, Copy, Debug)]
pub enum ExecutionOrder<'a> {
    /// Drawn from the battle's generator: a shuffle of the living units in every tick.
    Drawn,
    /// Battle-wide ids in order, tick by tick, as recorded. A unit that is not listed does not act; ids of
    /// dead or unknown units are ignored. The generator is not used.
    Given(&'a [&'a [u32]; TICKS_PER_STEP]),
}

/// A battle after a tick, for comparisons with recordings.
#[derive(Clone, Copy, Debug)]
pub struct Tick<'a> {
    /// Index of the tick in its step, from 0.
    pub index: usize,
    /// The execution order: battle-wide ids in the order of phase 4.
    pub order: &'a [u32],
    /// The units after the tick.
    pub units: &'a Units,
    /// The preferred velocity of each unit that was alive when the tick began, by battle-wide id.
    pub preferred: &'a [Vec2],
    /// The agents' reward of the tick, unscaled and without that for winning.
    pub earned: f64,
}
