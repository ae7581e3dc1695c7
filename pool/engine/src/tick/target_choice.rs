//! The choice of a target by attack-moving units, and the speed of attack-moving healers.
//!
//! - A damage dealer attacks healers first, then the nearest agent; of equally near ones that with the lowest
//!   id ([`Candidate::beats`]).
//! - A healer (the medivac) heals the unit of its faction with the least health; of equals that with the
//!   lowest id ([`most_hurt`]).
//!
//! The searches use the positions at the start of the tick (no unit moves before phase 4), and find only
//! units in planes that the searcher can attack.

use glam::Vec2;

use super::World;
use crate::rules::Rules;
use crate::simd::{F32x4, MASK_BITS, Vec2x4, WIDTH, mask};
use crate::units::{clear_and_reserve, distance_squared};

/// The distance of a unit that targets the searcher from beyond its search radius: farther than any other.
const FAR_AWAY: f64 = 2e9;

/// Working memory: the state of the battle that all choices of a phase use, computed once per tick.
///
/// Only enemies attack-move, so only agents are candidates; and the targets of agents do not change in this
/// phase.
#[derive(Debug, Default)]
pub(super) struct TargetChoiceScratch {
    /// The positions of the living agents, four per entry. The last entry is padded with positions at
    /// infinity, which no search finds.
    agents: Vec<Vec2x4>,
    /// Which units are the target of an agent, by battle-wide id.
    is_targeted: Vec<bool>,
    /// Whether a living agent is a healer (R1).
    any_agent_heals: bool,
    /// Whether an enemy damage dealer has no target (R3).
    any_enemy_lacks_target: bool,
}

/// Prepares the choices of this tick.
pub(super) fn prepare(world: &mut World) {
    let World { arena, units, alive_ids, scratch, .. } = world;
    let is_healer = |&id: &u32| arena.stats(id).is_healer;
    let TargetChoiceScratch { agents, is_targeted, any_agent_heals, any_enemy_lacks_target } =
        &mut scratch.target_choice;
    agents.clear();
    for ids in alive_ids.allies.chunks(WIDTH) {
        let position = |i| ids.get(i).map_or(Vec2::INFINITY, |&id| units.pos[id as usize]);
        agents.push(Vec2x4::new(std::array::from_fn(position)));
    }
    is_targeted.clear();
    is_targeted.resize(units.pos.len(), false);
    for target in alive_ids.allies.iter().filter_map(|&id| units.target[id as usize]) {
        is_targeted[target as usize] = true;
    }
    *any_agent_heals = alive_ids.allies.iter().any(is_healer);
    *any_enemy_lacks_target =
        alive_ids.enemies.iter().any(|id| units.target[*id as usize].is_none() && !is_healer(id));
}

impl TargetChoiceScratch {
    pub fn reserve(&mut self, n_units: usize) {
        clear_and_reserve(&mut self.agents, n_units.div_ceil(WIDTH));
        clear_and_reserve(&mut self.is_targeted, n_units);
    }

    /// Visits the living agents that may be within `radius` of a position, as indices into
    /// [`AliveIds::allies`](crate::units::AliveIds), ascending.
    ///
    /// It computes in f32 with a margin far larger than its rounding error: it finds some agents beyond the
    /// radius, but misses none within it.
    fn near(&self, position: Vec2, radius: f64, mut visit: impl FnMut(usize)) {
        let bound = F32x4::splat((radius * radius * 1.0001) as f32);
        let position = Vec2x4::splat(position);
        for (part, fours) in self.agents.chunks(MASK_BITS / WIDTH).enumerate() {
            let mut near = mask(fours, |four| (*four - position).length_squared().simd_le(bound));
            while near != 0 {
                visit(part * MASK_BITS + near.trailing_zeros() as usize);
                // Clears the lowest bit.
                near &= near - 1;
            }
        }
    }
}

/// The target that an attack-moving unit has after this phase.
pub(super) fn choose(world: &World, id: u32) -> Option<u32> {
    let current = world.units.target[id as usize];
    let is_healer = world.arena.stats(id).is_healer;
    match current {
        None if is_healer => most_hurt(world, id),
        None => best_opponent(world, id, true).map(|best| best.id),
        // Healers keep their target, and damage dealers keep a target that is a healer.
        Some(target) if is_healer || world.arena.stats(target).is_healer => Some(target),
        Some(_) => reconsider(world, id).or(current),
    }
}

/// Rule R1: a better target for a unit whose target is not a healer.
fn reconsider(world: &World, id: u32) -> Option<u32> {
    if !world.scratch.target_choice.any_agent_heals {
        return None;
    }
    let best = best_opponent(world, id, false)?;
    (world.arena.rules == Rules::Smaclite || best.is_healer).then_some(best.id)
}

/// An opponent that qualifies as a target.
struct Candidate {
    is_healer: bool,
    distance: f64,
    id: u32,
}

impl Candidate {
    /// Healers first, then the nearest. Candidates come by ascending id and only a strictly better one
    /// replaces the best so far, so of two equally near ones the lower id is chosen.
    fn beats(&self, other: &Candidate) -> bool {
        if self.is_healer == other.is_healer { self.distance < other.distance } else { self.is_healer }
    }
}

/// The best target among the agents that are in scan range or target this unit. `retaliate` admits those that
/// target it from beyond the search radius.
fn best_opponent(world: &World, id: u32, retaliate: bool) -> Option<Candidate> {
    let (agents, scratch) = (&world.alive_ids.allies, &world.scratch.target_choice);
    let (position, radius) = (world.units.pos[id as usize], world.arena.stats(id).search_radius);
    let mut best: Option<Candidate> = None;
    // The squared distance of the best damage dealer so far; it is an upper bound for the next.
    let mut bound = f64::INFINITY;
    let mut consider = |other: u32| {
        let squared = distance_squared(position, world.units.pos[other as usize]);
        // Most candidates fail here, before their stats are read. Healers may win at any distance.
        if squared >= bound && !world.arena.stats(other).is_healer {
            return;
        }
        let Some(candidate) = candidate(world, id, other, squared, retaliate) else { return };
        if best.as_ref().is_none_or(|best| candidate.beats(best)) {
            bound = if candidate.is_healer { bound } else { squared };
            best = Some(candidate);
        }
    };
    // A unit that is targeted may have to consider agents beyond its search radius.
    if scratch.is_targeted[id as usize] {
        agents.iter().for_each(|&other| consider(other));
    } else {
        scratch.near(position, radius, |index| consider(agents[index]));
    }
    best
}

/// The opponent as a candidate, if it qualifies.
fn candidate(world: &World, id: u32, other: u32, squared: f64, retaliate: bool) -> Option<Candidate> {
    let (searcher, stats) = (world.arena.stats(id), world.arena.stats(other));
    let targets_me = world.units.target[other as usize] == Some(id);
    let is_found = squared <= searcher.search_radius * searcher.search_radius;
    if !(is_found || retaliate && targets_me) || !world.arena.can_attack(id, other) {
        return None;
    }
    // The search radius is by centres and has the largest radius of all units in it; the scan range is up to
    // the edge of this one. A unit that targets the searcher qualifies at any distance.
    let distance = if is_found { squared.sqrt() } else { FAR_AWAY };
    let qualifies = targets_me || distance < searcher.scan_range + stats.radius;
    qualifies.then_some(Candidate { is_healer: stats.is_healer, distance, id: other })
}

/// The unit that a healer without a target chooses to heal: of those in scan range that are hurt or fight,
/// the one with the least health; of equals the one with the lowest id.
///
/// Other healers and itself are among them if its valid targets contain their plane: only the available
/// actions of agents exclude healers.
fn most_hurt(world: &World, id: u32) -> Option<u32> {
    let (arena, units) = (world.arena, &*world.units);
    let healer = arena.stats(id);
    let position = units.pos[id as usize];
    let qualifies = |&other: &u32| {
        let stats = arena.stats(other);
        arena.can_attack(id, other)
            && distance_squared(position, units.pos[other as usize]).sqrt() < healer.scan_range + stats.radius
            && (units.hp[other as usize] < stats.hp || units.target[other as usize].is_some())
    };
    let health = |id: &u32| units.hp[*id as usize];
    let candidates = world.alive_ids.faction_of(arena, id).iter().copied().filter(qualifies);
    // Of equal minima `min_by` returns the first.
    candidates.min_by(|a, b| health(a).total_cmp(&health(b)))
}

/// The preferred speed of an attack-moving unit, before it chooses a target: its maximum, except for healers
/// (R3).
pub(super) fn speed(world: &World, id: u32) -> f64 {
    let stats = world.arena.stats(id);
    if stats.is_healer { speed_of_healer(world, id) } else { stats.speed }
}

/// Rule R3: a healer goes at the speed of the slowest unit around it, so that it does not outrun its group.
///
/// Under `smaclite` that may be more than the healer's own maximum: collision avoidance limits the resulting
/// velocity, not the preferred one.
fn speed_of_healer(world: &World, id: u32) -> f64 {
    let arena = world.arena;
    let stats = arena.stats(id);
    if stats.speed == 0.0 {
        return 0.0;
    }
    let is_found = |&other: &u32| {
        let (a, b) = (world.units.pos[id as usize], world.units.pos[other as usize]);
        distance_squared(a, b) <= stats.search_radius * stats.search_radius
    };
    let can_heal = |&other: &u32| arena.can_attack(id, other);
    let faction = || world.alive_ids.faction_of(arena, id).iter().copied();
    let slowest = |of: &mut dyn Iterator<Item = u32>| {
        of.map(|other| arena.stats(other).speed).reduce(f64::min).unwrap_or(stats.speed)
    };
    match (arena.rules, world.units.target[id as usize]) {
        (Rules::Paper, _) => slowest(&mut faction().filter(is_found)).min(stats.speed),
        (Rules::Smaclite, None) => slowest(&mut faction().filter(is_found).filter(can_heal)),
        // A healer with a target is held back only while an enemy damage dealer has none, and then by the
        // opponents that target the healer, as in the published implementation.
        (Rules::Smaclite, Some(_)) if world.scratch.target_choice.any_enemy_lacks_target => {
            let targets_me = |&other: &u32| world.units.target[other as usize] == Some(id);
            let opponents = world.alive_ids.opponents_of(arena, id).iter().copied();
            slowest(&mut opponents.filter(targets_me).filter(can_heal))
        }
        (Rules::Smaclite, Some(_)) => stats.speed,
    }
}
