//! Phase 2, preferred velocities: where each unit wants to go, and which attack or heal it declares.
//!
//! The targets of attack-moving units are chosen in `target_choice`.

use glam::Vec2;

use super::World;
use super::target_choice::{self, Choice};
use crate::arena::Matchup;
use crate::command::Command;
use crate::units::distance_squared;

/// Sets the preferred velocity, the target and the declared attack of every unit.
#[inline(never)]
pub(super) fn decide(world: &mut World) {
    target_choice::prepare(world);
    let World { arena, units, alive_ids, scratch, .. } = world;
    // Slices of one length: one check of an id serves all columns.
    let n = units.pos.len();
    let (pos, hp, targets) = (&units.pos[..n], &units.hp[..n], &mut units.target[..n]);
    let (commands, approaches) = (&scratch.commands[..n], &arena.approaches[..n]);
    let (declared, attacks) = (&mut units.declared[..n], &mut scratch.attack[..n]);
    let preferred = &mut scratch.preferred[..n];
    let choice = Choice { arena, alive_ids, pos, hp, scratch: &scratch.target_choice };
    for &id in &alive_ids.all {
        let i = id as usize;
        let own = &approaches[i];
        let mut speed = own.speed;
        let goal = match commands[i] {
            Command::Stop => Goal::Here,
            Command::MoveTo(destination) => Goal::Point(destination),
            Command::Target(target) => Goal::Unit(target),
            Command::AttackMove => {
                // The speed depends on whether the unit had a target before it chooses one (R3).
                if own.is_healer {
                    speed = choice.speed_of_healer(targets, id);
                }
                targets[i] = choice.target(targets, id, own);
                targets[i].map_or(Goal::Point(arena.attack_point), Goal::Unit)
            }
        };
        let mut attack = None;
        let wanted = match goal {
            Goal::Here => Vec2::ZERO,
            Goal::Point(point) => towards_point(pos[i], point, speed),
            Goal::Unit(target) => {
                let t = target as usize;
                let matchup = arena.matchup_of(own, &approaches[t]);
                // Declares an attack on a target within attack range and stays; otherwise walks to it.
                if matchup.can_attack && in_reach(pos[i], pos[t], matchup) {
                    attack = Some(target);
                    Vec2::ZERO
                } else {
                    towards_unit(pos[i], pos[t], speed)
                }
            }
        };
        if declared[i] {
            (attack, declared[i]) = declare_held_attack(commands[i], targets[i]);
        }
        attacks[i] = attack;
        // A unit that cannot move prefers +0.0. Without this it would be -0.0 towards the west or south. A
        // healer that follows an immobile unit may prefer -0.0 (R3).
        preferred[i] = wanted;
        if own.speed == 0.0 {
            preferred[i] = Vec2::ZERO;
        }
    }
}

/// Where a unit wants to be.
enum Goal {
    Here,
    Point([f64; 2]),
    /// Within attack range of this unit.
    Unit(u32),
}

/// Rule R4: a held attack is declared again as soon as there is a target, at any distance and in any plane.
/// Returns the declared attack, and whether one is still held.
#[cold]
fn declare_held_attack(command: Command, target: Option<u32>) -> (Option<u32>, bool) {
    let target = match command {
        Command::Target(target) => Some(target),
        Command::AttackMove => target,
        Command::Stop | Command::MoveTo(_) => None,
    };
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
