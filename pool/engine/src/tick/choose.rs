//! How an attack-moving unit chooses or keeps its target, and how fast an attack-moving healer goes.
//!
//! Searches see positions as they were at the start of the tick (in phase 2 nobody has moved yet), and only units
//! in planes that the searcher may attack.

use super::World;
use crate::rules::Rules;
use crate::units::distance_squared;

/// The distance at which a unit counts that the search did not find but that attacks the searcher.
const FAR_AWAY: f64 = 2e9;

/// The target that an attack-moving unit has after this phase.
pub(super) fn target(world: &World, id: u32) -> Option<u32> {
    let current = world.units.target[id as usize];
    let is_healer = world.arena.kind(id).is_healer;
    match current {
        None if is_healer => most_hurt(world, id),
        None => best_opponent(world, id, true).map(|best| best.id),
        Some(target) if is_healer || world.arena.kind(target).is_healer => Some(target),
        Some(_) => reconsider(world, id).or(current),
    }
}

/// Rule R1: what a unit with a target that is no healer would rather have.
fn reconsider(world: &World, id: u32) -> Option<u32> {
    let is_healer = |&id: &u32| world.arena.kind(id).is_healer;
    if !world.living.opponents(world.arena, id).iter().any(is_healer) {
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

/// The best of the opponents that are in scan range or after this unit; `retaliate` lets in those that are after
/// it from beyond the search radius.
fn best_opponent(world: &World, id: u32, retaliate: bool) -> Option<Candidate> {
    let arena = world.arena;
    let searcher = arena.kind(id);
    let search_radius_squared = searcher.search_radius * searcher.search_radius;
    let position = world.units.pos[id as usize];
    let mut best: Option<Candidate> = None;
    for &other in world.living.opponents(arena, id) {
        if !arena.can_attack(id, other) {
            continue;
        }
        let after_me = world.units.target[other as usize] == Some(id);
        let squared = distance_squared(position, world.units.pos[other as usize]);
        let found = squared <= search_radius_squared;
        let is_candidate = found || retaliate && after_me;
        if !is_candidate {
            continue;
        }
        let kind = arena.kind(other);
        let distance = if found { squared.sqrt() } else { FAR_AWAY };
        let candidate = Candidate { is_healer: kind.is_healer, distance, id: other };
        let qualifies = after_me || distance < searcher.scan_range + kind.radius;
        if qualifies && best.as_ref().is_none_or(|best| candidate.beats(best)) {
            best = Some(candidate);
        }
    }
    best
}

/// Whom a healer without a target heals: of those in scan range that are hurt or fight, the one with least health.
fn most_hurt(world: &World, id: u32) -> Option<u32> {
    let (arena, units) = (world.arena, &*world.units);
    let healer = arena.kind(id);
    let position = units.pos[id as usize];
    let qualifies = |&other: &u32| {
        let kind = arena.kind(other);
        !kind.is_healer
            && arena.can_attack(id, other)
            && distance_squared(position, units.pos[other as usize]).sqrt() < healer.scan_range + kind.radius
            && (units.hp[other as usize] < kind.hp || units.target[other as usize].is_some())
    };
    let health = |id: &u32| units.hp[*id as usize];
    let candidates = world.living.side_of(arena, id).iter().copied().filter(qualifies);
    candidates.min_by(|a, b| health(a).total_cmp(&health(b)))
}

/// Rule R3: how fast attack-moving healers go in this tick.
pub(super) struct HealersPace {
    /// Whether some enemy damage dealer starts the phase without a target.
    someone_searches: bool,
}

impl HealersPace {
    pub fn at_start_of_phase(world: &World) -> HealersPace {
        let searches =
            |&id: &u32| !world.arena.kind(id).is_healer && world.units.target[id as usize].is_none();
        HealersPace { someone_searches: world.living.enemies.iter().any(searches) }
    }

    /// The speed of an attack-moving unit, before it chooses a target; full for all but healers.
    pub fn speed_of(&self, world: &World, id: u32) -> f64 {
        let arena = world.arena;
        let kind = arena.kind(id);
        if !kind.is_healer {
            return kind.speed;
        }
        let found = |&other: &u32| {
            let (a, b) = (world.units.pos[id as usize], world.units.pos[other as usize]);
            distance_squared(a, b) <= kind.search_radius * kind.search_radius
        };
        let reaches = |&other: &u32| arena.can_attack(id, other);
        let side = || world.living.side_of(arena, id).iter().copied();
        let slowest = |of: &mut dyn Iterator<Item = u32>| {
            of.map(|other| arena.kind(other).speed).fold(kind.speed, f64::min)
        };
        match (arena.rules, world.units.target[id as usize]) {
            (Rules::Paper, _) => slowest(&mut side().filter(found)),
            (Rules::Smaclite, None) => slowest(&mut side().filter(found).filter(reaches)),
            (Rules::Smaclite, Some(_)) if self.someone_searches => {
                let after_me = |&other: &u32| world.units.target[other as usize] == Some(id);
                let opponents = world.living.opponents(arena, id).iter().copied();
                slowest(&mut opponents.filter(after_me).filter(reaches))
            }
            (Rules::Smaclite, Some(_)) => kind.speed,
        }
    }
}
