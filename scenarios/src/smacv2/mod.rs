//! The options of SMACv2's interface: what agents observe, may do and are rewarded for.
//!
//! A scenario with these options is SMACv2's task under SMAClite's rules: battles are SMAClite's, and what
//! SMACv2's Python code computes from the units is what that code computes.

mod keys;

pub(crate) use keys::{SMACV2_KEYS, read};

use crate::Rewards;
use serde::{Deserialize, Serialize};

/// The options of SMACv2's environment that concern the agents, with its names and defaults.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Smacv2 {
    /// Sight and targeting ranges are those of the unit type, instead of 9 and 6 squares.
    pub use_unit_ranges: bool,
    /// The least targeting range, in squares, where unit types have their own.
    pub min_attack_range: f64,
    /// Agents see only what is in a cone, which look actions turn.
    pub conic_fov: bool,
    /// The number of look actions; a cone is 2 pi divided by it wide.
    pub num_fov_actions: u32,
    /// The probability that another agent than the first seer of an enemy sees it, too.
    pub prob_obs_enemy: f64,
    /// Targets out of range are not available. Otherwise an action on them sends no order.
    pub action_mask: bool,
    /// Observations show all living units.
    pub fully_observable: bool,
    /// Observations have the health and shields of others.
    pub obs_all_health: bool,
    /// Observations have the agent's own health and shield.
    pub obs_own_health: bool,
    /// Observations have the last actions of visible allies.
    pub obs_last_action: bool,
    /// Observations have whether eight points around the agent are walkable.
    pub obs_pathing_grid: bool,
    /// Observations have the height of the terrain at nine points around the agent.
    pub obs_terrain_height: bool,
    /// Observations have the agent's own position.
    pub obs_own_pos: bool,
    /// Observations have the share of the episode limit that is over.
    pub obs_timestep_number: bool,
    /// Observations have what agents see; otherwise only the time, for open-loop experiments.
    pub obs_starcraft: bool,
    /// The state is all observations.
    pub obs_instead_of_state: bool,
    /// The state has the last actions.
    pub state_last_action: bool,
    /// The state has the share of the episode limit that is over.
    pub state_timestep_number: bool,
    /// The types of allies are shown in observations.
    pub observe_team: bool,
    /// Length of a move, in squares.
    pub move_amount: f64,
    /// With health levels: how many ticks before the end of a step units below their level are killed.
    pub kill_unit_step_mul: u32,
    /// What agents are rewarded for.
    #[serde(flatten)]
    pub rewards: Rewards,
    /// Enemies whose health, shield and type an agent is not shown, drawn for each episode.
    pub enemy_mask: Option<EnemyMask>,
    /// The probability that an attack or heal order of an agent succeeds, drawn for each episode.
    pub attack: Option<Capability>,
    /// The share of its health below which an agent dies, drawn for each episode.
    pub health: Option<Capability>,
    /// The faults of the published code are reproduced.
    pub published: bool,
}

/// Enemies that are masked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnemyMask {
    /// The probability that an agent is shown everything of an enemy; SMACv2's name for it.
    pub mask_probability: f64,
}

/// A number of each agent, uniform between two bounds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Capability {
    /// The least value.
    pub lower_bound: f64,
    /// The greatest value.
    pub upper_bound: f64,
    /// Whether agents are shown the values of their allies.
    pub observe: bool,
}

impl Default for Smacv2 {
    fn default() -> Smacv2 {
        Smacv2 {
            use_unit_ranges: false,
            min_attack_range: 2.0,
            conic_fov: false,
            num_fov_actions: 12,
            prob_obs_enemy: 1.0,
            action_mask: true,
            fully_observable: false,
            obs_all_health: true,
            obs_own_health: true,
            obs_last_action: false,
            obs_pathing_grid: false,
            obs_terrain_height: false,
            obs_own_pos: false,
            obs_timestep_number: false,
            obs_starcraft: true,
            obs_instead_of_state: false,
            state_last_action: true,
            state_timestep_number: false,
            observe_team: true,
            move_amount: 2.0,
            kill_unit_step_mul: 2,
            rewards: Rewards::DEFAULT,
            enemy_mask: None,
            attack: None,
            health: None,
            published: false,
        }
    }
}
