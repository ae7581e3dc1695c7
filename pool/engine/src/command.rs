//! Actions of agents, and the commands that units carry through a step.

use glam::Vec2;
use thiserror::Error;

/// The actions of an agent by number.
pub mod action {
    /// Only for the dead, and all they can do.
    pub const NO_OP: usize = 0;
    /// Stay.
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
}

/// How far a move goes, in squares.
const MOVE: f64 = 2.0;

/// The directions of the four moves, in the order of their actions.
pub(crate) const DIRECTIONS: [[f64; 2]; 4] = [[0.0, 1.0], [0.0, -1.0], [1.0, 0.0], [-1.0, 0.0]];

/// What a unit is told to do for the eight ticks of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Command {
    /// No-op and stop.
    Stop,
    /// Go to a point.
    MoveTo([f64; 2]),
    /// Attack or heal a unit, by battle-wide id.
    Target(u32),
    /// March to the scenario's attack point and attack who comes near; heal, for healers.
    AttackMove,
}

impl Command {
    /// The command that an action is for a unit at `position`; `targets` are the units that its target
    /// actions mean, by in-faction id.
    pub fn from_action(action: usize, position: Vec2, targets: &[u32]) -> Command {
        match action {
            action::NORTH..action::FIRST_TARGET => {
                let [x, y] = DIRECTIONS[action - action::NORTH];
                Command::MoveTo([f64::from(position.x) + MOVE * x, f64::from(position.y) + MOVE * y])
            }
            action::FIRST_TARGET.. => {
                targets.get(action - action::FIRST_TARGET).map_or(Command::Stop, |&id| Command::Target(id))
            }
            _ => Command::Stop,
        }
    }
}

/// Why a joint action was refused; nothing was stepped.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum IllegalAction {
    /// Not one action for each agent.
    #[error("{given} actions for {n_agents} agents: give one for each, and 0 (no-op) for the dead")]
    WrongCount {
        /// How many were given.
        given: usize,
        /// How many there should be.
        n_agents: usize,
    },
    /// No action has that number.
    #[error("agent {agent}: there is no action {action}; actions are 0 to {last}", last = n_actions - 1)]
    OutOfRange {
        /// The agent.
        agent: usize,
        /// The action.
        action: i32,
        /// How many actions there are.
        n_actions: usize,
    },
    /// The agent cannot do that now.
    #[error("agent {agent}: action {action} is not available now; its available actions are {available:?}")]
    Unavailable {
        /// The agent.
        agent: usize,
        /// The action.
        action: i32,
        /// What it can do.
        available: Vec<usize>,
    },
}
