//! Writing records, of battles in place and of snapshots.

use super::Snapshot;
use super::columns::{COLUMN_COUNT, Column};
use super::record::{MAGIC, RECORD_VERSION, RecordLayout, RecordSizes};
use crate::arena::Arena;
use crate::battle::Battle;
use crate::neighbour_order::NeighbourOrder;
use crate::opponents::Opponent;
use crate::random::StreamPosition;
use crate::units::Units;

/// What a record holds, by reference.
struct State<'a, T, P> {
    /// The types of the units.
    types: T,
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

impl<T: Iterator<Item = u32>, P: Iterator<Item = u64>> State<'_, T, P> {
    /// `past_actions` are the last joint actions of the episode, `[n_known, n_actors]`, the newest first.
    fn write(self, layout: &RecordLayout, arena: &Arena, past_actions: &[i32], record: &mut [u8]) {
        let RecordSizes { n_agents, n_enemies, n_past, n_perception } = layout.sizes;
        let known = (past_actions.len() / arena.sizes().n_actors()) as u32;
        let sizes = [n_agents, n_enemies, n_past, n_perception].map(|size| size as u32);
        let [n_agents, n_enemies, n_past, n_perception] = sizes;
        let header = [MAGIC, 0, RECORD_VERSION, n_agents, n_enemies, n_past, n_perception, known];
        record[..size_of_val(&header)].copy_from_slice(bytemuck::cast_slice(&header));
        layout.put(record, Column::Scenario, &[arena.scenario_hash()]);
        layout.put(record, Column::Seed, &[self.position.seed]);
        layout.put(record, Column::Draws, &[self.position.draws]);
        layout.put(record, Column::EpisodeReturn, &[self.episode_return]);
        layout.put(record, Column::EpisodeLength, &[self.episode_length]);
        layout.put(record, Column::Opponent, &[self.opponent.index() as u32]);
        self.write_units(layout, record);
        let number = |number: &Option<u32>| number.map_or(-1, |number| number as i32);
        layout.put_each(record, Column::Target, self.units.target.iter().map(number));
        layout.put_each(record, Column::LastAction, self.last_actions.iter().map(number));
        let past = layout.column_mut(record, Column::PastActions);
        past.fill(0xff); // -1
        let row_len = (n_agents + n_enemies) as usize * size_of::<i32>();
        for (row, actions) in
            past.chunks_exact_mut(row_len).zip(past_actions.chunks_exact(arena.sizes().n_actors()))
        {
            row[..size_of_val(actions)].copy_from_slice(bytemuck::cast_slice(actions));
        }
        self.write_neighbour_order(layout, record);
        layout.put_each(record, Column::UnitType, self.types);
        layout.put_each(record, Column::Perception, self.perception);
        record[layout.offsets[COLUMN_COUNT]..].fill(0);
        layout.seal(record);
    }

    fn write_units(&self, layout: &RecordLayout, record: &mut [u8]) {
        let units = self.units;
        layout.put(record, Column::Hp, &units.hp);
        layout.put(record, Column::Shield, &units.shield);
        layout.put(record, Column::Energy, &units.energy);
        layout.put(record, Column::Cooldown, &units.cooldown);
        layout.put(record, Column::ShieldCooldown, &units.shield_cooldown);
        layout.put(record, Column::Healing, &units.healing);
        layout.put(record, Column::Pos, &units.pos);
        layout.put(record, Column::Vel, &units.vel);
        layout.put(record, Column::PlannedVel, &units.planned_vel);
        layout.put_each(record, Column::Alive, units.alive.iter().map(|alive| u8::from(*alive)));
        layout.put_each(record, Column::Declared, units.declared.iter().map(|declared| u8::from(*declared)));
    }

    fn write_neighbour_order(&self, layout: &RecordLayout, record: &mut [u8]) {
        for column in [Column::NeighbourRank, Column::NeighbourNumber] {
            let out = layout.column_mut(record, column);
            out.fill(0xff); // -1
            for plane in &self.neighbour_order.planes {
                let order = if column == Column::NeighbourRank { &plane.list } else { &plane.by_number };
                for (place, id) in (0i32..).zip(order) {
                    let at = *id as usize * size_of::<i32>();
                    out[at..at + size_of::<i32>()].copy_from_slice(&place.to_le_bytes());
                }
            }
        }
    }
}

impl Battle {
    /// Writes the state of the battle, and the last joint actions of the episode, `[n_known, n_actors]` with
    /// the numbers that the arena's joint actions have, the newest first, as a record of this layout.
    ///
    /// # Panics
    /// If the layout is of other sizes, `record` of another length, or there are more than `n_past` actions.
    pub fn write_record(&self, layout: &RecordLayout, past_actions: &[i32], record: &mut [u8]) {
        let state = State {
            types: self.arena().type_indices(),
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
            types: self.types.iter().copied(),
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
