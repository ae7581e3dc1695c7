//! The checkpoint of snapshots: the values that a battle can have.
//!
//! All snapshots pass it, whatever they come from; ARCHITECTURE.md lists where those are. A tick trusts what
//! has passed: it computes with positions, velocities and times without a look at them, so a number that no
//! battle has could become infinite there, or let a search run without end.
//!
//! The ranges are closed under the rules: a battle that begins in them stays in them. So every state that a
//! battle reaches can be restored. Each range says why it holds.

use smaclite_units::UnitType;

use super::{Snapshot, SnapshotError};
use crate::arena::Arena;
use crate::opponents::Opponent;
use crate::sides::Actor;
use crate::sizes::Sizes;
use crate::tick::starcraft::{LOOK_INTERVAL, MAX_FLIGHT};
use crate::units::AttackPhase;
use crate::{HEAL_PER_TICK, HEALTH_PER_ENERGY, SHIELD_DELAY};

/// No unit type is faster than 1e6 squares per second. A planned velocity is at most that fast but for
/// rounding, which is below 1e4 in the worst linear program.
const MAX_VELOCITY: f64 = 2e6;

/// Healing is paid for in whole units of energy, when there is less of it than a tick needs.
const MAX_HEALING: f64 = HEAL_PER_TICK + HEALTH_PER_ENERGY;

/// By the ranges of files a step earns less than 1e25, and an episode has less than 2^32 steps. The sum with
/// another step is finite, also as f32.
const MAX_RETURN: f64 = 1e36;

/// A value of a unit, and the range that it must be in.
struct Ranged {
    column: &'static str,
    value: f64,
    min: f64,
    max: f64,
}

impl Snapshot {
    /// Checks that a battle in this arena can have this state.
    ///
    /// # Errors
    /// The first value that this arena does not allow.
    pub fn check(&self, arena: &Arena) -> Result<(), SnapshotError> {
        self.check_lengths(arena)?;
        self.check_types(arena)?;
        self.check_ranges(arena)?;
        self.check_references(arena)
    }

    fn check_lengths(&self, arena: &Arena) -> Result<(), SnapshotError> {
        let units = &self.units;
        let n_units = arena.sizes().n_units();
        let columns = [
            ("unit_type", self.types.len(), n_units),
            ("pos", units.pos.len(), n_units),
            ("vel", units.vel.len(), n_units),
            ("planned_vel", units.planned_vel.len(), n_units),
            ("hp", units.hp.len(), n_units),
            ("shield", units.shield.len(), n_units),
            ("energy", units.energy.len(), n_units),
            ("cooldown", units.cooldown.len(), n_units),
            ("shield_cooldown", units.shield_cooldown.len(), n_units),
            ("healing", units.healing.len(), n_units),
            ("alive", units.alive.len(), n_units),
            ("target", units.target.len(), n_units),
            ("declared", units.declared.len(), n_units),
            ("windup", units.phases.len(), arena.sizes().n_phases),
            ("last_action", self.last_actions.len(), n_units),
            ("perception", self.perception.len(), arena.sizes().perception_size),
        ];
        match columns.into_iter().find(|(_, given, expected)| given != expected) {
            Some((column, given, expected)) => Err(SnapshotError::WrongLength { column, given, expected }),
            None => Ok(()),
        }
    }

    pub(super) fn check_types(&self, arena: &Arena) -> Result<(), SnapshotError> {
        let n_types = arena.types().len();
        let expected = |own: u32| match arena.drawer() {
            Some(_) => format!("between 0 and {}", n_types - 1),
            None => own.to_string(),
        };
        let is_wrong = |&(&given, own): &(&u32, u32)| match arena.drawer() {
            Some(_) => given as usize >= n_types,
            None => given != own,
        };
        let of_units = self.types.iter().zip(arena.type_indices());
        match (0..).zip(of_units).find(|(_, of_unit)| is_wrong(of_unit)) {
            Some((id, (&given, own))) => {
                Err(SnapshotError::NoSuchType { unit: arena.place(id), given, expected: expected(own) })
            }
            None => Ok(()),
        }
    }

    fn check_ranges(&self, arena: &Arena) -> Result<(), SnapshotError> {
        for (id, &unit_type) in (0..).zip(&self.types) {
            let values = self.values_of(arena, id, &arena.types()[unit_type as usize]);
            // NaN and infinity are in no range.
            let is_outside = |of: &Ranged| !(of.min..=of.max).contains(&of.value);
            let of_phase = || {
                let phase = self.units.phases.get(id as usize)?;
                phase_values(arena, phase, &arena.types()[unit_type as usize]).into_iter().find(is_outside)
            };
            let outside = values.into_iter().find(is_outside).or_else(of_phase);
            if let Some(Ranged { column, value, min, max }) = outside {
                return Err(SnapshotError::OutOfRange { column, unit: arena.place(id), value, min, max });
            }
            // Deaths end a tick. Such a unit would be dead for some rules and alive for others.
            if self.units.alive[id as usize] && self.units.hp[id as usize] == 0.0 {
                return Err(SnapshotError::NoHealth { unit: arena.place(id) });
            }
        }
        let (value, max) = (self.episode_length, i32::MAX.cast_unsigned());
        if value > max {
            return Err(SnapshotError::Length { value, max });
        }
        let value = self.episode_return;
        if value.abs() <= MAX_RETURN { Ok(()) } else { Err(SnapshotError::Return { value, max: MAX_RETURN }) }
    }

    /// The numbers of a unit of this type with their ranges.
    fn values_of(&self, arena: &Arena, id: u32, stats: &UnitType) -> [Ranged; 12] {
        let (units, i) = (&self.units, id as usize);
        let (pos, vel, planned_vel) = (units.pos[i], units.vel[i], units.planned_vel[i]);
        let [low, high] = [arena.extent.low, arena.extent.high].map(|corner| corner.as_dvec2());
        let within = |column, value: f64, min, max| Ranged { column, value, min, max };
        let velocity = |column, value: f32| within(column, value.into(), -MAX_VELOCITY, MAX_VELOCITY);
        [
            // Phase 4 stops units at the extent.
            within("pos", pos.x.into(), low.x, high.x),
            within("pos", pos.y.into(), low.y, high.y),
            velocity("vel", vel.x),
            velocity("vel", vel.y),
            velocity("planned_vel", planned_vel.x),
            velocity("planned_vel", planned_vel.y),
            // Hits take no more than there is, and regeneration and healing give no more than is missing.
            within("hp", units.hp[i], 0.0, stats.hp),
            within("shield", units.shield[i], 0.0, stats.shield),
            within("energy", units.energy[i], 0.0, stats.energy),
            // Set by an attack and by a hit, and counted down from there.
            within("cooldown", units.cooldown[i], 0.0, stats.greatest_cooldown()),
            within("shield_cooldown", units.shield_cooldown[i], 0.0, SHIELD_DELAY),
            within("healing", units.healing[i], 0.0, MAX_HEALING),
        ]
    }

    /// Checks whom units attack or heal: a healer its own side, all others the other one.
    fn check_targets(&self, arena: &Arena) -> Result<(), SnapshotError> {
        let n_units = arena.sizes().n_units();
        for (id, &own) in (0..).zip(&self.units.target) {
            let of_phase = self.units.phases.get(id as usize).map(|phase| {
                let AttackPhase { target, last, hit_target, .. } = *phase;
                [("attack_target", target), ("last_attacked", last), ("hit_target", hit_target)]
            });
            let heals = arena.types()[self.types[id as usize] as usize].is_healer();
            for (column, target) in [("target", own)].into_iter().chain(of_phase.into_iter().flatten()) {
                let Some(target) = target else { continue };
                let unit = arena.place(id);
                if target as usize >= n_units {
                    let target = target.into();
                    return Err(SnapshotError::NoSuchTarget { column, unit, target, n_units });
                }
                if (arena.faction(target) == arena.faction(id)) != heals {
                    let (target, side) = (arena.place(target), if heals { "its own" } else { "the other" });
                    return Err(SnapshotError::TargetOfOtherSide { column, unit, target, side });
                }
            }
        }
        Ok(())
    }

    fn check_references(&self, arena: &Arena) -> Result<(), SnapshotError> {
        let Sizes { n_agents, .. } = arena.sizes();
        self.check_targets(arena)?;
        // Targets may be dead: phase 1 drops them. The neighbour order must contain living units only, since
        // collision avoidance trusts it.
        if let Some(plane) = self.neighbour_order.invalid_plane(arena, &self.types, &self.units) {
            let given = self.neighbour_order.planes[plane as usize].clone();
            return Err(SnapshotError::NeighbourOrder { plane, given });
        }
        for (place, &action) in self.last_actions.iter().enumerate() {
            let actor = Actor::at(place, n_agents);
            let n_actions = arena.n_actions(actor.faction());
            if let Some(action) = action.filter(|&action| action as usize >= n_actions) {
                let (column, action) = ("last_action", i64::from(action));
                return Err(SnapshotError::NoSuchAction { column, actor, action, n_actions });
            }
        }
        if let Some(interface) = arena.interface() {
            interface.check_words(&self.perception)?;
        }
        let is_playable = self.opponent != Opponent::Learner || arena.sides().are_both();
        if is_playable { Ok(()) } else { Err(SnapshotError::OneSide) }
    }
}

/// The numbers of a unit's phase with their ranges: each time is set to at most its greatest value, and
/// counted down from there.
fn phase_values(arena: &Arena, phase: &AttackPhase, stats: &UnitType) -> [Ranged; 11] {
    let [low, high] = [arena.extent.low, arena.extent.high].map(|corner| corner.as_dvec2());
    let within = |column, value: f64, min, max| Ranged { column, value, min, max };
    let conduct = &stats.conduct;
    [
        within("windup", phase.windup, 0.0, conduct.damage_point),
        within("backswing", phase.backswing, 0.0, conduct.backswing),
        within("look", phase.look, 0.0, LOOK_INTERVAL),
        within("hit_time", phase.hit_time, 0.0, MAX_FLIGHT),
        within("hit_at", phase.hit_at.x.into(), low.x, high.x),
        within("hit_at", phase.hit_at.y.into(), low.y, high.y),
        within("goal", phase.goal.x.into(), low.x, high.x),
        within("goal", phase.goal.y.into(), low.y, high.y),
        within("facing", phase.facing.x.into(), -1.0, 1.0),
        within("facing", phase.facing.y.into(), -1.0, 1.0),
        within("hits", phase.hits.into(), 0.0, stats.attacks.into()),
    ]
}
