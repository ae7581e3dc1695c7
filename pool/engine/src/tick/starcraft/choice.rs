//! Targets: those of orders, and those that attack-moving units look for.
//!
//! How the game's units choose is not public. What is here was found by comparing battles with recorded ones;
//! docs/concepts/starcraft.md says what each rule rests on.

use std::hint::select_unpredictable;

use super::super::{Earned, TickScratch, World};
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
const LEASH: f64 = 10.0;
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
    let TickScratch { choosers, attackers, commands, previous_target, attack_moving, .. } = &mut **scratch;
    // Later than the orders, and by ascending id: units count who has the same target already.
    choosers.resize(attack_moving.len(), Chooser::default());
    let mut n_choosers = 0;
    for &id in attack_moving.iter() {
        let (chooses, is_alarmed) = look(arena, units, id);
        // Written before it is known whether it chooses: no branch, which would be hard to predict.
        choosers[n_choosers] = Chooser { id, is_alarmed };
        n_choosers += usize::from(chooses);
    }
    if n_choosers == 0 {
        return;
    }
    attackers.clear();
    attackers.resize(units.pos.len() + 1, 0);
    // All of one side, whose targets are no others'.
    for &id in alive_ids.faction_of(arena, choosers[0].id) {
        let i = id as usize;
        // Who has lost its target counts until it chooses.
        let attack_moves = matches!(commands[i], Command::AttackMove(_));
        count(arena, attackers, id, if attack_moves { previous_target[i] } else { units.target[i] }, 1);
    }
    for &Chooser { id, is_alarmed } in &choosers[..n_choosers] {
        let i = id as usize;
        count(arena, attackers, id, previous_target[i], -1);
        if let Some(best) = best(arena, units, alive_ids, attackers, id, is_alarmed) {
            units.target[i] = Some(best);
        }
        count(arena, attackers, id, units.target[i], 1);
    }
}

/// A unit that chooses a target in this tick.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::tick) struct Chooser {
    id: u32,
    /// Whether it looks farther than usual.
    is_alarmed: bool,
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

/// Counts a unit among those that attack its target; the last number is of those that attack none.
fn count(arena: &Arena, attackers: &mut [i32], id: u32, target: Option<u32>, by: i32) {
    let none = attackers.len() - 1;
    let by = if arena.starcraft_stats[id as usize].is_healer { 0 } else { by };
    attackers[target.map_or(none, |target| target as usize)] += by;
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

/// Lets an attack-moving unit keep its target or lose it, with the attack on it. Returns whether it chooses
/// one in this tick, and whether it then looks farther than usual.
///
/// With few branches: most of what is asked here is hard to predict.
#[inline(always)]
fn look(arena: &Arena, units: &mut Units, id: u32) -> (bool, bool) {
    let (i, stats) = (id as usize, &arena.starcraft_stats[id as usize]);
    let target = units.target[i];
    let (mut kept, mut is_far) = (None, false);
    if let Some(target) = target {
        let t = target as usize;
        let is_worth = units.alive[t] && (!stats.is_healer || units.hp[t] < arena.stats(target).hp);
        let gap = gap(arena, units, id, target);
        let is_kept = is_worth & (gap <= stats.look_range + LEASH);
        kept = is_kept.then_some(target);
        is_far = is_kept & (gap > stats.attack_range);
    }
    let phase = &mut units.phases[i];
    let look = fast_math::max(0.0, phase.look - TICK);
    let is_time = look == 0.0;
    phase.look = select_unpredictable(is_time, LOOK_INTERVAL, look);
    let is_alarmed = std::mem::take(&mut phase.is_alarmed);
    if phase.target != kept {
        phase.cancel(&mut units.cooldown[i]);
    }
    let is_idle = phase.windup == 0.0;
    // After each attack a unit chooses again.
    let has_attacked = is_idle & phase.last.is_some();
    phase.last = phase.last.filter(|_| !is_idle);
    let is_lost = target.is_some() & kept.is_none();
    let chooses = is_lost | has_attacked | ((is_time | is_alarmed) & (kept.is_none() | (is_idle & is_far)));
    units.target[i] = kept;
    (chooses, is_alarmed)
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

/// Notes health and shields of the units of a side that attack-moves, before the hits of a tick.
#[inline(never)]
pub(super) fn remember(world: &mut World) {
    let World { arena, units, alive_ids, scratch, .. } = world;
    let Some(&marcher) = scratch.attack_moving.first() else { return };
    let n = units.hp.len();
    let (hp, shield, vitality) = (&units.hp[..n], &units.shield[..n], &mut scratch.vitality[..n]);
    for &id in alive_ids.faction_of(arena, marcher) {
        vitality[id as usize] = hp[id as usize] + shield[id as usize];
    }
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
