//! Writing records, of battles in place and of snapshots.

use super::Snapshot;
use super::columns::{COLUMN_COUNT, Column};
use super::read::in_battle;
use super::record::{MAGIC, RECORD_VERSION, RecordLayout, RecordSizes};
use crate::arena::Arena;
use crate::battle::Battle;
use crate::neighbour_order::NeighbourOrder;
use crate::opponents::Opponent;
use crate::random::StreamPosition;
use crate::units::Units;
use bytemuck::Pod;

/// What a record holds, by reference.
struct State<'a, T, P> {
    /// The type of a unit, by battle-wide id.
    type_of: T,
    units: &'a Units,
    neighbour_order: &'a NeighbourOrder,
    last_actions: &'a [Option<u32>],
    position: StreamPosition,
    episode_length: u32,
    episode_return: f64,
    opponent: Opponent,
    /// What the agents perceived.
    perception: P,
}

impl<T: Fn(usize) -> u32, P: Iterator<Item = u64>> State<'_, T, P> {
    /// `past_actions` are the last joint actions of the episode, `[n_known, n_actors]`, the newest first.
    fn write(self, layout: &RecordLayout, arena: &Arena, past_actions: &[i32], record: &mut [u8]) {
        let RecordSizes { n_agents, n_enemies, n_past, n_perception, n_phases } = layout.sizes;
        let known = (past_actions.len() / arena.sizes().n_actors()) as u32;
        let sizes = [n_agents, n_enemies, n_past, n_perception, n_phases].map(|size| size as u32);
        let [n_agents, n_enemies, n_past, n_perception, n_phases] = sizes;
        let rules = arena.rules as u32;
        let header =
            [MAGIC, 0, RECORD_VERSION, n_agents, n_enemies, n_past, n_perception, n_phases, rules, known];
        record[..size_of_val(&header)].copy_from_slice(bytemuck::cast_slice(&header));
        layout.put(record, Column::Scenario, &[arena.scenario_hash()]);
        layout.put(record, Column::Seed, &[self.position.seed]);
        layout.put(record, Column::Draws, &[self.position.draws]);
        layout.put(record, Column::EpisodeReturn, &[self.episode_return]);
        layout.put(record, Column::EpisodeLength, &[self.episode_length]);
        layout.put(record, Column::Opponent, &[self.opponent.index() as u32]);
        self.write_units(layout, arena, record);
        if layout.sizes.n_phases > 0 {
            self.write_phases(layout, arena, record);
        }
        let number = |number: &Option<u32>| number.map_or(-1, |number| number as i32);
        let in_battle = |(place, action)| in_battle(arena, place, number(action));
        layout.put_each(record, Column::LastAction, self.last_actions.iter().enumerate().map(in_battle));
        self.write_past_actions(layout, arena, past_actions, record);
        self.write_neighbour_order(layout, arena, record);
        layout.put_each(record, Column::Perception, self.perception);
        record[layout.offsets[COLUMN_COUNT]..].fill(0);
        layout.seal(record);
    }

    /// The columns of units, which are by battle-wide id here, by place in a record.
    fn write_units(&self, layout: &RecordLayout, arena: &Arena, record: &mut [u8]) {
        let units = self.units;
        put_units(layout, arena, record, Column::Hp, &units.hp);
        put_units(layout, arena, record, Column::Shield, &units.shield);
        put_units(layout, arena, record, Column::Energy, &units.energy);
        put_units(layout, arena, record, Column::Cooldown, &units.cooldown);
        put_units(layout, arena, record, Column::ShieldCooldown, &units.shield_cooldown);
        put_units(layout, arena, record, Column::Healing, &units.healing);
        put_units(layout, arena, record, Column::Pos, &units.pos);
        put_units(layout, arena, record, Column::Vel, &units.vel);
        put_units(layout, arena, record, Column::PlannedVel, &units.planned_vel);
        let ids = || arena.ids_by_place().map(|id| id as usize);
        let target = |id: usize| units.target[id].map_or(-1, |target| arena.place(target) as i32);
        layout.put_each(record, Column::Target, ids().map(target));
        layout.put_each(record, Column::Alive, ids().map(|id| u8::from(units.alive[id])));
        layout.put_each(record, Column::Declared, ids().map(|id| u8::from(units.declared[id])));
        layout.put_each(record, Column::UnitType, ids().map(&self.type_of));
    }

    /// The columns of phases, which only rules `starcraft` have.
    fn write_phases(&self, layout: &RecordLayout, arena: &Arena, record: &mut [u8]) {
        let phases = || arena.ids_by_place().filter_map(|id| self.units.phases.get(id as usize));
        let place = |id: Option<u32>| id.map_or(-1, |id| arena.place(id) as i32);
        layout.put_each(record, Column::Windup, phases().map(|phase| phase.windup));
        layout.put_each(record, Column::Backswing, phases().map(|phase| phase.backswing));
        layout.put_each(record, Column::Look, phases().map(|phase| phase.look));
        layout.put_each(record, Column::HitTime, phases().map(|phase| phase.hit_time));
        layout.put_each(record, Column::HitAt, phases().map(|phase| phase.hit_at));
        layout.put_each(record, Column::Goal, phases().map(|phase| phase.goal));
        layout.put_each(record, Column::Facing, phases().map(|phase| phase.facing));
        layout.put_each(record, Column::IsAlarmed, phases().map(|phase| u8::from(phase.is_alarmed)));
        layout.put_each(record, Column::AttackTarget, phases().map(|phase| place(phase.target)));
        layout.put_each(record, Column::LastAttacked, phases().map(|phase| place(phase.last)));
        layout.put_each(record, Column::HitTarget, phases().map(|phase| place(phase.hit_target)));
        layout.put_each(record, Column::Hits, phases().map(|phase| phase.hits));
    }

    /// Enemies that a script plays have no actions in a record, also if a lane keeps some for them.
    fn write_past_actions(
        &self,
        layout: &RecordLayout,
        arena: &Arena,
        past_actions: &[i32],
        record: &mut [u8],
    ) {
        let RecordSizes { n_agents, n_enemies, .. } = layout.sizes;
        let n_actors = arena.sizes().n_actors();
        let n_played = if self.opponent == Opponent::Learner { n_actors } else { n_agents };
        let past = layout.column_mut(record, Column::PastActions);
        past.fill(0xff); // -1
        let rows = past.chunks_exact_mut((n_agents + n_enemies) * size_of::<i32>());
        for (row, actions) in rows.zip(past_actions.chunks_exact(n_actors)) {
            let played = &actions[..n_played];
            for (place, (out, action)) in row.chunks_exact_mut(size_of::<i32>()).zip(played).enumerate() {
                out.copy_from_slice(&in_battle(arena, place, *action).to_le_bytes());
            }
        }
    }

    fn write_neighbour_order(&self, layout: &RecordLayout, arena: &Arena, record: &mut [u8]) {
        for column in [Column::NeighbourRank, Column::NeighbourNumber] {
            let out = layout.column_mut(record, column);
            out.fill(0xff); // -1
            for plane in &self.neighbour_order.planes {
                let order = if column == Column::NeighbourRank { &plane.list } else { &plane.by_number };
                for (number, id) in (0i32..).zip(order) {
                    let at = arena.place(*id) * size_of::<i32>();
                    out[at..at + size_of::<i32>()].copy_from_slice(&number.to_le_bytes());
                }
            }
        }
    }
}

/// Writes a column of units; `values` are by battle-wide id.
fn put_units<T: Pod>(layout: &RecordLayout, arena: &Arena, record: &mut [u8], column: Column, values: &[T]) {
    if arena.ids_are_places {
        return layout.put(record, column, values);
    }
    layout.put_each(record, column, arena.ids_by_place().map(|id| values[id as usize]));
}

impl Battle {
    /// The state of the battle as a record without past actions.
    pub fn record(&self) -> Vec<u8> {
        let layout = RecordLayout::new(RecordSizes::new(&self.arena().sizes(), 0));
        let mut record = vec![0; layout.size()];
        self.write_record(&layout, &[], &mut record);
        record
    }

    /// Writes the state of the battle, and the last joint actions of the episode, `[n_known, n_actors]` with
    /// the numbers that the arena's joint actions have, the newest first, as a record of this layout.
    ///
    /// # Panics
    /// If the layout is of other sizes, `record` of another length, or there are more than `n_past` actions.
    pub fn write_record(&self, layout: &RecordLayout, past_actions: &[i32], record: &mut [u8]) {
        let state = State {
            type_of: |id: usize| self.arena().approaches[id].unit_type,
            units: self.units(),
            neighbour_order: self.neighbour_order(),
            last_actions: self.last_actions(),
            position: self.generator().position(),
            episode_length: self.episode_length(),
            episode_return: self.episode_return(),
            opponent: self.opponent(),
            perception: self.perception_words(),
        };
        state.write(layout, self.arena(), past_actions, record);
    }
}

impl Snapshot {
    /// Writes the snapshot as [`Battle::write_record`] does.
    ///
    /// # Panics
    /// As [`Battle::write_record`].
    pub fn write_record(
        &self,
        arena: &Arena,
        layout: &RecordLayout,
        past_actions: &[i32],
        record: &mut [u8],
    ) {
        let state = State {
            type_of: |id: usize| self.types[id],
            units: &self.units,
            neighbour_order: &self.neighbour_order,
            last_actions: &self.last_actions,
            position: self.generator.position(),
            episode_length: self.episode_length,
            episode_return: self.episode_return,
            opponent: self.opponent,
            perception: self.perception.iter().copied(),
        };
        state.write(layout, arena, past_actions, record);
    }
}
