//! Phase 2, preferred velocities: where each unit wants to go, and whom it declares to attack or heal.
//!
//! Whom an attack-moving unit picks as its target is in `choose`.

use glam::Vec2;

use super::{World, choose};
use crate::command::Command;
use crate::units::distance_squared;

#[inline(never)] // so that profiles show it
pub(super) fn declare(world: &mut World) {
    choose::prepare_searches(world);
    for i in 0..world.living.all.len() {
        let id = world.living.all[i];
        let unit = id as usize;
        world.plan.attack[unit] = None;
        let speed = world.arena.stats(id).speed;
        let preferred = match world.plan.commands[unit] {
            Command::Stop => Vec2::ZERO,
            Command::MoveTo(destination) => towards_point(world.units.pos[unit], destination, speed),
            Command::Target(target) => close_in(world, id, target, speed),
            Command::AttackMove => {
                let speed = choose::speed(world, id);
                world.units.target[unit] = choose::target(world, id);
                match world.units.target[unit] {
                    Some(target) => close_in(world, id, target, speed),
                    None => towards_point(world.units.pos[unit], world.arena.attack_point, speed),
                }
            }
        };
        if world.units.declared[unit] {
            resume(world, id);
        }
        // Zero without a sign, unlike that of a healer which goes at the speed of a unit that cannot move
        // (R3).
        world.plan.preferred[unit] = if speed == 0.0 { Vec2::ZERO } else { preferred };
    }
}

/// Rule R4: an attack that was held is executed as soon as there is a target, at any distance and in any
/// plane.
#[cold]
fn resume(world: &mut World, id: u32) {
    let unit = id as usize;
    let target = match world.plan.commands[unit] {
        Command::Target(target) => Some(target),
        Command::AttackMove => world.units.target[unit],
        Command::Stop | Command::MoveTo(_) => None,
    };
    world.plan.attack[unit] = target;
    world.units.declared[unit] = target.is_none();
}

/// Declares an attack on a target within reach, or walks to it.
#[inline(always)]
fn close_in(world: &mut World, id: u32, target: u32, speed: f64) -> Vec2 {
    if world.arena.can_attack(id, target) && in_reach(world, id, target) {
        world.plan.attack[id as usize] = Some(target);
        return Vec2::ZERO;
    }
    towards_unit(world.units.pos[id as usize], world.units.pos[target as usize], speed)
}

/// Whether the target is within the attack range, measured between the two bodies' edges.
pub(super) fn in_reach(world: &World, id: u32, target: u32) -> bool {
    let (own, other) = (world.units.pos[id as usize], world.units.pos[target as usize]);
    distance_squared(own, other) <= world.arena.matchup(id, target).reach_squared
}

/// Full speed straight to a point; counted in f64, unlike the way to a unit.
#[inline(always)]
fn towards_point(from: Vec2, to: [f64; 2], speed: f64) -> Vec2 {
    let (dx, dy) = (to[0] - f64::from(from.x), to[1] - f64::from(from.y));
    let length = (dx * dx + dy * dy).sqrt();
    if length == 0.0 {
        return Vec2::ZERO;
    }
    Vec2::new((dx * speed / length) as f32, (dy * speed / length) as f32)
}

/// Full speed straight to a unit; counted in f32.
#[inline(always)]
fn towards_unit(from: Vec2, to: Vec2, speed: f64) -> Vec2 {
    let (way, speed) = (to - from, speed as f32);
    let length = way.length();
    if length == 0.0 {
        return Vec2::ZERO;
    }
    Vec2::new(way.x * speed / length, way.y * speed / length)
}
