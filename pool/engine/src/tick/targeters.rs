//! The effects of attacks and heals, by targeter: damage, explosions, lasers and healing. Each function
//! returns what it earns, unscaled; if nothing else is said, for the side of the unit that acts.

use glam::Vec2;
use smaclite_units::Targeter;

use super::{Earned, World};
use crate::distance::{distance, distance_squared};
use crate::rules::Rules;
use crate::{HEAL_PER_TICK, HEALTH_PER_ENERGY, KILL_REWARD, MIN_ENERGY_FOR_NEW_TARGET, SHIELD_DELAY};

/// Lets a unit act on its target; adds what that earns.
pub(super) fn act(world: &mut World, id: u32, target: u32, earned: &mut Earned) {
    let side = world.arena.faction(id);
    match world.arena.stats(id).targeter {
        Targeter::Standard => earned.add(side, attack(world, id, target)),
        Targeter::Kamikaze { radius } => explode(world, id, radius, earned),
        Targeter::LaserBeam { width, height } => {
            let centre = world.units.pos[target as usize];
            let attacks = world.arena.stats(id).attacks;
            earned.add(side, fire_laser_at(world, id, centre, [width, height], attacks));
        }
        Targeter::Heal => heal(world, id, target),
    }
}

/// So many hits on a unit.
pub(super) fn strike(world: &mut World, id: u32, victim: u32, hits: u32, earned: &mut Earned) {
    let dealt = hits_on(world, id, victim, hits);
    earned.add(world.arena.faction(id), dealt);
}

/// All hits of one attack; some units hit more than once.
fn attack(world: &mut World, id: u32, victim: u32) -> f64 {
    hits_on(world, id, victim, world.arena.stats(id).attacks)
}

fn hits_on(world: &mut World, id: u32, victim: u32, hits: u32) -> f64 {
    let damage = world.arena.matchup(id, victim).damage;
    (0..hits).map(|_| hit(world, id, damage, victim)).sum()
}

/// One hit. The shield absorbs the damage first, without armor; armor reduces the rest, and health absorbs
/// what remains. It earns the damage dealt, and more for a kill.
fn hit(world: &mut World, id: u32, damage: f64, victim: u32) -> f64 {
    let (units, stats, i) = (&mut *world.units, world.arena.stats(victim), victim as usize);
    // A victim that was killed earlier in this tick is hit to no effect, so a kill is rewarded once.
    if units.hp[i] == 0.0 {
        return 0.0;
    }
    // Every hit restarts the delay, also one that armor absorbs entirely.
    if stats.shield > 0.0 {
        units.shield_cooldown[i] = SHIELD_DELAY;
    }
    let to_shield = f64::min(damage, units.shield[i]);
    units.shield[i] -= to_shield;
    let to_health = f64::min(f64::max(0.0, damage - to_shield - stats.armor), units.hp[i]);
    units.hp[i] -= to_health;
    let killed = units.hp[i] == 0.0;
    world.scratch.may_have_dead |= killed;
    if killed {
        world.scratch.killed[world.arena.faction(victim) as usize] += 1;
    }
    if let Some(credit) = world.scratch.credits.get_mut(id as usize) {
        let for_kill = if killed { world.arena.rewards().death_value } else { 0.0 };
        *credit += to_shield + to_health + for_kill;
    }
    // Losses cost the victim's side nothing: a reward is never negative.
    to_shield + to_health + if killed { KILL_REWARD } else { 0.0 }
}

/// KAMIKAZE: the unit dies, and hits every unit of the other faction around it, whatever its plane.
fn explode(world: &mut World, id: u32, radius: f64, earned: &mut Earned) {
    let arena = world.arena;
    let health = std::mem::take(&mut world.units.hp[id as usize]);
    world.scratch.may_have_dead = true;
    let side = arena.faction(id);
    // A unit that blows itself up earns the other side its remaining health, but no reward for a kill.
    earned.add(side.opponent(), health);
    let mut damage = 0.0;
    let centre = world.units.pos[id as usize];
    let search_radius = radius + arena.largest_radius;
    for i in 0..world.alive_ids.opponents_of(arena, id).len() {
        let victim = world.alive_ids.opponents_of(arena, id)[i];
        // Two conditions, as in the published implementation: a search that uses the positions at the start
        // of the tick finds the victim, and its current position is within reach of the blast.
        let start = world.scratch.start[victim as usize];
        let is_found = distance_squared(centre, start) <= search_radius * search_radius;
        let reach = radius + arena.stats(victim).radius;
        if is_found && distance(centre, world.units.pos[victim as usize]) <= reach {
            damage += attack(world, id, victim);
        }
    }
    earned.add(side, damage);
}

/// LASER_BEAM: hits every unit of the other faction, whatever its plane, whose circle touches a rectangle
/// that lies across the line of fire, centred on the target; so many hits on each.
pub(super) fn fire_laser_at(world: &mut World, id: u32, centre: Vec2, size: [f64; 2], hits: u32) -> f64 {
    let (arena, [width, height]) = (world.arena, size);
    let beam = Beam::new(world.units.pos[id as usize], centre, width, height);
    // Half the diagonal of the rectangle; the radius of the victim is not added. The search uses positions at
    // the start of the tick, the hit current ones, as in `explode`.
    let search_radius_squared = (width * width + height * height) / 4.0;
    let mut earned = 0.0;
    for i in 0..world.alive_ids.opponents_of(arena, id).len() {
        let victim = world.alive_ids.opponents_of(arena, id)[i];
        let is_found =
            distance_squared(centre, world.scratch.start[victim as usize]) <= search_radius_squared;
        if is_found && beam.touches(world.units.pos[victim as usize], arena.stats(victim).radius) {
            earned += hits_on(world, id, victim, hits);
        }
    }
    earned
}

/// The rectangle that a laser hits.
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
        // A target at the same point gives no direction; then the beam points east.
        let fire = if length > 0.0 { [dx / length, dy / length] } else { [1.0, 0.0] };
        Beam { centre, fire, half_width: width / 2.0, half_height: height / 2.0 }
    }

    fn touches(&self, point: Vec2, radius: f64) -> bool {
        let dx = f64::from(point.x) - f64::from(self.centre.x);
        let dy = f64::from(point.y) - f64::from(self.centre.y);
        // In coordinates along and across the line of fire the rectangle is axis-aligned: its distance from
        // the point is that of the parts of the offset beyond its half sides.
        let along = (dx * self.fire[0] + dy * self.fire[1]).abs() - self.half_height;
        let across = (dx * self.fire[1] - dy * self.fire[0]).abs() - self.half_width;
        let (along, across) = (along.max(0.0), across.max(0.0));
        along * along + across * across <= radius * radius
    }
}

/// HEAL: restores health and pays for it with energy.
fn heal(world: &mut World, id: u32, target: u32) {
    let (units, i, patient) = (&mut *world.units, id as usize, target as usize);
    let full = world.arena.stats(target).hp;
    // The fields are compared, not the commands: under a command to target a dead unit both fields are empty,
    // so the target is not new.
    let is_new = world.scratch.previous_target[i] != units.target[i];
    if units.hp[patient] == full || is_new && units.energy[i] < MIN_ENERGY_FOR_NEW_TARGET {
        units.target[i] = None;
        return;
    }
    // Rule R2: under `paper` a unit without health cannot be healed. Under `smaclite` a unit that was killed
    // in this tick survives if it is healed before the tick ends; the health of a dead unit rises without
    // effect.
    if world.arena.rules == Rules::Paper && units.hp[patient] == 0.0 {
        return;
    }
    // Energy is spent in whole units and each buys HEALTH_PER_ENERGY. What a tick does not use is kept in
    // `healing` for the next ticks, whatever the target is then.
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
