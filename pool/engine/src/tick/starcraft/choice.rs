//! Targets: those of orders, and those that attack-moving units look for.
//!
//! How the game's units choose is not public. What is here was found by comparing battles with recorded ones;
//! docs/concepts/starcraft.md says what each rule rests on.

use super::super::{Earned, World};
use crate::TICK;
use crate::arena::Arena;
use crate::command::Command;
use crate::distance::{distance, distance_squared};
use crate::fast_math;
use crate::random::Generator;
use crate::units::{AliveIds, AttackPhase, Units};

/// Seconds between two looks of a unit for targets. Each unit has its own times: recorded enemies stop 0 to 6
/// ticks after a target came into their range.
pub(crate) const LOOK_INTERVAL: f64 = 0.5;
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
#[inline(never)]
pub(super) fn choose_targets(world: &mut World) {
    follow_orders(world);
    let World { arena, units, alive_ids, scratch, .. } = world;
    // Later than the orders, and by ascending id: units count who has the same target already.
    let attackers = &mut scratch.attackers;
    attackers.clear();
    for &id in &scratch.attack_moving {
        let outlook = look(arena, units, id);
        count(arena, attackers, id, outlook.previous, -1);
        if outlook.chooses {
            if attackers.is_empty() {
                // Counted when the first unit chooses: in most ticks none does.
                attackers.resize(units.pos.len(), 0);
                for &other in alive_ids.all.iter().filter(|other| **other != id) {
                    count(arena, attackers, other, units.target[other as usize], 1);
                }
            }
            if let Some(best) = best(arena, units, alive_ids, attackers, id, outlook.is_alarmed) {
                units.target[id as usize] = Some(best);
            }
        }
        count(arena, attackers, id, units.target[id as usize], 1);
    }
}

/// Gives units the targets of their orders. After the first tick of a step only a target changes that dies,
/// or that a healer has given up.
fn follow_orders(world: &mut World) {
    let World { units, alive_ids, scratch, .. } = world;
    // A healer compares its target with that of the tick before.
    scratch.previous_target.clear();
    scratch.previous_target.extend_from_slice(&units.target);
    if !scratch.is_first_tick {
        for &(id, target) in &scratch.targeting {
            match units.alive[target as usize] {
                true => units.target[id as usize] = Some(target),
                false => follow_order(units, id, None),
            }
        }
        return;
    }
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
}

/// Counts a unit among those that attack its target. `attackers` is empty while nobody has counted them.
fn count(arena: &Arena, attackers: &mut [i32], id: u32, target: Option<u32>, by: i32) {
    if let Some(target) = target.filter(|_| !arena.starcraft_stats[id as usize].is_healer)
        && let Some(attackers) = attackers.get_mut(target as usize)
    {
        *attackers += by;
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

/// What a unit finds when it looks at its target.
struct Outlook {
    /// The target that it had.
    previous: Option<u32>,
    /// Whether it chooses a target now.
    chooses: bool,
    /// Whether it then looks farther.
    is_alarmed: bool,
}

/// Lets an attack-moving unit keep its target or lose it, with the attack on it, and decides whether it
/// chooses one in this tick.
fn look(arena: &Arena, units: &mut Units, id: u32) -> Outlook {
    let (i, stats) = (id as usize, &arena.starcraft_stats[id as usize]);
    let target = units.target[i];
    let gap_to = |target: u32| {
        let t = target as usize;
        let is_worth = units.alive[t] && (!stats.is_healer || units.hp[t] < arena.stats(target).hp);
        let gap = gap(arena, units, id, target);
        (is_worth && gap <= stats.look_range + LEASH).then_some(gap)
    };
    let gap = target.and_then(gap_to);
    let kept = target.filter(|_| gap.is_some());
    let is_far = gap.is_some_and(|gap| gap > stats.attack_range);
    let phase = &mut units.phases[i];
    phase.look = fast_math::max(0.0, phase.look - TICK);
    let is_alarmed = std::mem::take(&mut phase.is_alarmed);
    let is_due = phase.look == 0.0 || is_alarmed;
    if phase.look == 0.0 {
        phase.look = LOOK_INTERVAL;
    }
    if phase.target != kept {
        phase.cancel(&mut units.cooldown[i]);
    }
    let is_idle = phase.windup == 0.0;
    // After each attack a unit chooses again.
    let has_attacked = is_idle && phase.last.take().is_some();
    let is_lost = target.is_some() && kept.is_none();
    let chooses = is_lost || has_attacked || is_due && (kept.is_none() || is_idle && is_far);
    units.target[i] = kept;
    Outlook { previous: target, chooses, is_alarmed }
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
    let stats = &arena.starcraft_stats[id as usize];
    let range = stats.look_range + if is_alarmed { LEASH } else { 0.0 };
    let candidates = match stats.is_healer {
        true => alive_ids.faction_of(arena, id),
        false => alive_ids.opponents_of(arena, id),
    };
    // Most are farther away, which needs no root: not farther by more than the largest unit's radius.
    let bound = range + stats.radius + arena.largest_radius;
    let bound_squared = bound * bound * MARGIN;
    let mut best: Option<(Rank, u32)> = None;
    for &other in candidates {
        let o = other as usize;
        let distance_squared = distance_squared(units.pos[id as usize], units.pos[o]);
        if distance_squared > bound_squared {
            continue;
        }
        let gap = distance_squared.sqrt() - (stats.radius + arena.starcraft_stats[o].radius);
        if gap > range || other == id || !arena.can_attack(id, other) {
            continue;
        }
        let rank = if stats.is_healer {
            let share = units.hp[o] / arena.stats(other).hp;
            if share >= 1.0 {
                continue;
            }
            Rank { is_far: false, cost: share, gap }
        } else {
            let cost = gap + (stats.attack_range + stats.radius) * f64::from(attackers[o]);
            Rank { is_far: gap > stats.attack_range, cost, gap }
        };
        if best.is_none_or(|(least, _)| rank < least) {
            best = Some((rank, other));
        }
    }
    best.map(|(_, other)| other)
}

/// How good a target is; the least is the best.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
struct Rank {
    is_far: bool,
    cost: f64,
    gap: f64,
}

/// The distance between the edges of two units.
#[inline(always)]
fn gap(arena: &Arena, units: &Units, id: u32, other: u32) -> f64 {
    let all_stats = &arena.starcraft_stats;
    let radii = all_stats[id as usize].radius + all_stats[other as usize].radius;
    distance(units.pos[id as usize], units.pos[other as usize]) - radii
}

/// Notes health and shields, before the hits of a tick.
#[inline(never)]
pub(super) fn remember(world: &mut World) {
    let World { units, scratch, .. } = world;
    scratch.vitality.clear();
    scratch.vitality.extend(units.hp.iter().zip(&units.shield).map(|(hp, shield)| hp + shield));
}

/// Alarms those without a target that were hit in this tick, or are near a unit of their side that was.
#[inline(never)]
pub(super) fn alarm(world: &mut World, earned: &Earned) {
    let World { arena, units, alive_ids, scratch, .. } = world;
    let Some(&marcher) = scratch.attack_moving.first() else { return };
    // Who loses health or shield earns somebody something.
    if earned.allies + earned.enemies == 0.0 {
        return;
    }
    let own = alive_ids.faction_of(arena, marcher);
    for &victim in own {
        let v = victim as usize;
        if units.hp[v] + units.shield[v] >= scratch.vitality[v] {
            continue;
        }
        for &id in own.iter().filter(|id| units.target[**id as usize].is_none()) {
            let is_near = distance(units.pos[id as usize], units.pos[v]) <= CALL_RANGE;
            units.phases[id as usize].is_alarmed |= is_near;
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
