//! What attacks and heals do, by targeter. Each returns the reward it earned, unscaled.

use glam::Vec2;
use smaclite_units::Targeter;

use super::World;
use crate::rules::Rules;
use crate::units::{distance, distance_squared};
use crate::{HEAL_PER_TICK, HEALTH_PER_ENERGY, KILL_REWARD, MIN_ENERGY_FOR_NEW_TARGET, SHIELD_DELAY};

/// Lets a unit act on its target.
pub(super) fn act(world: &mut World, id: u32, target: u32) -> f64 {
    match world.arena.stats(id).targeter {
        Targeter::Standard => attack(world, id, target),
        Targeter::Kamikaze { radius } => explode(world, id, radius),
        Targeter::LaserBeam { width, height } => fire_laser(world, id, target, width, height),
        Targeter::Heal => {
            heal(world, id, target);
            0.0
        }
    }
}

/// All hits of one attack.
fn attack(world: &mut World, id: u32, victim: u32) -> f64 {
    let damage = world.arena.matchup(id, victim).damage;
    (0..world.arena.stats(id).attacks).map(|_| hit(world, damage, victim)).sum()
}

/// One hit: the shield takes what it can, armor lessens the rest, health pays.
fn hit(world: &mut World, damage: f64, victim: u32) -> f64 {
    let (units, stats, i) = (&mut *world.units, world.arena.stats(victim), victim as usize);
    if units.hp[i] == 0.0 {
        return 0.0;
    }
    if stats.shield > 0.0 {
        units.shield_cooldown[i] = SHIELD_DELAY;
    }
    let to_shield = f64::min(damage, units.shield[i]);
    units.shield[i] -= to_shield;
    let to_health = f64::min(f64::max(0.0, damage - to_shield - stats.armor), units.hp[i]);
    units.hp[i] -= to_health;
    if !world.arena.is_enemy(victim) {
        return 0.0;
    }
    let killed = units.hp[i] == 0.0;
    to_shield + to_health + if killed { KILL_REWARD } else { 0.0 }
}

/// KAMIKAZE: dies, and hits every unit of the other side around it, whatever its plane.
fn explode(world: &mut World, id: u32, radius: f64) -> f64 {
    let arena = world.arena;
    let health = std::mem::take(&mut world.units.hp[id as usize]);
    let mut earned = if arena.is_enemy(id) { health } else { 0.0 };
    let centre = world.units.pos[id as usize];
    let search_radius = radius + arena.largest_radius;
    for i in 0..world.living.opponents(arena, id).len() {
        let victim = world.living.opponents(arena, id)[i];
        let start = world.plan.start[victim as usize];
        let found = distance_squared(centre, start) <= search_radius * search_radius;
        let reach = radius + arena.stats(victim).radius;
        if found && distance(centre, world.units.pos[victim as usize]) <= reach {
            earned += attack(world, id, victim);
        }
    }
    earned
}

/// LASER_BEAM: hits every unit of the other side, whatever its plane, whose circle touches a rectangle across
/// the line of fire.
fn fire_laser(world: &mut World, id: u32, target: u32, width: f64, height: f64) -> f64 {
    let arena = world.arena;
    let centre = world.units.pos[target as usize];
    let beam = Beam::new(world.units.pos[id as usize], centre, width, height);
    let search_radius_squared = (width * width + height * height) / 4.0;
    let mut earned = 0.0;
    for i in 0..world.living.opponents(arena, id).len() {
        let victim = world.living.opponents(arena, id)[i];
        let found = distance_squared(centre, world.plan.start[victim as usize]) <= search_radius_squared;
        if found && beam.touches(world.units.pos[victim as usize], arena.stats(victim).radius) {
            earned += attack(world, id, victim);
        }
    }
    earned
}

/// The rectangle of a laser.
struct Beam {
    centre: Vec2,
    /// Direction of the line of fire, of length 1.
    fire: [f64; 2],
    half_width: f64,
    half_height: f64,
}

impl Beam {
    fn new(from: Vec2, centre: Vec2, width: f64, height: f64) -> Beam {
        let (dx, dy) = (f64::from(centre.x) - f64::from(from.x), f64::from(centre.y) - f64::from(from.y));
        let length = (dx * dx + dy * dy).sqrt();
        // Fired at its own feet it has no direction; any will do.
        let fire = if length > 0.0 { [dx / length, dy / length] } else { [1.0, 0.0] };
        Beam { centre, fire, half_width: width / 2.0, half_height: height / 2.0 }
    }

    fn touches(&self, point: Vec2, radius: f64) -> bool {
        let dx = f64::from(point.x) - f64::from(self.centre.x);
        let dy = f64::from(point.y) - f64::from(self.centre.y);
        let along = (dx * self.fire[0] + dy * self.fire[1]).abs() - self.half_height;
        let across = (dx * self.fire[1] - dy * self.fire[0]).abs() - self.half_width;
        let (along, across) = (along.max(0.0), across.max(0.0));
        along * along + across * across <= radius * radius
    }
}

/// HEAL: gives health for energy.
fn heal(world: &mut World, id: u32, target: u32) {
    let (units, i, patient) = (&mut *world.units, id as usize, target as usize);
    let full = world.arena.stats(target).hp;
    // Of the target fields: under a command to target a unit out of the battle both are empty, and nothing is
    // new.
    let is_new = world.plan.previous_target[i] != units.target[i];
    if units.hp[patient] == full || is_new && units.energy[i] < MIN_ENERGY_FOR_NEW_TARGET {
        units.target[i] = None;
        return;
    }
    // Rule R2: the paper's dead stay dead. Here one killed in this tick lives on if healed before its end,
    // and the health of one that is out of the battle rises to no effect.
    if world.arena.rules == Rules::Paper && units.hp[patient] == 0.0 {
        return;
    }
    let wanted = f64::min(HEAL_PER_TICK, full - units.hp[patient]);
    if units.healing[i] < wanted {
        let spent = f64::min(1.0, units.energy[i]);
        units.energy[i] -= spent;
        units.healing[i] += HEALTH_PER_ENERGY * spent;
    }
    let given = f64::min(wanted, units.healing[i]);
    units.healing[i] -= given;
    units.hp[patient] += given;
}
