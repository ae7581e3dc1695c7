//! The actions of agents, and the commands that units follow during a step.

use glam::Vec2;
use thiserror::Error;

use crate::sides::Actor;

/// The numbers of an agent's actions.
pub mod action {
    /// The only action of a dead agent.
    pub const NO_OP: usize = 0;
    /// Stand still.
    pub const STOP: usize = 1;
    /// Move 2 squares north (+y).
    pub const NORTH: usize = 2;
    /// Move 2 squares south (-y).
    pub const SOUTH: usize = 3;
    /// Move 2 squares east (+x).
    pub const EAST: usize = 4;
    /// Move 2 squares west (-x).
    pub const WEST: usize = 5;
    /// `FIRST_TARGET + i`: attack enemy i; for a healer, heal ally i.
    pub const FIRST_TARGET: usize = 6;

    /// The action that does in the battle what this one does in its reflection.
    pub(crate) const fn mirrored(action: usize) -> usize {
        match action {
            NORTH => SOUTH,
            SOUTH => NORTH,
            EAST => WEST,
            WEST => EAST,
            _ => action,
        }
    }
}

/// Length of a move, in squares.
pub(crate) const MOVE: f64 = 2.0;

/// The directions of the four moves, in the order of their actions.
pub(crate) const DIRECTIONS: [[f64; 2]; 4] = [[0.0, 1.0], [0.0, -1.0], [1.0, 0.0], [-1.0, 0.0]];

/// What a unit does during the eight ticks of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Command {
    /// No-op and stop.
    Stop,
    /// Go to a point.
    MoveTo([f64; 2]),
    /// Attack or heal a unit, by battle-wide id.
    Target(u32),
    /// March to a point and attack opponents in scan range; healers heal.
    AttackMove([f64; 2]),
}

impl Command {
    /// The command of an action of a unit at `position`; `targets` are the units that its target actions
    /// refer to, by in-faction id.
    pub fn from_action(action: usize, position: Vec2, targets: &[u32]) -> Command {
        match action {
            action::NORTH..action::FIRST_TARGET => {
                // The destination is a point, not a direction: a unit that others push aside still walks to
                // it.
                let [x, y] = DIRECTIONS[action - action::NORTH];
                Command::MoveTo([f64::from(position.x) + MOVE * x, f64::from(position.y) + MOVE * y])
            }
            // Healers and damage dealers have equally many target actions, but their targets may be fewer.
            // The surplus actions are never available.
            action::FIRST_TARGET.. => {
                targets.get(action - action::FIRST_TARGET).map_or(Command::Stop, |&id| Command::Target(id))
            }
            _ => Command::Stop,
        }
    }
}

/// Why a joint action was refused; the battle is unchanged.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum IllegalAction {
    /// The number of actions differs from the number of units that they play.
    #[error("expected {expected} actions, one per {units} and 0 (no-op) for dead ones, got {given}")]
    WrongCount {
        /// Number of actions.
        given: usize,
        /// Number of units.
        expected: usize,
        /// `agent`, or `agent and enemy`.
        units: &'static str,
    },
    /// No action has that number.
    #[error("{actor}: actions must be between 0 and {last}, got {action}", last = n_actions - 1)]
    OutOfRange {
        /// The unit.
        actor: Actor,
        /// The action.
        action: i32,
        /// Number of actions of such a unit.
        n_actions: usize,
    },
    /// The action is not available to the unit now.
    #[error("{actor}: action {action} is not available now; its available actions are {available:?}")]
    Unavailable {
        /// The unit.
        actor: Actor,
        /// The action.
        action: i32,
        /// The available actions of the unit.
        available: Vec<usize>,
    },
}
