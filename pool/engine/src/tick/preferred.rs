//! Phase 2, preferred velocities: where each unit wants to go, and which attack or heal it declares.
//!
//! The targets of attack-moving units are chosen in `target_choice`.

use glam::Vec2;

use super::World;
use super::target_choice::{self, Choice};
use crate::arena::{Approach, Arena, Matchup};
use crate::distance::distance_squared;

/// Sets the preferred velocity, the target and the declared attack of every unit.
#[inline(never)]
pub(super) fn decide(world: &mut World) {
    target_choice::prepare(world);
    let World { arena, units, alive_ids, scratch, .. } = world;
    // Slices of one length: one check of an id serves all columns.
    let n = units.pos.len();
    let (pos, hp, targets) = (&units.pos[..n], &units.hp[..n], &mut units.target[..n]);
    let mut plans = Plans {
        arena,
        pos,
        approaches: &arena.approaches[..n],
        declared: &mut units.declared[..n],
        attacks: &mut scratch.attack[..n],
        preferred: &mut scratch.preferred[..n],
    };
    let choice = Choice { arena, alive_ids, pos, hp, scratch: &scratch.target_choice };
    if scratch.is_first_tick {
        // Units that stop get nothing below. The enemies attack-move all together or not at all.
        let acting = if scratch.attack_moving.is_empty() { &alive_ids.all } else { &alive_ids.allies };
        for &id in acting {
            plans.set(id, Vec2::ZERO, None, None);
        }
    }
    // One loop per command, since which of them a unit has is hard to predict. Nothing that a unit does here
    // depends on whether an agent came before or after it; those that attack-move come by ascending id.
    for &(id, destination) in &scratch.moving {
        plans.walk(id, destination, plans.approaches[id as usize].speed);
    }
    for &(id, target) in &scratch.targeting {
        plans.approach(id, target, plans.approaches[id as usize].speed);
    }
    for &(id, destination) in &scratch.attack_moving {
        let i = id as usize;
        let own = &plans.approaches[i];
        // The speed depends on whether the unit had a target before it chooses one (R3).
        let speed = if own.is_healer { choice.speed_of_healer(targets, id) } else { own.speed };
        targets[i] = choice.target(targets, id, own);
        match targets[i] {
            Some(target) => plans.approach(id, target, speed),
            None => plans.walk(id, destination, speed),
        }
    }
}

/// What units intend to do, by battle-wide id.
struct Plans<'a> {
    arena: &'a Arena,
    pos: &'a [Vec2],
    approaches: &'a [Approach],
    declared: &'a mut [bool],
    attacks: &'a mut [Option<u32>],
    preferred: &'a mut [Vec2],
}

impl Plans<'_> {
    /// The unit has no target and walks to a point.
    #[inline(always)]
    fn walk(&mut self, id: u32, to: [f64; 2], speed: f64) {
        self.set(id, towards_point(self.pos[id as usize], to, speed), None, None);
    }

    /// The unit declares an attack on a target within attack range and stays; otherwise it walks to it.
    #[inline(always)]
    fn approach(&mut self, id: u32, target: u32, speed: f64) {
        let (i, t) = (id as usize, target as usize);
        let matchup = self.arena.matchup_of(&self.approaches[i], &self.approaches[t]);
        if matchup.can_attack && in_reach(self.pos[i], self.pos[t], matchup) {
            self.set(id, Vec2::ZERO, Some(target), Some(target));
        } else {
            self.set(id, towards_unit(self.pos[i], self.pos[t], speed), Some(target), None);
        }
    }

    /// Sets the preferred velocity and the declared attack of a unit with this target, or with none.
    #[inline(always)]
    fn set(&mut self, id: u32, wanted: Vec2, target: Option<u32>, attack: Option<u32>) {
        let i = id as usize;
        self.attacks[i] = attack;
        if self.declared[i] {
            (self.attacks[i], self.declared[i]) = declare_held_attack(target);
        }
        // A unit that cannot move prefers +0.0. Without this it would be -0.0 towards the west or south. A
        // healer that follows an immobile unit may prefer -0.0 (R3).
        self.preferred[i] = wanted;
        if self.approaches[i].speed == 0.0 {
            self.preferred[i] = Vec2::ZERO;
        }
    }
}

/// Rule R4: a held attack is declared again as soon as there is a target, at any distance and in any plane.
/// Returns the declared attack, and whether one is still held.
#[cold]
fn declare_held_attack(target: Option<u32>) -> (Option<u32>, bool) {
    (target, target.is_none())
}

/// Whether a target is within the attack range, measured between the edges of the two units.
#[inline(always)]
pub(super) fn in_reach(own: Vec2, target: Vec2, matchup: &Matchup) -> bool {
    distance_squared(own, target) <= matchup.reach_squared
}

/// Full speed straight to a point, computed in f64, unlike the way to a unit.
#[inline(always)]
fn towards_point(from: Vec2, to: [f64; 2], speed: f64) -> Vec2 {
    let (dx, dy) = (to[0] - f64::from(from.x), to[1] - f64::from(from.y));
    let length = (dx * dx + dy * dy).sqrt();
    if length == 0.0 {
        return Vec2::ZERO;
    }
    // Multiply before dividing: the recorded battles depend on this order of rounding.
    Vec2::new((dx * speed / length) as f32, (dy * speed / length) as f32)
}

/// Full speed straight to a unit, computed in f32.
#[inline(always)]
fn towards_unit(from: Vec2, to: Vec2, speed: f64) -> Vec2 {
    let (way, speed) = (to - from, speed as f32);
    let length = way.length();
    if length == 0.0 {
        return Vec2::ZERO;
    }
    Vec2::new(way.x * speed / length, way.y * speed / length)
}
