//! SMACv2's interface: everything that its Python code computes from the units of a battle, equal to the bit.
//!
//! A scenario with these options is SMACv2's task under SMAClite's rules: battles are SMAClite's; what
//! SMACv2's Python code computes from the units (observations, state, available actions, orders, partial
//! observability, capabilities, rewards and ends) is what that code computes. A test compares it with
//! recordings of that code.
//!
//! An [`Interface`] never changes. What a battle has seen so far is its [`Perception`]; the units at one time
//! are a [`Frame`]. Units are numbered agents first, by their numbers in their factions.
//!
//! Coordinates are f32, as battles and the game have them. Everything is computed in f64 and rounded once.
//!
//! # The faults of the published code
//!
//! By default the intended rules hold. With `published`
//! - an agent that an enemy is hidden from sees no enemy up to that one, and dead enemies are looked at, too;
//! - cones also reach behind the agent, where arctangents do not tell quadrants apart;
//! - the greatest return is that of the enemies of all resets up to the first end of an episode;
//! - the time limit is an end of the battle, not a truncation;
//! - agents die of their health level by the health that they had at the start of the step.

mod avail;
mod features;
mod heuristic;
mod obs;
mod orders;
mod outcome;
mod perception;
mod sight;
mod state;
mod words;

use smaclite_scenarios::{Scenario, Smacv2, Terrain};

pub use heuristic::Choice;
pub use orders::Order;
pub use outcome::Outcome;
pub(crate) use perception::GREATEST_LEVEL;
pub use perception::{Chance, Frame, Perception};
pub use words::WrongWord;
pub(crate) use words::{NO_SEER, POINT};

use crate::agent_ranges;
use crate::sizes::Sizes;

/// The action of the first look direction, or of the first target where there are none.
const FIRST_LOOK: usize = 6;

/// What agents observe, may do and are rewarded for in a scenario.
#[derive(Clone, Debug)]
pub struct Interface {
    options: Smacv2,
    n_agents: usize,
    n_enemies: usize,
    /// The number of look actions.
    n_looks: usize,
    n_actions: usize,
    width: f64,
    height: f64,
    terrain: Terrain,
    /// The height of each square as a share, row y = 0 first; `None` if all are 127 / 255.
    heights: Option<Vec<f64>>,
    kinds: Vec<Kind>,
    n_types: usize,
    ally_shields: bool,
    enemy_shields: bool,
    /// A faction of healers alone has lost.
    can_heal: bool,
    episode_limit: Option<u32>,
    sizes: BlockSizes,
}

/// What the interface needs of a unit type.
#[derive(Clone, Copy, Debug)]
struct Kind {
    sight: f64,
    reach: f64,
    health: f64,
    shield: f64,
    /// The divisor of the cooldown, or of the energy of a healer.
    readiness: f64,
    is_healer: bool,
    /// Place in the one-hot of types.
    bit: usize,
}

/// Floats of the blocks of observations and of the state.
#[derive(Clone, Copy, Debug, Default)]
struct BlockSizes {
    enemy: usize,
    ally: usize,
    obs: usize,
    state_ally: usize,
    state_enemy: usize,
    state: usize,
}

impl Interface {
    /// The interface of a scenario with these options.
    pub fn new(scenario: &Scenario, options: &Smacv2) -> Interface {
        let (n_agents, n_enemies) = (scenario.n_agents(), scenario.n_enemies());
        let n_looks = if options.conic_fov { options.num_fov_actions as usize } else { 0 };
        let can_heal = scenario.unit_types.iter().any(|unit_type| unit_type.is_healer());
        let n_targets = n_enemies.max(if can_heal { n_agents } else { 0 });
        let kinds = (0..scenario.unit_types.len()).map(|index| Kind::new(scenario, options, index));
        let mut interface = Interface {
            options: options.clone(),
            n_agents,
            n_enemies,
            n_looks,
            n_actions: FIRST_LOOK + n_looks + n_targets,
            width: scenario.terrain.width().into(),
            height: scenario.terrain.height().into(),
            terrain: scenario.terrain.clone(),
            heights: scenario.heights.as_ref().map(|all| all.iter().map(|h| f64::from(*h) / 255.0).collect()),
            kinds: kinds.collect(),
            n_types: scenario.num_unit_types,
            ally_shields: scenario.ally_has_shields,
            enemy_shields: scenario.enemy_has_shields,
            can_heal,
            episode_limit: scenario.episode_limit,
            sizes: BlockSizes::default(),
        };
        interface.sizes = interface.block_sizes();
        interface
    }

    fn block_sizes(&self) -> BlockSizes {
        let o = &self.options;
        let (ally_shield, enemy_shield) = (usize::from(self.ally_shields), usize::from(self.enemy_shields));
        let capabilities = usize::from(o.attack.is_some()) + usize::from(o.health.is_some());
        let when = |is_there: bool, size: usize| if is_there { size } else { 0 };
        let (bits, looks) = (self.n_types, when(o.conic_fov, 2));
        let moves = 4 + when(o.obs_pathing_grid, 8) + when(o.obs_terrain_height, 9);
        let enemy = 4 + when(o.obs_all_health, 1 + enemy_shield) + bits;
        let others = when(o.obs_all_health, 1 + ally_shield) + capabilities + bits;
        let ally = 4 + others + when(o.obs_last_action, self.n_actions);
        let own = when(o.obs_own_health || o.obs_all_health, 1 + ally_shield) + capabilities;
        let own = own + when(o.obs_own_pos, 2) + looks + bits;
        let units = moves + self.n_enemies * enemy + self.n_agents.saturating_sub(1) * ally + own;
        let obs = when(o.obs_starcraft, units) + usize::from(o.obs_timestep_number);
        let state_ally = 4 + ally_shield + capabilities + looks + bits;
        let state_enemy = 3 + enemy_shield + bits;
        let actions = when(o.state_last_action, self.n_agents * self.n_actions);
        let rows = self.n_agents * state_ally + self.n_enemies * state_enemy;
        let state = rows + actions + usize::from(o.state_timestep_number);
        let state = if o.obs_instead_of_state { self.n_agents * obs } else { state };
        BlockSizes { enemy, ally, obs, state_ally, state_enemy, state }
    }

    /// The same with the height of each square as a share, row y = 0 first.
    #[must_use]
    pub fn with_heights(self, heights: Vec<f64>) -> Interface {
        Interface { heights: Some(heights), ..self }
    }

    /// The same with another episode limit.
    #[must_use]
    pub fn with_episode_limit(self, episode_limit: Option<u32>) -> Interface {
        Interface { episode_limit, ..self }
    }

    /// The options.
    pub fn options(&self) -> &Smacv2 {
        &self.options
    }

    /// The numbers of units and actions of a battle, and the sizes of its outputs.
    pub fn sizes(&self) -> Sizes {
        Sizes {
            n_agents: self.n_agents,
            n_enemies: self.n_enemies,
            n_actions: self.n_actions,
            obs_size: self.sizes.obs,
            state_size: self.sizes.state,
            perception_size: self.perception_size(),
            n_phases: 0,
            enemies: None,
        }
    }

    /// Agents.
    pub fn n_agents(&self) -> usize {
        self.n_agents
    }

    /// Enemies.
    pub fn n_enemies(&self) -> usize {
        self.n_enemies
    }

    /// Actions of an agent: no-op, stop, four moves, looks, and one for each unit that can be targeted.
    pub fn n_actions(&self) -> usize {
        self.n_actions
    }

    /// The action of the first target.
    pub fn first_target(&self) -> usize {
        FIRST_LOOK + self.n_looks
    }

    /// Floats in the observation of one agent.
    pub fn obs_size(&self) -> usize {
        self.sizes.obs
    }

    /// Floats in the state.
    pub fn state_size(&self) -> usize {
        self.sizes.state
    }

    /// Floats in the state of an agent and of an enemy.
    pub fn state_rows(&self) -> [usize; 2] {
        [self.sizes.state_ally, self.sizes.state_enemy]
    }

    /// Floats of the capabilities of one agent.
    pub fn cap_size(&self) -> usize {
        usize::from(self.options.attack.is_some()) + usize::from(self.options.health.is_some()) + self.n_types
    }

    /// The share of the episode limit that is over; 0 without a limit. A battle that was restored can be
    /// longer than the limit; then all of it is over.
    pub fn time(&self, perception: &Perception) -> f64 {
        self.episode_limit.map_or(0.0, |limit| f64::from(perception.steps.min(limit)) / f64::from(limit))
    }

    fn kind(&self, frame: &Frame, unit: usize) -> &Kind {
        &self.kinds[frame.types[unit] as usize]
    }
}

impl Kind {
    fn new(scenario: &Scenario, options: &Smacv2, index: usize) -> Kind {
        let unit_type = &scenario.unit_types[index];
        let is_healer = unit_type.is_healer();
        let [sight, reach] = agent_ranges(Some(options), unit_type);
        Kind {
            sight,
            reach,
            health: unit_type.hp,
            shield: unit_type.shield,
            readiness: if is_healer { unit_type.energy } else { unit_type.cooldown },
            is_healer,
            bit: scenario.type_ids.get(index).copied().unwrap_or(0),
        }
    }
}

/// A value divided by its maximum; 0 if the maximum is 0.
fn ratio(value: f64, max: f64) -> f64 {
    if max == 0.0 { 0.0 } else { value / max }
}
