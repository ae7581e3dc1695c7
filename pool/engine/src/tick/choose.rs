//! How an attack-moving unit chooses or keeps its target, and how fast an attack-moving healer goes.
//!
//! Searches see positions as they were at the start of the tick (in phase 2 nobody has moved yet), and only
//! units in planes that the searcher may attack.

use glam::Vec2;

use super::World;
use crate::rules::Rules;
use crate::simd::{F32x4, MASK_BITS, Vec2x4, WIDTH, mask};
use crate::units::{distance_squared, make_room};

/// The distance at which a unit counts that the search did not find but that attacks the searcher.
const FAR_AWAY: f64 = 2e9;

/// What attack-moving units need to know of the battle as it is at the start of the phase, worked out once
/// for all.
///
/// Only enemies attack-move, so it is agents that they look for; and agents' targets do not change in this
/// phase.
#[derive(Debug, Default)]
pub(super) struct TargetSearch {
    /// The positions of the living agents, four an entry; the last is filled up with positions at infinity.
    agents: Vec<Vec2x4>,
    /// Which units are some agent's target, by battle-wide id.
    is_hunted: Vec<bool>,
    /// Whether some agent is a living healer (R1).
    agents_heal: bool,
    /// Whether some enemy damage dealer has no target (R3).
    someone_searches: bool,
}

pub(super) fn prepare_searches(world: &mut World) {
    let World { arena, units, living, plan, .. } = world;
    let is_healer = |&id: &u32| arena.stats(id).is_healer;
    let TargetSearch { agents, is_hunted, agents_heal, someone_searches } = &mut plan.target_search;
    agents.clear();
    for ids in living.allies.chunks(WIDTH) {
        let position = |lane| ids.get(lane).map_or(Vec2::INFINITY, |&id| units.pos[id as usize]);
        agents.push(Vec2x4::new(std::array::from_fn(position)));
    }
    is_hunted.clear();
    is_hunted.resize(units.pos.len(), false);
    for target in living.allies.iter().filter_map(|&id| units.target[id as usize]) {
        is_hunted[target as usize] = true;
    }
    *agents_heal = living.allies.iter().any(is_healer);
    *someone_searches =
        living.enemies.iter().any(|id| units.target[*id as usize].is_none() && !is_healer(id));
}

impl TargetSearch {
    pub fn fit(&mut self, n_units: usize) {
        make_room(&mut self.agents, n_units.div_ceil(WIDTH));
        make_room(&mut self.is_hunted, n_units);
    }

    /// Visits the places among the living agents of those that may be within `radius` of a position, in
    /// ascending order. There may be more, as it counts in f32, but none is left out: rounding is far finer
    /// than its margin.
    fn near(&self, position: Vec2, radius: f64, mut visit: impl FnMut(usize)) {
        let bound = F32x4::splat((radius * radius * 1.0001) as f32);
        let position = Vec2x4::splat(position);
        for (part, fours) in self.agents.chunks(MASK_BITS / WIDTH).enumerate() {
            let mut near = mask(fours, |four| (*four - position).length_squared().simd_le(bound));
            while near != 0 {
                visit(part * MASK_BITS + near.trailing_zeros() as usize);
                near &= near - 1;
            }
        }
    }
}

/// The target that an attack-moving unit has after this phase.
pub(super) fn target(world: &World, id: u32) -> Option<u32> {
    let current = world.units.target[id as usize];
    let is_healer = world.arena.stats(id).is_healer;
    match current {
        None if is_healer => most_hurt(world, id),
        None => best_opponent(world, id, true).map(|best| best.id),
        Some(target) if is_healer || world.arena.stats(target).is_healer => Some(target),
        Some(_) => reconsider(world, id).or(current),
    }
}

/// Rule R1: what a unit with a target that is no healer would rather have.
fn reconsider(world: &World, id: u32) -> Option<u32> {
    if !world.plan.target_search.agents_heal {
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
    /// Healers first, then the nearest. Candidates come by ascending id, so of equals the first is kept.
    fn beats(&self, other: &Candidate) -> bool {
        if self.is_healer == other.is_healer { self.distance < other.distance } else { self.is_healer }
    }
}

/// The best of the agents that are in scan range or after this unit; `retaliate` lets in those that are after
/// it from beyond the search radius.
fn best_opponent(world: &World, id: u32, retaliate: bool) -> Option<Candidate> {
    let (agents, target_search) = (&world.living.allies, &world.plan.target_search);
    let (position, radius) = (world.units.pos[id as usize], world.arena.stats(id).search_radius);
    let mut best: Option<Candidate> = None;
    // What an opponent's squared distance must be below, if the best so far is no healer.
    let mut bound = f64::INFINITY;
    let mut consider = |other: u32| {
        let squared = distance_squared(position, world.units.pos[other as usize]);
        if squared >= bound && !world.arena.stats(other).is_healer {
            return; // as most are
        }
        let Some(candidate) = candidate(world, id, other, squared, retaliate) else { return };
        if best.as_ref().is_none_or(|best| candidate.beats(best)) {
            bound = if candidate.is_healer { bound } else { squared };
            best = Some(candidate);
        }
    };
    if target_search.is_hunted[id as usize] {
        agents.iter().for_each(|&other| consider(other));
    } else {
        target_search.near(position, radius, |place| consider(agents[place]));
    }
    best
}

/// The opponent as a candidate, if it qualifies.
fn candidate(world: &World, id: u32, other: u32, squared: f64, retaliate: bool) -> Option<Candidate> {
    let (searcher, stats) = (world.arena.stats(id), world.arena.stats(other));
    let after_me = world.units.target[other as usize] == Some(id);
    let found = squared <= searcher.search_radius * searcher.search_radius;
    if !(found || retaliate && after_me) || !world.arena.can_attack(id, other) {
        return None;
    }
    let distance = if found { squared.sqrt() } else { FAR_AWAY };
    let qualifies = after_me || distance < searcher.scan_range + stats.radius;
    qualifies.then_some(Candidate { is_healer: stats.is_healer, distance, id: other })
}

/// Whom a healer without a target heals: of those in scan range that are hurt or fight, the one with least
/// health.
///
/// Other healers and itself are among them, if its valid targets name their plane: only agents' actions leave
/// healers out.
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
    let candidates = world.living.side_of(arena, id).iter().copied().filter(qualifies);
    candidates.min_by(|a, b| health(a).total_cmp(&health(b)))
}

/// The speed at which an attack-moving unit wants to go, before it chooses a target; full for all but healers
/// (R3).
pub(super) fn speed(world: &World, id: u32) -> f64 {
    let stats = world.arena.stats(id);
    if stats.is_healer { speed_of_healer(world, id) } else { stats.speed }
}

/// Rule R3. Under `smaclite` it may be more than the healer's own maximum: collision avoidance limits the
/// velocity that comes out, not the preferred one.
fn speed_of_healer(world: &World, id: u32) -> f64 {
    let arena = world.arena;
    let stats = arena.stats(id);
    if stats.speed == 0.0 {
        return 0.0;
    }
    let found = |&other: &u32| {
        let (a, b) = (world.units.pos[id as usize], world.units.pos[other as usize]);
        distance_squared(a, b) <= stats.search_radius * stats.search_radius
    };
    let reaches = |&other: &u32| arena.can_attack(id, other);
    let side = || world.living.side_of(arena, id).iter().copied();
    let slowest = |of: &mut dyn Iterator<Item = u32>| {
        of.map(|other| arena.stats(other).speed).reduce(f64::min).unwrap_or(stats.speed)
    };
    match (arena.rules, world.units.target[id as usize]) {
        (Rules::Paper, _) => slowest(&mut side().filter(found)).min(stats.speed),
        (Rules::Smaclite, None) => slowest(&mut side().filter(found).filter(reaches)),
        (Rules::Smaclite, Some(_)) if world.plan.target_search.someone_searches => {
            let after_me = |&other: &u32| world.units.target[other as usize] == Some(id);
            let opponents = world.living.opponents(arena, id).iter().copied();
            slowest(&mut opponents.filter(after_me).filter(reaches))
        }
        (Rules::Smaclite, Some(_)) => stats.speed,
    }
}
