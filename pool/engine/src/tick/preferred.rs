//! Phase 2, preferred velocities: where each unit wants to go, and which attack or heal it declares.
//!
//! The targets of attack-moving units are chosen in `target_choice`.

use glam::Vec2;

use super::{World, target_choice};
use crate::command::Command;
use crate::units::distance_squared;

/// Sets the preferred velocity, the target and the declared attack of every unit.
#[inline(never)]
pub(super) fn decide(world: &mut World) {
    target_choice::prepare(world);
    for i in 0..world.alive_ids.all.len() {
        let id = world.alive_ids.all[i];
        let unit = id as usize;
        world.scratch.attack[unit] = None;
        let speed = world.arena.stats(id).speed;
        let preferred = match world.scratch.commands[unit] {
            Command::Stop => Vec2::ZERO,
            Command::MoveTo(destination) => towards_point(world.units.pos[unit], destination, speed),
            Command::Target(target) => close_in(world, id, target, speed),
            Command::AttackMove => {
                // The speed depends on whether the unit had a target before it chooses one (R3).
                let speed = target_choice::speed(world, id);
                world.units.target[unit] = target_choice::choose(world, id);
                match world.units.target[unit] {
                    Some(target) => close_in(world, id, target, speed),
                    None => towards_point(world.units.pos[unit], world.arena.attack_point, speed),
                }
            }
        };
        if world.units.declared[unit] {
            declare_held_attack(world, id);
        }
        // A unit that cannot move prefers +0.0. Without this it would be -0.0 towards the west or south. A
        // healer that follows an immobile unit may prefer -0.0 (R3).
        world.scratch.preferred[unit] = if speed == 0.0 { Vec2::ZERO } else { preferred };
    }
}

/// Rule R4: a held attack is declared again as soon as there is a target, at any distance and in any plane.
#[cold]
fn declare_held_attack(world: &mut World, id: u32) {
    let unit = id as usize;
    let target = match world.scratch.commands[unit] {
        Command::Target(target) => Some(target),
        Command::AttackMove => world.units.target[unit],
        Command::Stop | Command::MoveTo(_) => None,
    };
    world.scratch.attack[unit] = target;
    world.units.declared[unit] = target.is_none();
}

/// Declares an attack on a target within attack range and stays; otherwise walks to it.
#[inline(always)]
fn close_in(world: &mut World, id: u32, target: u32, speed: f64) -> Vec2 {
    if world.arena.can_attack(id, target) && in_reach(world, id, target) {
        world.scratch.attack[id as usize] = Some(target);
        return Vec2::ZERO;
    }
    towards_unit(world.units.pos[id as usize], world.units.pos[target as usize], speed)
}

/// Whether the target is within the attack range, measured between the edges of the two units.
pub(super) fn in_reach(world: &World, id: u32, target: u32) -> bool {
    let (own, other) = (world.units.pos[id as usize], world.units.pos[target as usize]);
    distance_squared(own, other) <= world.arena.matchup(id, target).reach_squared
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
