//! Everything about a scenario that no battle changes: unit stats, ids, start positions, sizes, obstacle
//! edges and the scale of rewards.
//!
//! It is computed once from a scenario and shared by all its battles.

mod cells;
mod edges;
mod line_choice;
mod moves;
mod partition;
mod unit_stats;

use glam::{DVec2, Vec2};
use serde::{Deserialize, Serialize};
use smaclite_scenarios::{Faction, Placement, Scenario, Terrain};

pub(crate) use cells::{EdgeBlock, EdgeSearch, EdgesByCell};
pub(crate) use edges::Edge;
pub(crate) use unit_stats::{Approach, AvoidanceParams, Matchup, Regeneration, UnitStats};

use crate::fnv::Fnv1a;
use crate::opponents::Opponents;
use crate::rules::Rules;
use crate::{KILL_REWARD, REWARD_SCALE, WIN_REWARD};
use moves::Moves;

/// Everything about a scenario that never changes, under one rule set; shared by `Arc` between battles.
#[derive(Debug)]
pub struct Arena {
    pub(crate) rules: Rules,
    pub(crate) terrain: Terrain,
    /// Battle-wide ids of the agents' units, by in-faction id.
    pub(crate) agents: Vec<u32>,
    /// Battle-wide ids of the enemies, by in-faction id.
    pub(crate) enemies: Vec<u32>,
    pub(crate) starts: Vec<Vec2>,
    pub(crate) attack_point: [f64; 2],
    pub(crate) features: Features,
    pub(crate) edges: EdgesByCell,
    /// The parameters of collision avoidance of each unit, by battle-wide id.
    pub(crate) avoidance: Vec<AvoidanceParams>,
    moves: Moves,
    /// The stats of each unit, by battle-wide id.
    all_stats: Vec<UnitStats>,
    /// What phases 1 and 2 read of each unit, by battle-wide id.
    pub(crate) approaches: Vec<Approach>,
    /// What phase 4 reads of each unit, by battle-wide id.
    pub(crate) regenerations: Vec<Regeneration>,
    /// Whether an agent is a healer, and whether an enemy is.
    pub(crate) agents_heal: bool,
    pub(crate) enemies_heal: bool,
    /// Whether a unit has a shield or energy. Without, both are 0 of all units and remain it.
    pub(crate) has_reserves: bool,
    /// Whether a unit attacks an area, not a target alone.
    pub(crate) has_area_attacks: bool,
    n_types: usize,
    is_enemy: Vec<bool>,
    id_in_faction: Vec<usize>,
    /// What each type can do to each other, in rows by the attacker's type.
    matchups: Vec<Matchup>,
    /// The largest radius of all units in the scenario.
    pub(crate) largest_radius: f64,
    sizes: Sizes,
    n_enemy_actions: usize,
    max_reward: f64,
    episode_limit: Option<u32>,
    opponents: Opponents,
    scenario_hash: u64,
}

/// The numbers of units and actions of a battle, and the sizes of its outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
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
}

impl Sizes {
    /// Agents and enemies.
    pub fn n_units(&self) -> usize {
        self.n_agents + self.n_enemies
    }
}

/// Which optional features observations and state have, and the values that scale positions.
#[derive(Clone, Debug)]
pub(crate) struct Features {
    pub ally_shields: bool,
    pub enemy_shields: bool,
    /// Length of the one-hot of unit types; 0 for none.
    pub n_types: usize,
    /// Position in that one-hot, by battle-wide id.
    pub type_of: Vec<usize>,
    pub width: f64,
    pub height: f64,
}

impl Arena {
    /// Prepares a scenario. The episode limit is the scenario's.
    pub fn new(scenario: &Scenario, rules: Rules) -> Arena {
        let units = &scenario.units;
        let types = &scenario.unit_types;
        let largest_radius = units.iter().map(|unit| types[unit.unit_type].radius()).fold(0.0, f64::max);
        let all_stats: Vec<UnitStats> =
            units.iter().map(|unit| UnitStats::new(&types[unit.unit_type], largest_radius)).collect();
        let matchups =
            types.iter().flat_map(|attacker| types.iter().map(move |victim| Matchup::new(attacker, victim)));
        let features = Features::new(scenario);
        let (agents, enemies) = (ids_of(scenario, Faction::Ally), ids_of(scenario, Faction::Enemy));
        let heal = |ids: &[u32]| ids.iter().any(|&id| all_stats[id as usize].is_healer);
        Arena {
            rules,
            terrain: scenario.terrain.clone(),
            agents_heal: heal(&agents),
            enemies_heal: heal(&enemies),
            has_reserves: all_stats.iter().any(|stats| stats.shield > 0.0 || stats.energy > 0.0),
            has_area_attacks: all_stats.iter().any(UnitStats::attacks_an_area),
            // Battles compute positions in f32 from the start on.
            starts: units.iter().map(|unit| Vec2::from(unit.position.map(|x| x as f32))).collect(),
            attack_point: scenario.attack_point,
            edges: edges_in_sight(&scenario.terrain, &all_stats),
            approaches: approaches(scenario, &agents, &all_stats),
            regenerations: all_stats.iter().map(Regeneration::new).collect(),
            moves: Moves::new(&scenario.terrain),
            n_types: types.len(),
            is_enemy: units.iter().map(|unit| unit.faction == Faction::Enemy).collect(),
            id_in_faction: units.iter().map(|unit| unit.id_in_faction).collect(),
            matchups: matchups.collect(),
            largest_radius,
            sizes: sizes(scenario, &features),
            n_enemy_actions: n_actions(scenario, Faction::Enemy),
            features,
            avoidance: all_stats.iter().map(|stats| stats.avoid).collect(),
            max_reward: max_reward(scenario, &enemies),
            agents,
            enemies,
            all_stats,
            episode_limit: scenario.episode_limit,
            opponents: Opponents::default(),
            scenario_hash: scenario_hash(scenario, rules),
        }
    }

    /// The numbers of units and actions of a battle, and the sizes of its outputs.
    pub fn sizes(&self) -> Sizes {
        self.sizes
    }

    /// The rule set.
    pub fn rules(&self) -> Rules {
        self.rules
    }

    /// The number of steps after which an episode is truncated, if any.
    pub fn episode_limit(&self) -> Option<u32> {
        self.episode_limit
    }

    /// Equal for equal scenarios, unit types and rule sets, on every machine. Snapshots have it.
    pub fn scenario_hash(&self) -> u64 {
        self.scenario_hash
    }

    /// The same arena with another episode limit, or none.
    pub fn with_episode_limit(self, episode_limit: Option<u32>) -> Arena {
        Arena { episode_limit, ..self }
    }

    /// Who plays the enemies.
    pub fn opponents(&self) -> &Opponents {
        &self.opponents
    }

    /// The same arena with other opponents.
    pub fn with_opponents(self, opponents: Opponents) -> Arena {
        Arena { opponents, ..self }
    }

    /// The unscaled return of a win without enemy regeneration: all health and shields of the enemies, a
    /// reward per kill, and the reward for winning. It is scaled to a return of 20.
    pub fn max_reward(&self) -> f64 {
        self.max_reward
    }

    /// Scales the reward of a step, so that a return of [`max_reward`](Self::max_reward) becomes 20.
    pub(crate) fn scale_reward(&self, earned: f64) -> f64 {
        // Two divisions, as in the published environment: the last bit depends on it.
        earned / (self.max_reward / REWARD_SCALE)
    }

    /// The battle-wide ids of a faction's units, by in-faction id.
    pub(crate) fn ids(&self, faction: Faction) -> &[u32] {
        match faction {
            Faction::Ally => &self.agents,
            Faction::Enemy => &self.enemies,
        }
    }

    /// The units that the target actions of a unit mean, by in-faction id: those that it heals or attacks.
    pub(crate) fn targets_of(&self, id: u32) -> &[u32] {
        let own = if self.is_enemy(id) { Faction::Enemy } else { Faction::Ally };
        self.ids(if self.stats(id).is_healer { own } else { own.opponent() })
    }

    /// Actions of a unit of a faction, available or not.
    pub(crate) fn n_actions(&self, faction: Faction) -> usize {
        match faction {
            Faction::Ally => self.sizes.n_actions,
            Faction::Enemy => self.n_enemy_actions,
        }
    }

    /// The battle-wide ids of all units.
    pub(crate) fn unit_ids(&self) -> impl Iterator<Item = u32> + use<> {
        0..self.all_stats.len() as u32
    }

    /// The stats of a unit, by battle-wide id.
    pub(crate) fn stats(&self, id: u32) -> &UnitStats {
        &self.all_stats[id as usize]
    }

    /// Whether a unit is an enemy, by battle-wide id.
    pub(crate) fn is_enemy(&self, id: u32) -> bool {
        self.is_enemy[id as usize]
    }

    /// The number of a unit in its faction, by battle-wide id.
    pub(crate) fn id_in_faction(&self, id: u32) -> usize {
        self.id_in_faction[id as usize]
    }

    /// The moves that are available to a unit at a position, in the order of their actions from the lowest
    /// bit on.
    pub(crate) fn moves(&self, position: Vec2) -> u8 {
        self.moves.from(&self.terrain, position)
    }

    /// Whether the attacker can attack the plane of the victim; of healers: whether it can heal it.
    pub(crate) fn can_attack(&self, attacker: u32, victim: u32) -> bool {
        self.matchup(attacker, victim).can_attack
    }

    /// What a unit can do to another.
    pub(crate) fn matchup(&self, attacker: u32, victim: u32) -> &Matchup {
        self.matchup_of(&self.approaches[attacker as usize], &self.approaches[victim as usize])
    }

    /// What a unit of one type can do to a unit of another.
    pub(crate) fn matchup_of(&self, attacker: &Approach, victim: &Approach) -> &Matchup {
        &self.matchups[attacker.unit_type as usize * self.n_types + victim.unit_type as usize]
    }
}

impl Features {
    fn new(scenario: &Scenario) -> Features {
        let type_of = |unit_type: usize| scenario.type_ids.get(unit_type).copied().unwrap_or(0);
        Features {
            ally_shields: scenario.ally_has_shields,
            enemy_shields: scenario.enemy_has_shields,
            n_types: scenario.num_unit_types,
            type_of: scenario.units.iter().map(|unit| type_of(unit.unit_type)).collect(),
            width: f64::from(scenario.terrain.width()),
            height: f64::from(scenario.terrain.height()),
        }
    }

    /// Whether shields of a faction are features.
    pub fn has_shield(&self, is_enemy: bool) -> bool {
        if is_enemy { self.enemy_shields } else { self.ally_shields }
    }

    /// A position relative to the centre of the map, in shares of its sides: -0.5 to 0.5.
    pub fn relative(&self, position: Vec2) -> [f32; 2] {
        let position = position.as_dvec2();
        let x = (position.x - self.width / 2.0) / self.width;
        let y = (position.y - self.height / 2.0) / self.height;
        [x as f32, y as f32]
    }

    /// The position of a [relative](Self::relative) one, up to rounding: less than 1e-6 squares in maps of up
    /// to 32 squares.
    pub fn position(&self, relative: [f32; 2]) -> Vec2 {
        let [x, y] = relative.map(f64::from);
        let squares = DVec2::new(x * self.width + self.width / 2.0, y * self.height + self.height / 2.0);
        squares.as_vec2()
    }

    /// Floats that describe an ally's health, shield and type.
    pub fn ally_body(&self) -> usize {
        1 + usize::from(self.ally_shields) + self.n_types
    }

    /// Floats that describe an enemy's health, shield and type.
    pub fn enemy_body(&self) -> usize {
        1 + usize::from(self.enemy_shields) + self.n_types
    }
}

/// The edges that units see.
fn edges_in_sight(terrain: &Terrain, all_stats: &[UnitStats]) -> EdgesByCell {
    // One index of edges serves all units, so it reaches as far as the unit that sees farthest.
    let ranges_squared = all_stats.iter().filter_map(|stats| stats.avoid.edge_range_squared);
    EdgesByCell::new(terrain, f64::from(ranges_squared.fold(0.0, f32::max)).sqrt())
}

/// What phases 1 and 2 read of each unit.
fn approaches(scenario: &Scenario, agents: &[u32], all_stats: &[UnitStats]) -> Vec<Approach> {
    let healers = || agents.iter().map(|&id| &all_stats[id as usize]).filter(|stats| stats.is_healer);
    let approach = |(unit, stats): (&Placement, _)| {
        let attacks = |healer: &UnitStats| scenario.unit_types[unit.unit_type].can_attack(healer.plane);
        Approach::new(unit.unit_type as u32, stats, healers().any(attacks))
    };
    scenario.units.iter().zip(all_stats).map(approach).collect()
}

/// The unscaled return of a win without enemy regeneration.
fn max_reward(scenario: &Scenario, enemies: &[u32]) -> f64 {
    let total = |id: &u32| {
        let unit_type = &scenario.unit_types[scenario.units[*id as usize].unit_type];
        unit_type.hp + unit_type.shield
    };
    // The first two terms are exact, so only the order of the sum of health decides the last bit: it is by
    // enemy id.
    KILL_REWARD * enemies.len() as f64 + WIN_REWARD + enemies.iter().map(total).sum::<f64>()
}

fn ids_of(scenario: &Scenario, faction: Faction) -> Vec<u32> {
    let units = scenario.units.iter().zip(0u32..);
    // Agent i is the ally with in-faction id i, in whatever order the scenario lists its units.
    let mut ids: Vec<(usize, u32)> = units
        .filter(|(unit, _)| unit.faction == faction)
        .map(|(unit, id)| (unit.id_in_faction, id))
        .collect();
    ids.sort_unstable();
    ids.into_iter().map(|(_, id)| id).collect()
}

/// Hashes the text of everything that the scenario consists of: numbers are written so that no two are equal.
fn scenario_hash(scenario: &Scenario, rules: Rules) -> u64 {
    let mut hash = Fnv1a::default();
    hash.write(format!("{scenario:?} {rules}").as_bytes());
    hash.finish()
}

fn sizes(scenario: &Scenario, features: &Features) -> Sizes {
    let (n_agents, n_enemies) = (scenario.n_agents(), scenario.n_enemies());
    let n_actions = n_actions(scenario, Faction::Ally);
    let (ally, enemy) = (features.ally_body(), features.enemy_body());
    Sizes {
        n_agents,
        n_enemies,
        n_actions,
        // The terms are those of `Battle::write_obs` and `Battle::write_state`, in their order.
        obs_size: 4 + n_enemies * (4 + enemy) + n_agents.saturating_sub(1) * (4 + ally) + ally,
        state_size: n_agents * (3 + ally + n_actions) + n_enemies * (2 + enemy),
    }
}

/// Actions of a unit of a faction, available or not.
pub(crate) fn n_actions(scenario: &Scenario, faction: Faction) -> usize {
    crate::action::FIRST_TARGET + n_targets(scenario, faction)
}

/// Number of target actions: enough for every opponent, and if a unit of the faction is a healer for all that
/// it can heal.
fn n_targets(scenario: &Scenario, faction: Faction) -> usize {
    let of = |faction| scenario.units.iter().filter(move |unit| unit.faction == faction);
    // A target action is numbered by in-faction id, so the last unit that can be healed decides.
    let heals = |unit_type: usize| scenario.unit_types[unit_type].is_healer();
    let healable = of(faction).filter(|unit| !heals(unit.unit_type)).map(|unit| unit.id_in_faction + 1).max();
    let n_opponents = of(faction.opponent()).count();
    match healable {
        Some(healable) if of(faction).any(|unit| heals(unit.unit_type)) => healable.max(n_opponents),
        _ => n_opponents,
    }
}
