//! Two players that meet.

use smaclite_engine::Arena;
use std::sync::Arc;

/// A player with the agents against one with the enemies. Players are given by their numbers.
pub struct Pairing {
    /// The player with the agents.
    pub agents: usize,
    /// The player with the enemies.
    pub enemies: usize,
    /// Where they meet.
    pub arena: Arc<Arena>,
    /// The sides of the arena are exchanged: its enemies are the agents of the scenario.
    pub is_exchanged: bool,
}

impl Pairing {
    /// The players with the agents and with the enemies of the arena.
    pub fn seats(&self) -> [usize; 2] {
        if self.is_exchanged { [self.enemies, self.agents] } else { [self.agents, self.enemies] }
    }
}
