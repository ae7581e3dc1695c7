//! The numbers of units and actions of an environment, and the sizes of its outputs.

use serde::{Deserialize, Serialize};
use smaclite_scenarios::Faction;

/// The numbers of units and actions of a battle, and the sizes of its outputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sizes {
    /// Agents, which are the allied units.
    pub n_agents: usize,
    /// Enemies.
    pub n_enemies: usize,
    /// Actions of an agent: no-op, stop, four moves, and one for each unit that can be targeted.
    pub n_actions: usize,
    /// Floats in the observation of one agent.
    pub obs_size: usize,
    /// Floats in the state.
    pub state_size: usize,
    /// Entries of a snapshot's column `perception`; 0 without SMACv2's interface.
    #[serde(default)]
    pub perception_size: usize,
    /// Units with phases in a snapshot: all under rules `starcraft`, else 0.
    #[serde(default)]
    pub n_phases: usize,
    /// What differs for the enemies, if joint actions play them too.
    pub enemies: Option<EnemySizes>,
}

/// The sizes that differ for the enemies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EnemySizes {
    /// Actions of an enemy.
    pub n_actions: usize,
    /// Floats in the observation of one enemy.
    pub obs_size: usize,
    /// Floats in the state of the enemies.
    pub state_size: usize,
}

impl Sizes {
    /// Numbers of a joint action: one per agent, and if it plays both sides then one per enemy.
    pub fn n_actors(&self) -> usize {
        self.n_agents + if self.enemies.is_some() { self.n_enemies } else { 0 }
    }

    /// The sizes as the units of a side have them: for the enemies, their own number is `n_agents`. `None` if
    /// joint actions do not play that side.
    pub fn of(&self, side: Faction) -> Option<Sizes> {
        let Sizes { n_agents, n_enemies, .. } = *self;
        match side {
            Faction::Ally => Some(*self),
            Faction::Enemy => self.enemies.map(|EnemySizes { n_actions, obs_size, state_size }| Sizes {
                n_agents: n_enemies,
                n_enemies: n_agents,
                n_actions,
                obs_size,
                state_size,
                perception_size: self.perception_size,
                n_phases: self.n_phases,
                enemies: None,
            }),
        }
    }

    /// Agents and enemies.
    pub fn n_units(&self) -> usize {
        self.n_agents + self.n_enemies
    }
}
