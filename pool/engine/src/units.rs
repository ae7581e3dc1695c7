//! The changing state of all units, one vector per quantity, indexed by battle-wide id.
//!
//! What never changes about a unit (its type, its faction) is in the arena.

use glam::Vec2;
use serde::Serialize;

use crate::arena::Arena;
use crate::buffers::refill;
use crate::rules::Rules;

/// The changing part of every unit of a battle, indexed by battle-wide id; all columns have equal lengths.
///
/// A dead unit keeps its last values.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Units {
    /// Position in terrain squares; x grows east, y north.
    pub pos: Vec<Vec2>,
    /// Velocity with which the unit last moved, in squares per second.
    pub vel: Vec<Vec2>,
    /// Velocity planned in the last tick, from which other units plan theirs. It equals `vel`, except for a
    /// unit that was killed before it could move, and healed in the same tick (R2).
    pub planned_vel: Vec<Vec2>,
    /// Health, from 0 to the type's maximum.
    pub hp: Vec<f64>,
    /// Shield, from 0 to the type's maximum.
    pub shield: Vec<f64>,
    /// Energy, from 0 to the type's maximum.
    pub energy: Vec<f64>,
    /// Seconds until the unit can act again.
    pub cooldown: Vec<f64>,
    /// Seconds until the shield regenerates.
    pub shield_cooldown: Vec<f64>,
    /// Healing that was paid for with energy and not used yet, in health.
    pub healing: Vec<f64>,
    /// Whether the unit is in the battle. Within a tick a unit may be without health and alive, because
    /// deaths wait for phase 5. A dead unit stays dead, even if its health rises again (R2).
    pub alive: Vec<bool>,
    /// The unit's target.
    pub target: Vec<Option<u32>>,
    /// Whether the unit holds an attack that it declared and has not executed. Between ticks this is only
    /// true of a unit that was killed before its turn and healed in the same tick (R4).
    pub declared: Vec<bool>,
    /// What units are about under rules `starcraft`; empty under the others.
    pub phases: Vec<AttackPhase>,
}

/// What a unit is about under rules `starcraft`. Times are in seconds, and count down to 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct AttackPhase {
    /// Until the damage point of the attack that has begun; 0 if none has.
    pub windup: f64,
    /// Until the unit walks again without a new order.
    pub backswing: f64,
    /// Until it looks for targets again.
    pub look: f64,
    /// Until the next hit arrives.
    pub hit_time: f64,
    /// The target of the attack that has begun.
    pub target: Option<u32>,
    /// The target of the last attack.
    pub last: Option<u32>,
    /// What the hits in flight are for.
    pub hit_target: Option<u32>,
    /// Where that was.
    pub hit_at: Vec2,
    /// Where the unit marches to while it attack-moves.
    pub goal: Vec2,
    /// Where the unit faces, as a direction; 0 before it first walks or attacks.
    pub facing: Vec2,
    /// How many hits are in flight.
    pub hits: u32,
    /// Whether it looks at once and as far as it must, since a unit of its side was hit near it.
    pub is_alarmed: bool,
}

impl Units {
    /// Becomes equal to `other`, in its own memory; a derived `clone_from` allocates.
    pub(crate) fn copy_from(&mut self, other: &Units) {
        let Units { pos, vel, planned_vel, hp, shield, energy, cooldown, shield_cooldown, healing, .. } =
            other;
        self.pos.clone_from(pos);
        self.vel.clone_from(vel);
        self.planned_vel.clone_from(planned_vel);
        self.hp.clone_from(hp);
        self.shield.clone_from(shield);
        self.energy.clone_from(energy);
        self.cooldown.clone_from(cooldown);
        self.shield_cooldown.clone_from(shield_cooldown);
        self.healing.clone_from(healing);
        self.alive.clone_from(&other.alive);
        self.target.clone_from(&other.target);
        self.declared.clone_from(&other.declared);
        self.phases.clone_from(&other.phases);
    }

    /// Sets every unit to its state at the start of an episode.
    pub(crate) fn reset(&mut self, arena: &Arena) {
        let all_stats = || arena.unit_ids().map(|id| arena.stats(id));
        refill(&mut self.pos, arena.starts.iter().copied());
        refill(&mut self.vel, all_stats().map(|_| Vec2::ZERO));
        refill(&mut self.planned_vel, all_stats().map(|_| Vec2::ZERO));
        refill(&mut self.hp, all_stats().map(|stats| stats.hp));
        refill(&mut self.shield, all_stats().map(|stats| stats.shield));
        refill(&mut self.energy, all_stats().map(|stats| stats.initial_energy));
        for column in [&mut self.cooldown, &mut self.shield_cooldown, &mut self.healing] {
            refill(column, all_stats().map(|_| 0.0));
        }
        refill(&mut self.alive, all_stats().map(|_| true));
        refill(&mut self.target, all_stats().map(|_| None));
        refill(&mut self.declared, all_stats().map(|_| false));
        let phases = all_stats().filter(|_| arena.rules == Rules::Starcraft);
        refill(&mut self.phases, phases.map(|_| AttackPhase::default()));
    }
}

/// The battle-wide ids of the living units, ascending.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct AliveIds {
    pub all: Vec<u32>,
    pub allies: Vec<u32>,
    pub enemies: Vec<u32>,
}

impl AliveIds {
    /// Finds the living units again, after a reset.
    pub fn refresh(&mut self, arena: &Arena, units: &Units) {
        let alive = |id: &u32| units.alive[*id as usize];
        refill(&mut self.all, arena.unit_ids().filter(alive));
        refill(&mut self.allies, arena.agents.iter().copied().filter(alive));
        refill(&mut self.enemies, arena.enemies.iter().copied().filter(alive));
    }

    /// Removes units that are no longer alive.
    pub fn remove_dead(&mut self, alive: &[bool]) {
        for ids in [&mut self.all, &mut self.allies, &mut self.enemies] {
            ids.retain(|&id| alive[id as usize]);
        }
    }

    /// The living units of the faction of `id`.
    pub fn faction_of(&self, arena: &Arena, id: u32) -> &[u32] {
        if arena.is_enemy(id) { &self.enemies } else { &self.allies }
    }

    /// The living units of the other faction.
    pub fn opponents_of(&self, arena: &Arena, id: u32) -> &[u32] {
        if arena.is_enemy(id) { &self.allies } else { &self.enemies }
    }
}
