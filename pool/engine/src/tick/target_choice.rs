//! The choice of a target by attack-moving units, and the speed of attack-moving healers.
//!
//! - A damage dealer attacks healers first, then the nearest agent; of equally near ones that with the lowest
//!   id ([`Choice::search`]).
//! - A healer (the medivac) heals the unit of its faction with the least health; of equals that with the
//!   lowest id ([`Choice::most_hurt`]).
//!
//! The searches use the positions at the start of the tick (no unit moves before phase 4), and find only
//! units in planes that the searcher can attack. `block_index` narrows them down and says what it guarantees.

use glam::Vec2;

use super::World;
use crate::arena::{Approach, Arena, UnitStats};
use crate::block_index::{BlockIndex, BoundingBox};
use crate::buffers::clear_and_reserve;
use crate::distance::distance_squared;
use crate::rules::Rules;
use crate::units::AliveIds;

/// The distance of a unit that targets the searcher from beyond its search radius: farther than any other.
const FAR_AWAY: f64 = 2e9;

/// Working memory: the state of the battle that all choices of a phase use, computed once per tick.
///
/// Only enemies attack-move, so only agents are candidates; and the targets of agents do not change in this
/// phase.
#[derive(Debug, Default)]
pub(super) struct TargetChoiceScratch {
    /// The living agents that are no healers, and those that are. Both are empty in a tick in which no unit
    /// searches.
    dealers: BlockIndex,
    healers: BlockIndex,
    /// Around all agents of both.
    bounds: BoundingBox,
    /// Which units are the target of an agent, by battle-wide id.
    is_targeted: Vec<bool>,
    /// Whether a living agent is a healer (R1).
    any_agent_heals: bool,
    /// Whether an enemy damage dealer has no target (R3).
    any_enemy_lacks_target: bool,
}

impl TargetChoiceScratch {
    /// Reserves memory for `n_units` units.
    pub fn reserve(&mut self, n_units: usize) {
        self.dealers.reserve(n_units);
        self.healers.reserve(n_units);
        clear_and_reserve(&mut self.is_targeted, n_units);
    }
}

/// Prepares the choices of this tick.
#[inline(never)]
pub(super) fn prepare(world: &mut World) {
    let World { arena, units, alive_ids, scratch, .. } = world;
    let AliveIds { allies, enemies, .. } = &**alive_ids;
    let is_healer = |&id: &u32| arena.approaches[id as usize].is_healer;
    let lacks_target = |&id: &u32| units.target[id as usize].is_none();
    let TargetChoiceScratch {
        dealers,
        healers,
        bounds,
        is_targeted,
        any_agent_heals,
        any_enemy_lacks_target,
    } = &mut scratch.target_choice;
    *any_agent_heals = arena.agents_heal && allies.iter().any(is_healer);
    *any_enemy_lacks_target =
        arena.enemies_heal && enemies.iter().any(|id| lacks_target(id) && !is_healer(id));
    let is_idle = scratch.attack_moving.is_empty();
    if is_idle || !*any_agent_heals && !enemies.iter().any(lacks_target) {
        return;
    }
    if *any_agent_heals {
        dealers.fill(allies, |id| !is_healer(id), &units.pos);
        healers.fill(allies, is_healer, &units.pos);
    } else {
        dealers.fill(allies, |_| true, &units.pos);
        healers.clear();
    }
    *bounds = dealers.bounds().and(&healers.bounds());
    is_targeted.clear();
    is_targeted.resize(units.pos.len(), false);
    for target in allies.iter().filter_map(|&id| units.target[id as usize]) {
        is_targeted[target as usize] = true;
    }
}

/// What choices read, besides the targets, which they change one after another.
pub(super) struct Choice<'a> {
    pub arena: &'a Arena,
    pub alive_ids: &'a AliveIds,
    pub pos: &'a [Vec2],
    pub hp: &'a [f64],
    pub scratch: &'a TargetChoiceScratch,
}

impl Choice<'_> {
    /// The target that an attack-moving unit has after this phase.
    #[inline(always)]
    pub fn target(&self, targets: &[Option<u32>], id: u32, own: &Approach) -> Option<u32> {
        let current = targets[id as usize];
        // While no agent is a healer, every unit keeps the target that it has.
        if current.is_some() && !self.scratch.any_agent_heals {
            return current;
        }
        if own.is_healer {
            return current.or_else(|| self.most_hurt(targets, id));
        }
        // Most units without a target are far from all agents.
        let scratch = self.scratch;
        let is_far = scratch.bounds.distance_squared(self.pos[id as usize]) > own.search_bound;
        if is_far && !scratch.is_targeted[id as usize] { current } else { self.search(targets, id, own) }
    }

    /// The target of a damage dealer after this phase.
    #[inline(always)]
    fn search(&self, targets: &[Option<u32>], id: u32, own: &Approach) -> Option<u32> {
        let TargetChoiceScratch { dealers, healers, any_agent_heals, .. } = self.scratch;
        let current = targets[id as usize];
        let best_of = |index| self.best_of(index, targets, id, own);
        // Damage dealers keep a target that is a healer.
        if current.is_some_and(|target| self.arena.approaches[target as usize].is_healer) {
            return current;
        }
        if *any_agent_heals
            && own.attacks_healers
            && let Some(healer) = best_of(healers)
        {
            return Some(healer);
        }
        // Rule R1: whether a unit leaves a target for another one that is not a healer either.
        match current {
            Some(_) if self.arena.rules == Rules::Paper => current,
            _ => best_of(dealers).or(current),
        }
    }

    /// The nearest agent of an index that qualifies as a target; of equally near ones that with the lowest
    /// id.
    #[inline(never)]
    fn best_of(&self, index: &BlockIndex, targets: &[Option<u32>], id: u32, own: &Approach) -> Option<u32> {
        let mut search = Search {
            choice: self,
            targets,
            id,
            own,
            position: self.pos[id as usize],
            stats: self.arena.stats(id),
            // A unit without a target also chooses among those that target it from beyond the search radius.
            retaliates: targets[id as usize].is_none() && self.scratch.is_targeted[id as usize],
            best: Best::NONE,
        };
        // Nearly always the nearest agent qualifies, or none is within the search radius.
        let unvisited =
            index.visit_nearest(search.position, own.search_bound, |other| search.consider(other));
        // A qualified unit that is nearer than all others is the answer. Else one of the others may be it.
        if search.best.squared <= unvisited { search.best.id } else { search.among_all(index, unvisited) }
    }

    /// The unit that a healer without a target chooses to heal: of those in scan range that are hurt or
    /// fight, the one with the least health; of equals the one with the lowest id.
    ///
    /// Other healers and itself are among them if its valid targets contain their plane: only the available
    /// actions of agents exclude healers.
    #[inline(never)]
    fn most_hurt(&self, targets: &[Option<u32>], id: u32) -> Option<u32> {
        let arena = self.arena;
        let healer = arena.stats(id);
        let position = self.pos[id as usize];
        let qualifies = |&other: &u32| {
            let (o, stats) = (other as usize, arena.stats(other));
            arena.can_attack(id, other)
                && distance_squared(position, self.pos[o]).sqrt() < healer.scan_range + stats.radius
                && (self.hp[o] < stats.hp || targets[o].is_some())
        };
        let health = |id: &u32| self.hp[*id as usize];
        let candidates = self.alive_ids.faction_of(arena, id).iter().copied().filter(qualifies);
        // Of equal minima `min_by` returns the first.
        candidates.min_by(|a, b| health(a).total_cmp(&health(b)))
    }

    /// Rule R3: an attack-moving healer goes at the speed of the slowest unit around it, so that it does not
    /// outrun its group. To be asked before it chooses a target.
    ///
    /// Under `smaclite` that may be more than the healer's own maximum: collision avoidance limits the
    /// resulting velocity, not the preferred one.
    #[inline(never)]
    pub fn speed_of_healer(&self, targets: &[Option<u32>], id: u32) -> f64 {
        let arena = self.arena;
        let stats = arena.stats(id);
        if stats.speed == 0.0 {
            return 0.0;
        }
        let is_found = |&other: &u32| {
            let (a, b) = (self.pos[id as usize], self.pos[other as usize]);
            distance_squared(a, b) <= stats.search_radius * stats.search_radius
        };
        let can_heal = |&other: &u32| arena.can_attack(id, other);
        let faction = || self.alive_ids.faction_of(arena, id).iter().copied();
        let slowest = |of: &mut dyn Iterator<Item = u32>| {
            of.map(|other| arena.stats(other).speed).reduce(f64::min).unwrap_or(stats.speed)
        };
        match (arena.rules, targets[id as usize]) {
            (Rules::Paper, _) => slowest(&mut faction().filter(is_found)).min(stats.speed),
            (_, None) => slowest(&mut faction().filter(is_found).filter(can_heal)),
            // A healer with a target is held back only while an enemy damage dealer has none, and then by the
            // opponents that target the healer, as in the published implementation.
            (_, Some(_)) if self.scratch.any_enemy_lacks_target => {
                let targets_me = |&other: &u32| targets[other as usize] == Some(id);
                let opponents = self.alive_ids.opponents_of(arena, id).iter().copied();
                slowest(&mut opponents.filter(targets_me).filter(can_heal))
            }
            (_, Some(_)) => stats.speed,
        }
    }
}

/// The search of a unit for the nearest target among some agents.
struct Search<'a> {
    choice: &'a Choice<'a>,
    targets: &'a [Option<u32>],
    id: u32,
    own: &'a Approach,
    position: Vec2,
    stats: &'a UnitStats,
    retaliates: bool,
    best: Best,
}

/// The best target of a search so far: its distance, and the square of that.
struct Best {
    id: Option<u32>,
    distance: f64,
    squared: f64,
}

impl Best {
    const NONE: Best = Best { id: None, distance: f64::INFINITY, squared: f64::INFINITY };
}

impl Search<'_> {
    /// The best target of an index, where the nearest units do not decide: `unvisited` is the bound that
    /// [`BlockIndex::visit_nearest`] returned.
    #[inline(never)]
    fn among_all(mut self, index: &BlockIndex, unvisited: f64) -> Option<u32> {
        self.best = Best::NONE;
        if self.retaliates {
            index.ids().iter().for_each(|&other| self.consider(other));
        } else if unvisited <= self.stats.search_radius * self.stats.search_radius {
            index.visit_near(self.position, self.own.search_bound, |other| self.consider(other));
        }
        self.best.id
    }

    /// Takes in an agent. They come by ascending id and only a nearer one replaces the best so far, so of two
    /// equally near ones the lower id is chosen.
    #[inline(always)]
    fn consider(&mut self, other: u32) {
        let squared = distance_squared(self.position, self.choice.pos[other as usize]);
        // Most fail here, before their stats are read.
        if squared < self.best.squared
            && let Some(distance) = self.candidate(other, squared)
            && distance < self.best.distance
        {
            self.best = Best { id: Some(other), distance, squared };
        }
    }

    /// The distance of an agent, if it qualifies as a target.
    #[inline(always)]
    fn candidate(&self, other: u32, squared: f64) -> Option<f64> {
        let Choice { arena, .. } = self.choice;
        let targets_me = self.targets[other as usize] == Some(self.id);
        let is_found = squared <= self.stats.search_radius * self.stats.search_radius;
        let can_attack = arena.matchup_of(self.own, &arena.approaches[other as usize]).can_attack;
        if !(is_found || self.retaliates && targets_me) || !can_attack {
            return None;
        }
        // The search radius is by centres and has the largest radius of all units in it; the scan range is
        // up to the edge of this one. A unit that targets the searcher qualifies at any distance.
        let distance = if is_found { squared.sqrt() } else { FAR_AWAY };
        (targets_me || distance < self.stats.scan_range + arena.stats(other).radius).then_some(distance)
    }
}
