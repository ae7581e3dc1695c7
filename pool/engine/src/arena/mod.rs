//! Everything about a scenario that no battle changes: unit stats, ids, start positions, sizes, obstacle
//! edges and the scale of rewards.
//!
//! It is computed once from a scenario and shared by all its battles.

mod cells;
mod edges;
mod features;
mod line_choice;
mod lineup;
mod moves;
mod partition;
mod starts;
mod unit_stats;
mod ways;

use std::sync::Arc;

use glam::Vec2;
use smaclite_scenarios::{Destination, Drawer, Faction, Rewards, Scenario, Terrain};
use smaclite_units::{Plane, UnitType};

pub(crate) use cells::{EdgeBlock, EdgeSearch, EdgesByCell};
pub(crate) use edges::Edge;
pub(crate) use features::{Features, n_actions};
pub(crate) use unit_stats::{
    Approach, AvoidanceParams, BodyStats, Matchup, Regeneration, StarcraftStats, UnitStats,
};

use crate::command::action;
use crate::extent::Extent;
use crate::fnv::Fnv1a;
use crate::opponents::{Opponent, Opponents};
use crate::rules::Rules;
use crate::sides::Sides;
use crate::sizes::{EnemySizes, Sizes};
use crate::smacv2::Interface;
use features::sizes;
use moves::Moves;
use ways::Ways;

/// Everything about a scenario that no step changes, under one rule set; shared by `Arc` between battles.
///
/// In a generated scenario the types of the units, and what follows from them, change with every episode:
/// then each battle has an arena of its own, which shares the map and the tables of types with those of
/// others.
#[derive(Clone, Debug)]
pub struct Arena {
    pub(crate) rules: Rules,
    pub(crate) terrain: Arc<Terrain>,
    /// Battle-wide ids of the agents' units, by in-faction id.
    pub(crate) agents: Vec<u32>,
    /// Battle-wide ids of the enemies, by in-faction id.
    pub(crate) enemies: Vec<u32>,
    /// Whether the agents' units come first in the file, so that the id of a unit is its place.
    pub(crate) ids_are_places: bool,
    pub(crate) starts: Vec<Vec2>,
    pub(crate) extent: Extent,
    pub(crate) attack_point: [f64; 2],
    pub(crate) march_to: Option<Destination>,
    pub(crate) features: Features,
    pub(crate) edges: Arc<EdgesByCell>,
    moves: Arc<Moves>,
    /// Of units on the ground under rules `starcraft`, on a map where not all ways are straight.
    ways: Option<Arc<Ways>>,
    /// All types that units can have.
    types: Arc<[UnitType]>,
    /// What each type can do to each other, in rows by the attacker's type.
    matchups: Arc<[Matchup]>,
    /// Draws the units of an episode, if the scenario is generated.
    drawer: Option<Arc<Drawer>>,
    is_enemy: Vec<bool>,
    id_in_faction: Vec<usize>,

    // What follows from the types of the units: `lineup` sets it.
    /// The parameters of collision avoidance of each unit, by battle-wide id.
    pub(crate) avoidance: Vec<AvoidanceParams>,
    /// The stats of each unit, by battle-wide id.
    all_stats: Vec<UnitStats>,
    /// What phases 1 and 2 read of each unit, by battle-wide id.
    pub(crate) approaches: Vec<Approach>,
    /// What phase 4 reads of each unit, by battle-wide id.
    pub(crate) regenerations: Vec<Regeneration>,
    /// What ticks under rules `starcraft` read of each unit, by battle-wide id; empty under the others.
    pub(crate) starcraft_stats: Vec<StarcraftStats>,
    /// Whether an agent is a healer, and whether an enemy is.
    pub(crate) agents_heal: bool,
    pub(crate) enemies_heal: bool,
    /// Whether a unit has a shield or energy. Without, both are 0 of all units and remain it.
    pub(crate) has_reserves: bool,
    /// Whether a unit attacks an area, not a target alone.
    pub(crate) has_area_attacks: bool,
    /// The largest radius of all units in the battle.
    pub(crate) largest_radius: f64,
    /// By faction.
    max_rewards: [f64; 2],
    rewards: Rewards,

    /// What agents observe, may do and are rewarded for, where it is SMACv2's interface.
    interface: Option<Arc<Interface>>,
    sizes: Sizes,
    enemy_sizes: Sizes,
    sides: Sides,
    episode_limit: Option<u32>,
    opponents: Opponents,
    scenario_hash: u64,
}

impl Arena {
    /// Prepares a scenario. The episode limit is the scenario's.
    pub fn new(scenario: &Scenario, rules: Rules) -> Arena {
        let scenario_hash = scenario_hash(scenario, rules);
        let scenario = &*rules.figures(scenario);
        let (units, types) = (&scenario.units, &scenario.unit_types);
        let matchups =
            types.iter().flat_map(|attacker| types.iter().map(move |victim| Matchup::new(attacker, victim)));
        let interface = scenario.smacv2.as_ref();
        let interface = interface.map(|options| Arc::new(Interface::new(scenario, options)));
        let (agents, enemies) = (ids_of(scenario, Faction::Ally), ids_of(scenario, Faction::Enemy));
        let mut arena = Arena {
            rules,
            terrain: Arc::new(scenario.terrain.clone()),
            ids_are_places: agents.iter().chain(&enemies).copied().eq(0..units.len() as u32),
            agents,
            enemies,
            extent: Extent::of(&scenario.terrain),
            starts: starts(scenario, rules),
            attack_point: scenario.attack_point,
            march_to: scenario.march_to.filter(|_| rules == Rules::Starcraft),
            features: Features::new(scenario),
            edges: Arc::new(edges_in_sight(&scenario.terrain, types, rules)),
            moves: Arc::new(Moves::new(&scenario.terrain)),
            ways: ways(scenario, rules),
            matchups: matchups.collect(),
            types: types.as_slice().into(),
            drawer: Drawer::new(scenario).map(Arc::new),
            is_enemy: units.iter().map(|unit| unit.faction == Faction::Enemy).collect(),
            id_in_faction: units.iter().map(|unit| unit.id_in_faction).collect(),
            avoidance: Vec::new(),
            all_stats: Vec::new(),
            approaches: Vec::new(),
            regenerations: Vec::new(),
            starcraft_stats: Vec::new(),
            agents_heal: false,
            enemies_heal: false,
            has_reserves: false,
            has_area_attacks: false,
            largest_radius: 0.0,
            max_rewards: [0.0; 2],
            rewards: scenario.smacv2.as_ref().map_or(scenario.rewards, |options| options.rewards),
            sizes: interface.as_ref().map_or(sizes(scenario, Faction::Ally), |interface| interface.sizes()),
            interface,
            enemy_sizes: sizes(scenario, Faction::Enemy),
            sides: Sides::default(),
            episode_limit: scenario.episode_limit,
            opponents: Opponents::default(),
            scenario_hash,
        };
        if rules == Rules::Starcraft {
            for sizes in [&mut arena.sizes, &mut arena.enemy_sizes] {
                sizes.n_phases = units.len();
            }
        }
        arena.set_types(units.iter().map(|unit| unit.unit_type as u32));
        arena
    }

    /// Where a unit of the scenario begins, in squares, unless its episodes draw that.
    ///
    /// # Panics
    /// If there is no such unit.
    pub fn start(&self, unit: usize) -> [f64; 2] {
        self.starts[unit].as_dvec2().into()
    }

    /// The numbers of units and actions of a battle, and the sizes of its outputs.
    pub fn sizes(&self) -> Sizes {
        self.sizes
    }

    /// The [sizes](Self::sizes) as the units of a faction have them: for the enemies, their own number is
    /// `n_agents`.
    pub fn sizes_of(&self, faction: Faction) -> Sizes {
        match faction {
            Faction::Ally => self.sizes,
            Faction::Enemy => self.enemy_sizes,
        }
    }

    /// Which sides joint actions play.
    pub fn sides(&self) -> Sides {
        self.sides
    }

    /// The same arena with joint actions that play these sides. If they are both, then
    /// [`Opponent::Learner`](crate::Opponent::Learner) is the opponent, until
    /// [others](Self::with_opponents) are set; if they are the agents alone, the default one takes its place.
    pub fn with_sides(self, sides: Sides) -> Arena {
        let Sizes { n_actions, obs_size, state_size, .. } = self.enemy_sizes;
        let enemies = sides.are_both().then_some(EnemySizes { n_actions, obs_size, state_size });
        let sizes = Sizes { enemies, ..self.sizes };
        let opponents = match (sides.are_both(), self.opponents.check(sides)) {
            (true, _) => Opponent::Learner.into(),
            (false, Ok(())) => self.opponents,
            (false, Err(_)) => Opponents::default(),
        };
        Arena { sides, sizes, opponents, ..self }
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

    /// The same arena with another episode limit, at least 1, or none.
    pub fn with_episode_limit(self, episode_limit: Option<u32>) -> Arena {
        let interface = self.interface;
        let interface = interface.map(|it| Arc::new(Interface::clone(&it).with_episode_limit(episode_limit)));
        Arena { episode_limit, interface, ..self }
    }

    /// Who plays the enemies.
    pub fn opponents(&self) -> &Opponents {
        &self.opponents
    }

    /// The same arena with other opponents, of which a learner needs both sides ([`Opponents::check`]).
    pub fn with_opponents(self, opponents: Opponents) -> Arena {
        Arena { opponents, ..self }
    }

    /// The unscaled return of a win over enemies that neither regenerate nor blow themselves up: all health
    /// and shields of the enemies, a reward per kill, and the reward for winning. Unless the scenario says
    /// otherwise, it is scaled to a return of 20.
    pub fn max_reward(&self) -> f64 {
        self.max_reward_of(Faction::Ally)
    }

    /// As [`max_reward`](Self::max_reward), of a faction.
    pub(crate) fn max_reward_of(&self, faction: Faction) -> f64 {
        self.max_rewards[faction as usize]
    }

    /// What both sides are rewarded for; with SMACv2's interface by its options.
    pub fn rewards(&self) -> &Rewards {
        &self.rewards
    }

    /// The battle-wide ids of a faction's units, by in-faction id.
    pub(crate) fn ids(&self, faction: Faction) -> &[u32] {
        match faction {
            Faction::Ally => &self.agents,
            Faction::Enemy => &self.enemies,
        }
    }

    /// SMACv2's interface, if the scenario has its options.
    pub fn interface(&self) -> Option<&Arc<Interface>> {
        self.interface.as_ref()
    }

    /// The number of a unit, agents first, then enemies, each by in-faction id.
    pub(crate) fn place(&self, id: u32) -> usize {
        self.id_in_faction(id) + if self.is_enemy(id) { self.agents.len() } else { 0 }
    }

    /// The battle-wide id of a unit by that number.
    pub(crate) fn id_at(&self, place: usize) -> u32 {
        match place.checked_sub(self.agents.len()) {
            None => self.agents[place],
            Some(enemy) => self.enemies[enemy],
        }
    }

    /// The battle-wide ids of all units by their places: agents and then enemies, by their numbers in their
    /// factions.
    pub(crate) fn ids_by_place(&self) -> impl Iterator<Item = u32> + Clone {
        self.agents.iter().chain(&self.enemies).copied()
    }

    /// The first target action of the units of a side.
    pub fn first_target(&self, side: Faction) -> usize {
        match (&self.interface, side) {
            (Some(interface), Faction::Ally) => interface.first_target(),
            _ => action::FIRST_TARGET,
        }
    }

    /// Whether states have a row for each unit.
    pub(crate) fn states_have_units(&self, side: Faction) -> bool {
        let is_whole = |interface: &Arc<Interface>| !interface.options().obs_instead_of_state;
        side == Faction::Enemy || self.interface.as_ref().is_none_or(is_whole)
    }

    /// The lengths of the rows of own units and of others in a state of a side.
    pub(crate) fn state_rows(&self, side: Faction) -> [usize; 2] {
        if let (Some(interface), Faction::Ally) = (&self.interface, side) {
            return interface.state_rows();
        }
        [3 + self.features.body(side), 2 + self.features.body(side.opponent())]
    }

    /// The units that the target actions of a unit mean, by in-faction id: those that it heals or attacks.
    pub(crate) fn targets_of(&self, id: u32) -> &[u32] {
        let own = self.faction(id);
        self.ids(if self.stats(id).is_healer { own } else { own.opponent() })
    }

    /// Actions of a unit of a faction, available or not.
    pub(crate) fn n_actions(&self, faction: Faction) -> usize {
        self.sizes_of(faction).n_actions
    }

    /// The battle-wide ids of all units.
    pub(crate) fn unit_ids(&self) -> impl Iterator<Item = u32> + use<> {
        0..self.is_enemy.len() as u32
    }

    /// All types that units can have.
    pub(crate) fn types(&self) -> &[UnitType] {
        &self.types
    }

    /// What draws the units of each episode; `None` if they are always the same.
    pub(crate) fn drawer(&self) -> Option<&Arc<Drawer>> {
        self.drawer.as_ref()
    }

    /// The stats of a unit, by battle-wide id.
    pub(crate) fn stats(&self, id: u32) -> &UnitStats {
        &self.all_stats[id as usize]
    }

    /// The faction of a unit, by battle-wide id.
    pub(crate) fn faction(&self, id: u32) -> Faction {
        if self.is_enemy(id) { Faction::Enemy } else { Faction::Ally }
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

    /// Whether a position is on the map and in a wall.
    pub(crate) fn is_wall(&self, position: Vec2) -> bool {
        let [x, y] = position.floor().as_i64vec2().to_array();
        let (width, height) = (i64::from(self.terrain.width()), i64::from(self.terrain.height()));
        (0..width).contains(&x) && (0..height).contains(&y) && !self.terrain.is_walkable(x, y)
    }

    /// Where a unit of a plane at a position walks straight to on its way to a goal: a corner, or the goal.
    pub(crate) fn next_point(&self, plane: Plane, from: Vec2, goal: Vec2) -> Vec2 {
        match &self.ways {
            Some(ways) if plane == Plane::Ground => ways.next(from, goal),
            _ => goal,
        }
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
        &self.matchups[attacker.unit_type as usize * self.types.len() + victim.unit_type as usize]
    }
}

/// The edges that units see.
fn edges_in_sight(terrain: &Terrain, types: &[UnitType], rules: Rules) -> EdgesByCell {
    let range = |unit_type: &UnitType| match rules {
        Rules::Starcraft => StarcraftStats::new(unit_type).wall_range(),
        _ => AvoidanceParams::new(unit_type, 0.0).edge_range_squared.map(|square| f64::from(square).sqrt()),
    };
    // One index of edges serves all units, so it reaches as far as the unit that sees farthest.
    EdgesByCell::new(terrain, types.iter().filter_map(range).fold(0.0, f64::max))
}

fn starts(scenario: &Scenario, rules: Rules) -> Vec<Vec2> {
    match rules {
        Rules::Starcraft => starts::starts(scenario),
        // Battles compute positions in f32 from the start on.
        _ => scenario.units.iter().map(|unit| Vec2::from(unit.position.map(|x| x as f32))).collect(),
    }
}

fn ways(scenario: &Scenario, rules: Rules) -> Option<Arc<Ways>> {
    (rules == Rules::Starcraft).then(|| Ways::new(&scenario.terrain)).flatten().map(Arc::new)
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

/// Hashes the text of everything that the scenario consists of, and the rule set: numbers are written so that
/// no two are equal. Stored snapshots have the hash; a test keeps those of the standard scenarios.
fn scenario_hash(scenario: &Scenario, rules: Rules) -> u64 {
    let mut hash = Fnv1a::default();
    hash.write(format!("{scenario:?} {rules}").as_bytes());
    hash.finish()
}
