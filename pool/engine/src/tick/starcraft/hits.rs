//! What attacks have in flight, and what happens when it arrives.

use smaclite_units::Targeter;

use super::super::{Earned, World, targeters};
use crate::TICK;

/// Lands the hits whose time has come.
#[inline(never)]
pub(super) fn land(world: &mut World, earned: &mut Earned) {
    // Attacks launch hits later in a tick than this, so here it says what the last tick left.
    let may_have_hits = std::mem::take(&mut world.scratch.may_have_hits);
    if !may_have_hits && !world.scratch.is_first_tick {
        return;
    }
    // Also those of the dead: a projectile outlives who fired it.
    for id in world.arena.unit_ids() {
        let phase = &mut world.units.phases[id as usize];
        if phase.hits == 0 {
            continue;
        }
        phase.hit_time = f64::max(0.0, phase.hit_time - TICK);
        if phase.hit_time == 0.0 {
            hit(world, id, earned);
        }
        world.scratch.may_have_hits |= world.units.phases[id as usize].hits > 0;
    }
}

/// Lands all hits that a unit has in flight.
pub(super) fn land_all(world: &mut World, id: u32, earned: &mut Earned) {
    while world.units.phases[id as usize].hits > 0 {
        hit(world, id, earned);
    }
}

/// Lands the next hit of a unit.
pub(super) fn hit(world: &mut World, id: u32, earned: &mut Earned) {
    let (i, stats) = (id as usize, world.arena.stats(id));
    let (conduct, own_target) = (stats.conduct, world.units.target[i]);
    let phase = &mut world.units.phases[i];
    phase.hits -= 1;
    phase.hit_time = conduct.hit_interval;
    let (at, Some(target)) = (phase.hit_at, phase.hit_target) else { return };
    let attacks = if conduct.hit_interval > 0.0 { 1 } else { stats.attacks };
    match stats.targeter {
        Targeter::LaserBeam { width, height } => {
            let side = world.arena.faction(id);
            earned.add(side, targeters::fire_laser_at(world, id, at, [width, height], attacks));
        }
        // A dead unit has exploded already, or does not.
        Targeter::Kamikaze { .. } if world.units.hp[i] > 0.0 => {
            world.scratch.exploded.push(id);
            targeters::act(world, id, target, earned);
        }
        Targeter::Kamikaze { .. } => {}
        _ if conduct.hit_interval > 0.0 => {
            // Blows that follow each other need a unit that lives, and has no other target by now and still
            // reaches it.
            let goes_on = world.units.alive[i]
                && world.units.hp[i] > 0.0
                && own_target == Some(target)
                && world.arena.matchup(id, target).reaches(
                    world.units.pos[i],
                    world.units.pos[target as usize],
                    true,
                );
            match goes_on {
                true => targeters::strike(world, id, target, 1, earned),
                false => world.units.phases[i].hits = 0,
            }
        }
        _ => targeters::strike(world, id, target, attacks, earned),
    }
}

/// Lets units that were killed in this tick explode, if they are of a kind that does.
#[inline(never)]
pub(super) fn explode_killed(world: &mut World, earned: &mut Earned) {
    if !world.scratch.may_have_dead {
        return;
    }
    let mut exploded = true;
    while std::mem::take(&mut exploded) {
        for at in 0..world.alive_ids.all.len() {
            let id = world.alive_ids.all[at];
            let is_killed = world.units.hp[id as usize] <= 0.0;
            let explodes = world.arena.stats(id).conduct.explodes_when_killed;
            if !is_killed || !explodes || world.scratch.exploded.contains(&id) {
                continue;
            }
            world.scratch.exploded.push(id);
            exploded = true;
            targeters::act(world, id, id, earned);
        }
    }
}
