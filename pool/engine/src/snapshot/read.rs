//! Snapshots that are read from records.

use super::columns::Column;
use super::record::{RecordLayout, RecordSizes};
use super::{Snapshot, SnapshotError};
use crate::arena::Arena;
use crate::buffers::refill;
use crate::command::action;
use crate::neighbour_order::NeighbourOrder;
use crate::opponents::Opponent;
use crate::random::{Generator, StreamPosition};
use crate::rules::Rules;
use crate::sides::Actor;
use crate::sizes::Sizes;
use crate::units::AttackPhase;
use smaclite_scenarios::Faction;

impl Snapshot {
    /// The snapshot of a record whose columns were edited, and the last joint actions. Where units were
    /// killed or revived, or got a type of another plane, the order of equally near neighbours begins anew.
    /// By the rules `starcraft`, where what is in flight would hit them, the dead have no health.
    ///
    /// # Errors
    /// As [`read_record`](Self::read_record).
    pub fn of_edited_record(
        arena: &Arena,
        n_past: usize,
        record: &[u8],
    ) -> Result<(Snapshot, Vec<i32>), SnapshotError> {
        let (mut snapshot, mut past_actions) = (Snapshot::default(), Vec::new());
        snapshot.read_unchecked(arena, n_past, record, &mut past_actions)?;
        let Snapshot { units, types, neighbour_order, .. } = &mut snapshot;
        // A type of another plane leaves a gap in the order of one plane, and is a stranger in the other.
        let is_of_others = !neighbour_order.is_of_living(arena, units)
            || arena.drawer().is_some() && neighbour_order.invalid_plane(arena, types, units).is_some();
        if is_of_others {
            *neighbour_order = NeighbourOrder::new(arena, types, units);
        }
        if arena.rules() == Rules::Starcraft {
            let dead = units.hp.iter_mut().zip(&units.alive).filter(|(_, alive)| !**alive);
            dead.for_each(|(hp, _)| *hp = 0.0);
        }
        snapshot.check(arena)?;
        Ok((snapshot, past_actions))
    }

    /// Replaces the snapshot by that of a record, and `past_actions` by the last joint actions. Memory is
    /// kept.
    ///
    /// # Errors
    /// If the bytes are no record of this arena with so many past actions, or a value is impossible. Then
    /// snapshot and actions are of no use.
    pub fn read_record(
        &mut self,
        arena: &Arena,
        n_past: usize,
        record: &[u8],
        past_actions: &mut Vec<i32>,
    ) -> Result<(), SnapshotError> {
        self.read_unchecked(arena, n_past, record, past_actions)?;
        self.check(arena)
    }

    fn read_unchecked(
        &mut self,
        arena: &Arena,
        n_past: usize,
        record: &[u8],
        past_actions: &mut Vec<i32>,
    ) -> Result<(), SnapshotError> {
        let layout = RecordLayout::of(record)?;
        let (scenario, expected) = (layout.get_one::<u64>(record, Column::Scenario), arena.scenario_hash());
        let given = layout.sizes.n_past;
        let rules = layout.rules(record)?;
        if rules != arena.rules() {
            return Err(SnapshotError::OtherRules { given: rules, expected: arena.rules() });
        }
        if scenario != expected || layout.sizes != RecordSizes::new(&arena.sizes(), given) {
            return Err(SnapshotError::OtherScenario { given: scenario, expected });
        }
        if given != n_past {
            return Err(SnapshotError::PastActions { given, expected: n_past });
        }
        self.read_units(arena, &layout, record)?;
        refill(&mut self.perception, layout.get(record, Column::Perception));
        refill(&mut self.types, layout.get_by_id(record, Column::UnitType, arena));
        self.check_types(arena)?;
        self.neighbour_order.read(arena, &self.types, &layout, record)?;
        let last_actions = numbers(&layout, record, Column::LastAction)?.enumerate();
        refill(
            &mut self.last_actions,
            last_actions
                .map(|(place, action)| action.map(|action| in_battle(arena, place, action as i32) as u32)),
        );
        let at = StreamPosition {
            seed: layout.get_one(record, Column::Seed),
            draws: layout.get_one(record, Column::Draws),
        };
        if self.generator.position() != at {
            self.generator = Generator::from(at);
        }
        self.episode_length = layout.get_one(record, Column::EpisodeLength);
        self.episode_return = layout.get_one(record, Column::EpisodeReturn);
        let opponent: u32 = layout.get_one(record, Column::Opponent);
        let (known, n_opponents) = (Opponent::ALL.get(opponent as usize), Opponent::ALL.len());
        let error = SnapshotError::NoSuchOpponent { given: opponent, n_opponents };
        self.opponent = *known.ok_or(error)?;
        read_past_actions(arena, &layout, record, past_actions)
    }

    fn read_units(
        &mut self,
        arena: &Arena,
        layout: &RecordLayout,
        record: &[u8],
    ) -> Result<(), SnapshotError> {
        let units = &mut self.units;
        refill(&mut units.hp, layout.get_by_id(record, Column::Hp, arena));
        refill(&mut units.shield, layout.get_by_id(record, Column::Shield, arena));
        refill(&mut units.energy, layout.get_by_id(record, Column::Energy, arena));
        refill(&mut units.cooldown, layout.get_by_id(record, Column::Cooldown, arena));
        refill(&mut units.shield_cooldown, layout.get_by_id(record, Column::ShieldCooldown, arena));
        refill(&mut units.healing, layout.get_by_id(record, Column::Healing, arena));
        refill(&mut units.pos, layout.get_by_id(record, Column::Pos, arena));
        refill(&mut units.vel, layout.get_by_id(record, Column::Vel, arena));
        refill(&mut units.planned_vel, layout.get_by_id(record, Column::PlannedVel, arena));
        check_flags(layout, record, Column::Alive)?;
        check_flags(layout, record, Column::Declared)?;
        let is_set = |flag: u8| flag == 1;
        refill(&mut units.alive, layout.get_by_id(record, Column::Alive, arena).map(is_set));
        refill(&mut units.declared, layout.get_by_id(record, Column::Declared, arena).map(is_set));
        check_targets(layout, record, Column::Target)?;
        let target = |place: i32| usize::try_from(place).ok().map(|place| arena.id_at(place));
        refill(&mut units.target, layout.get_by_id(record, Column::Target, arena).map(target));
        if layout.sizes.n_phases > 0 {
            return read_phases(&mut units.phases, arena, layout, record);
        }
        units.phases.clear();
        Ok(())
    }
}

/// Reads the columns of phases.
fn read_phases(
    phases: &mut Vec<AttackPhase>,
    arena: &Arena,
    layout: &RecordLayout,
    record: &[u8],
) -> Result<(), SnapshotError> {
    for column in [Column::AttackTarget, Column::LastAttacked, Column::HitTarget] {
        check_targets(layout, record, column)?;
    }
    let times = |column| layout.get_by_id::<f64>(record, column, arena);
    let targets = |column| {
        let places = layout.get_by_id::<i32>(record, column, arena);
        places.map(|place| usize::try_from(place).ok().map(|place| arena.id_at(place)))
    };
    refill(phases, arena.unit_ids().map(|_| AttackPhase::default()));
    phases.iter_mut().zip(times(Column::Windup)).for_each(|(phase, time)| phase.windup = time);
    phases.iter_mut().zip(times(Column::Backswing)).for_each(|(phase, time)| phase.backswing = time);
    phases.iter_mut().zip(times(Column::Look)).for_each(|(phase, time)| phase.look = time);
    phases.iter_mut().zip(times(Column::HitTime)).for_each(|(phase, time)| phase.hit_time = time);
    let hit_at = layout.get_by_id(record, Column::HitAt, arena);
    phases.iter_mut().zip(hit_at).for_each(|(phase, at)| phase.hit_at = at);
    phases.iter_mut().zip(targets(Column::AttackTarget)).for_each(|(phase, target)| phase.target = target);
    phases.iter_mut().zip(targets(Column::LastAttacked)).for_each(|(phase, last)| phase.last = last);
    phases.iter_mut().zip(targets(Column::HitTarget)).for_each(|(phase, of)| phase.hit_target = of);
    let goals = layout.get_by_id(record, Column::Goal, arena);
    phases.iter_mut().zip(goals).for_each(|(phase, goal)| phase.goal = goal);
    let facings = layout.get_by_id(record, Column::Facing, arena);
    phases.iter_mut().zip(facings).for_each(|(phase, facing)| phase.facing = facing);
    check_flags(layout, record, Column::IsAlarmed)?;
    let alarmed = layout.get_by_id::<u8>(record, Column::IsAlarmed, arena);
    phases.iter_mut().zip(alarmed).for_each(|(phase, flag)| phase.is_alarmed = flag == 1);
    let hits = layout.get_by_id(record, Column::Hits, arena);
    phases.iter_mut().zip(hits).for_each(|(phase, hits)| phase.hits = hits);
    Ok(())
}

impl NeighbourOrder {
    /// `types` are those of the units, checked.
    fn read(
        &mut self,
        arena: &Arena,
        types: &[u32],
        layout: &RecordLayout,
        record: &[u8],
    ) -> Result<(), SnapshotError> {
        self.planes.iter_mut().for_each(|plane| {
            plane.list.clear();
            plane.by_number.clear();
        });
        for column in [Column::NeighbourRank, Column::NeighbourNumber] {
            for (id, number) in arena.ids_by_place().zip(layout.get::<i32>(record, column)) {
                let plane = arena.types()[types[id as usize] as usize].plane;
                let plane = &mut self.planes[plane as usize];
                let order =
                    if column == Column::NeighbourRank { &mut plane.list } else { &mut plane.by_number };
                let Ok(number) = usize::try_from(number) else { continue };
                if number >= arena.sizes().n_units() {
                    let (unit, max) = (arena.place(id), arena.sizes().n_units() as f64 - 1.0);
                    let (column, value) = (column.name(), number as f64);
                    return Err(SnapshotError::OutOfRange { column, unit, value, min: -1.0, max });
                }
                if order.len() <= number {
                    order.resize(number + 1, u32::MAX);
                }
                order[number] = id; // gaps and double numbers are found by the check of the whole order
            }
        }
        Ok(())
    }
}

/// The action of a unit with the directions of the map, of one with those that its side sees; and the other
/// way round. Records are the same whatever enemies see.
pub(super) fn in_battle(arena: &Arena, place: usize, action: i32) -> i32 {
    let is_reflected = place >= arena.agents.len() && arena.sides().are_mirrored();
    if is_reflected && action >= 0 { action::mirrored(action as usize) as i32 } else { action }
}

/// A column of numbers, -1 for none.
fn numbers<'a>(
    layout: &RecordLayout,
    record: &'a [u8],
    column: Column,
) -> Result<impl Iterator<Item = Option<u32>> + use<'a>, SnapshotError> {
    let values = || layout.get::<i32>(record, column);
    if let Some((unit, value)) = values().enumerate().find(|(_, value)| *value < -1) {
        let (column, min, max) = (column.name(), -1.0, f64::from(i32::MAX));
        return Err(SnapshotError::OutOfRange { column, unit, value: f64::from(value), min, max });
    }
    Ok(values().map(|number| u32::try_from(number).ok()))
}

/// Checks a column of 0 and 1.
fn check_flags(layout: &RecordLayout, record: &[u8], column: Column) -> Result<(), SnapshotError> {
    let flags = layout.column(record, column).iter().enumerate();
    match { flags }.find(|(_, flag)| **flag > 1) {
        Some((unit, flag)) => {
            let (column, value) = (column.name(), f64::from(*flag));
            Err(SnapshotError::OutOfRange { column, unit, value, min: 0.0, max: 1.0 })
        }
        None => Ok(()),
    }
}

/// Checks the places of targets, -1 for none.
fn check_targets(layout: &RecordLayout, record: &[u8], column: Column) -> Result<(), SnapshotError> {
    let n_units = layout.shape(Column::Target)[0];
    let targets = layout.get::<i32>(record, column).enumerate();
    match { targets }.find(|(_, target)| !(-1..n_units as i64).contains(&i64::from(*target))) {
        Some((unit, target)) => {
            let (column, target) = (column.name(), target.into());
            Err(SnapshotError::NoSuchTarget { column, unit, target, n_units })
        }
        None => Ok(()),
    }
}

fn read_past_actions(
    arena: &Arena,
    layout: &RecordLayout,
    record: &[u8],
    past_actions: &mut Vec<i32>,
) -> Result<(), SnapshotError> {
    let Sizes { n_agents, .. } = arena.sizes();
    let (n_actors, n_units) = (arena.sizes().n_actors(), arena.sizes().n_units());
    let known: u32 = layout.get_one(record, Column::NKnown);
    if known as usize > layout.sizes.n_past {
        return Err(SnapshotError::PastActions { given: known as usize, expected: layout.sizes.n_past });
    }
    past_actions.clear();
    let actions = layout.get::<i32>(record, Column::PastActions).take(known as usize * n_units);
    for (i, action) in actions.enumerate() {
        let actor = Actor::at(i % n_units, n_agents);
        let n_actions = arena.n_actions(actor.faction());
        let least = if actor.faction() == Faction::Ally { 0 } else { -1 };
        if !(least..n_actions as i64).contains(&action.into()) {
            let (column, action) = (Column::PastActions.name(), action.into());
            return Err(SnapshotError::NoSuchAction { column, actor, action, n_actions });
        }
        if i % n_units < n_actors {
            // Enemies that a script plays have none.
            past_actions.push(in_battle(arena, i % n_units, action).max(action::NO_OP as i32));
        }
    }
    Ok(())
}
