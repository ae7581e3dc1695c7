//! Targets: those of orders, and those that attack-moving units look for.
//!
//! How the game's units choose is not public. What is here was found by comparing battles with recorded ones;
//! docs/concepts/starcraft.md says what each rule rests on.

use smaclite_scenarios::Faction;

use super::super::World;
use crate::TICK;
use crate::arena::Arena;
use crate::buffers::refill;
use crate::command::Command;
use crate::distance::{distance, distance_squared};
use crate::random::Generator;
use crate::units::{AliveIds, AttackPhase, Units};

/// Seconds between two looks of a unit for targets. Each unit has its own times: recorded enemies stop 0 to 6
/// ticks after a target came into their range.
pub(crate) const LOOK_INTERVAL: f64 = 0.5;
/// The units look less far than their scan range by this: between 0.5, which fits where recorded enemies
/// stop, and 0.2, which fits what random play earns in SMAC.
const SCAN_MARGIN: f64 = 0.3;
/// How much farther than it looks a unit keeps a target, and looks when it is alarmed.
const LEASH: f64 = 5.0;
/// Units of the side of a unit that was hit look at once, if they are this near to it: the game's radius of
/// calls for help.
const CALL_RANGE: f64 = 4.0;
/// More than the rounding of a square.
const MARGIN: f64 = 1.000_001;

/// The time until a unit first looks for targets.
pub(crate) fn first_look(generator: &mut Generator) -> f64 {
    generator.next_share() * LOOK_INTERVAL
}

/// Sets the target of every living unit.
pub(super) fn choose_targets(world: &mut World) {
    let World { arena, units, alive_ids, scratch, .. } = world;
    // A healer compares its target with that of the tick before.
    scratch.previous_target.clear();
    scratch.previous_target.extend_from_slice(&units.target);
    for &id in &alive_ids.all {
        match scratch.commands[id as usize] {
            Command::Stop | Command::MoveTo(_) => follow_order(units, id, None),
            Command::Target(target) => {
                let target = units.alive[target as usize].then_some(target);
                follow_order(units, id, target);
            }
            Command::AttackMove(_) => {}
        }
    }
    let attackers = &mut scratch.attackers;
    refill(attackers, units.target.iter().map(|_| 0));
    for &id in &alive_ids.all {
        count(arena, attackers, id, units.target[id as usize], 1);
    }
    // Later than the orders, and by ascending id: units count who has the same target already.
    for &id in &scratch.attack_moving {
        count(arena, attackers, id, units.target[id as usize], -1);
        look(arena, units, alive_ids, attackers, id);
        count(arena, attackers, id, units.target[id as usize], 1);
    }
}

/// Counts a unit among those that attack its target.
fn count(arena: &Arena, attackers: &mut [i32], id: u32, target: Option<u32>, by: i32) {
    if let Some(target) = target.filter(|_| !arena.stats(id).is_healer) {
        attackers[target as usize] += by;
    }
}

/// Gives a unit the target of its order. Another order ends an attack, and what is left of the last one.
fn follow_order(units: &mut Units, id: u32, target: Option<u32>) {
    let (i, phase) = (id as usize, &mut units.phases[id as usize]);
    units.target[i] = target;
    if phase.target != target {
        phase.cancel(&mut units.cooldown[i]);
    }
    if phase.last != target {
        phase.backswing = 0.0;
        phase.last = None;
    }
}

/// Lets an attack-moving unit keep its target or look for another one.
///
/// `attackers` has the number of other units that attack each unit.
fn look(arena: &Arena, units: &mut Units, alive_ids: &AliveIds, attackers: &[i32], id: u32) {
    let (i, stats) = (id as usize, arena.stats(id));
    let target = units.target[i];
    let gap = |target: u32| gap(arena, units, id, target);
    let is_worth = |&target: &u32| {
        let t = target as usize;
        units.alive[t] && (!stats.is_healer || units.hp[t] < arena.stats(target).hp)
    };
    let kept = target.filter(is_worth).filter(|&target| gap(target) <= stats.look_range() + LEASH);
    let is_far = kept.is_some_and(|target| gap(target) > stats.attack_range);
    let phase = &mut units.phases[i];
    phase.look = f64::max(0.0, phase.look - TICK);
    let is_alarmed = std::mem::take(&mut phase.is_alarmed);
    let is_due = phase.look == 0.0 || is_alarmed;
    if phase.look == 0.0 {
        phase.look = LOOK_INTERVAL;
    }
    if phase.target != kept {
        phase.cancel(&mut units.cooldown[i]);
    }
    let is_idle = units.phases[i].windup == 0.0;
    // After each attack a unit chooses again.
    let has_attacked = is_idle && units.phases[i].last.take().is_some();
    let is_lost = target.is_some() && kept.is_none();
    let chooses = is_lost || has_attacked || is_due && (kept.is_none() || is_idle && is_far);
    units.target[i] = kept;
    if chooses {
        units.target[i] = best(arena, units, alive_ids, attackers, id, is_alarmed).or(kept);
    }
}

/// The best target within the range of a unit.
///
/// A healer takes the unit with the smallest share of its health left. Others take a target within attack
/// range before one that is farther away, then the nearest, where each unit of their side that has the same
/// target counts as much as their attack range and radius: those that shoot spread their fire, and those that
/// fight hand to hand go to the nearest, unless others are there.
fn best(
    arena: &Arena,
    units: &Units,
    alive_ids: &AliveIds,
    attackers: &[i32],
    id: u32,
    is_alarmed: bool,
) -> Option<u32> {
    let stats = arena.stats(id);
    let range = stats.look_range() + if is_alarmed { LEASH } else { 0.0 };
    let candidates = match stats.is_healer {
        true => alive_ids.faction_of(arena, id),
        false => alive_ids.opponents_of(arena, id),
    };
    // Most are farther away, which needs no root: not farther by more than the largest unit's radius.
    let bound = range + stats.radius + arena.largest_radius;
    let rank = |other: u32| {
        let at = units.pos[other as usize];
        if distance_squared(units.pos[id as usize], at) > bound * bound * MARGIN {
            return None;
        }
        let gap = gap(arena, units, id, other);
        if gap > range || other == id || !arena.can_attack(id, other) {
            return None;
        }
        if stats.is_healer {
            let share = units.hp[other as usize] / arena.stats(other).hp;
            return (share < 1.0).then_some((false, share, gap));
        }
        let rivals = f64::from(attackers[other as usize]);
        Some((gap > stats.attack_range, gap + (stats.attack_range + stats.radius) * rivals, gap))
    };
    let ranked = candidates.iter().filter_map(|&other| Some((rank(other)?, other)));
    let least = ranked.min_by(|(a, _), (b, _)| {
        let by_distance = || a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2));
        a.0.cmp(&b.0).then_with(by_distance)
    });
    least.map(|(_, other)| other)
}

/// The distance between the edges of two units.
fn gap(arena: &Arena, units: &Units, id: u32, other: u32) -> f64 {
    let radii = arena.stats(id).radius + arena.stats(other).radius;
    distance(units.pos[id as usize], units.pos[other as usize]) - radii
}

impl crate::arena::UnitStats {
    /// How far the unit looks for targets, from edge to edge.
    fn look_range(&self) -> f64 {
        f64::max(self.scan_range - SCAN_MARGIN, self.attack_range)
    }
}

/// Notes health and shields, before the hits of a tick.
pub(super) fn remember(world: &mut World) {
    let World { units, scratch, .. } = world;
    scratch.vitality.clear();
    scratch.vitality.extend(units.hp.iter().zip(&units.shield).map(|(hp, shield)| hp + shield));
}

/// Alarms those without a target that were hit in this tick, or are near a unit of their side that was.
pub(super) fn alarm(world: &mut World) {
    let World { arena, units, alive_ids, scratch, .. } = world;
    let Some(&marcher) = scratch.attack_moving.first() else { return };
    let own: &[u32] = match arena.faction(marcher) {
        Faction::Ally => &alive_ids.allies,
        Faction::Enemy => &alive_ids.enemies,
    };
    for &victim in own {
        let v = victim as usize;
        if units.hp[v] + units.shield[v] >= scratch.vitality[v] {
            continue;
        }
        for &id in own {
            let is_near = distance(units.pos[id as usize], units.pos[v]) <= CALL_RANGE;
            units.phases[id as usize].is_alarmed |= is_near && units.target[id as usize].is_none();
        }
    }
}

impl AttackPhase {
    /// Ends an attack before its damage point: the unit may attack again at once.
    pub(super) fn cancel(&mut self, cooldown: &mut f64) {
        if self.windup > 0.0 {
            self.windup = 0.0;
            *cooldown = 0.0;
        }
        self.target = None;
    }
}
