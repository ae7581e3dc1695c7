//! How episodes begin: by a reset, with a level, from a snapshot; and the snapshots of battles.

use super::Battle;
use crate::buffers::refill;
use crate::level::{self, LevelError};
use crate::opponents::Opponent;
use crate::random::StreamPosition;
use crate::snapshot::{Snapshot, SnapshotError};
use std::sync::Arc;

impl Battle {
    /// Begins a new episode, with an opponent that is drawn if there are several. The generator is not reset.
    pub fn reset(&mut self) {
        let opponent = self.arena.opponents().draw(&mut self.generator);
        self.reset_against(opponent);
    }

    /// Begins a new episode against this opponent. Only the units are drawn, if the scenario is generated.
    /// [`Opponent::Learner`] is for arenas whose actions play both sides; in others no snapshot of
    /// the episode can be restored.
    pub fn reset_against(&mut self, opponent: Opponent) {
        self.start = self.generator.position();
        self.draw_units();
        self.units.reset(&self.arena);
        level::describe(&self.arena, &self.units, &mut self.level);
        self.begin_episode(opponent);
    }

    /// Begins a new episode with a level, see [`LEVEL_COLUMNS`](crate::LEVEL_COLUMNS). An opponent is drawn
    /// if there are several; no units are.
    ///
    /// # Errors
    /// As [`Arena::check_level`](crate::Arena::check_level); then the battle is unchanged.
    pub fn reset_to(&mut self, level: &[f32]) -> Result<(), LevelError> {
        self.arena.check_level(level)?;
        self.reset_to_checked(level);
        Ok(())
    }

    /// As [`reset_to`](Self::reset_to) of a level that was [checked](crate::Arena::check_level).
    pub fn reset_to_checked(&mut self, level: &[f32]) {
        debug_assert_eq!(self.arena.check_level(level), Ok(()));
        let opponent = self.arena.opponents().draw(&mut self.generator);
        let mut types = std::mem::take(&mut self.types);
        self.arena.level_types(level, &mut types);
        self.set_types(&types);
        self.types = types;
        self.units.reset(&self.arena);
        self.units.set_level(&self.arena, level);
        refill(&mut self.level, level.iter().copied());
        self.begin_episode(opponent);
    }

    /// Begins an episode with the units as they are.
    fn begin_episode(&mut self, opponent: Opponent) {
        self.opponent = opponent;
        self.neighbour_order.reset(&self.arena, self.arena.type_indices(), &self.units);
        refill(&mut self.last_actions, self.arena.unit_ids().map(|_| None));
        self.episode_length = 0;
        self.episode_return = 0.0;
        self.clear_shares();
        if let (Some(perceiver), Some(interface)) = (&mut self.perceiver, self.arena.interface()) {
            perceiver.begin(interface, &self.arena, &self.units, &mut self.generator);
        }
        self.refresh_derived();
    }

    /// Lets the agents look again, without a step. Only with SMACv2's interface, where not all agents may see
    /// an enemy or with the faults of the published code, it changes what they see.
    pub fn perceive_again(&mut self) {
        if let (Some(perceiver), Some(interface)) = (&mut self.perceiver, self.arena.interface()) {
            perceiver.perceive(interface, &mut self.generator);
        }
    }

    /// Where the generator was when the units of this episode were drawn: with it and the same opponent the
    /// episode begins again. Battles of fixed scenarios draw none, so the generator is there after a reset.
    pub fn start(&self) -> StreamPosition {
        self.start
    }

    /// Draws the units of a generated scenario.
    fn draw_units(&mut self) {
        let Some(drawer) = self.arena.drawer() else { return };
        let mut share = || self.generator.next_f64();
        drawer.draw(&mut share, &mut self.drawn);
        drawer.place(&mut share, &mut self.drawn);
        // Memory is allocated at the first reset alone, when the arena is still shared with other battles.
        let arena = Arc::make_mut(&mut self.arena);
        arena.set_drawn(self.drawn.allies.iter().chain(&self.drawn.enemies).copied());
        self.tables.set_types(arena);
    }

    /// Lets the units have the types of a snapshot or of a level.
    fn set_types(&mut self, types: &[u32]) {
        if !self.arena.type_indices().eq(types.iter().copied()) {
            let arena = Arc::make_mut(&mut self.arena);
            arena.set_types(types.iter().copied());
            self.tables.set_types(arena);
        }
    }

    /// The state of the battle, from which it continues with the same bits.
    pub fn save(&self) -> Snapshot {
        let mut snapshot = Snapshot::default();
        self.save_into(&mut snapshot);
        snapshot
    }

    /// As [`save`](Self::save), into the memory of another snapshot.
    pub fn save_into(&self, snapshot: &mut Snapshot) {
        refill(&mut snapshot.types, self.arena.type_indices());
        snapshot.units.copy_from(&self.units);
        snapshot.neighbour_order.copy_from(&self.neighbour_order);
        snapshot.last_actions.clone_from(&self.last_actions);
        snapshot.opponent = self.opponent;
        snapshot.generator.clone_from(&self.generator);
        snapshot.episode_length = self.episode_length;
        snapshot.episode_return = self.episode_return;
        refill(&mut snapshot.perception, self.perception_words());
    }

    /// What the agents perceived, as the column of a snapshot; nothing without SMACv2's interface.
    pub(crate) fn perception_words(&self) -> impl Iterator<Item = u64> {
        self.perceiver.iter().flat_map(|perceiver| perceiver.words())
    }

    /// Sets the battle to the state of a snapshot of the same arena.
    ///
    /// # Errors
    /// The first value of the snapshot that this arena does not allow; then the battle is unchanged.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), SnapshotError> {
        snapshot.check(&self.arena)?;
        self.restore_checked(snapshot);
        Ok(())
    }

    /// As [`restore`](Self::restore) of a snapshot that was checked for this arena, as
    /// [`Snapshot::read_record`] does, or is of a battle in it.
    pub fn restore_checked(&mut self, snapshot: &Snapshot) {
        debug_assert_eq!(snapshot.check(&self.arena), Ok(()));
        self.set_types(&snapshot.types);
        self.units.copy_from(&snapshot.units);
        self.neighbour_order.copy_from(&snapshot.neighbour_order);
        self.last_actions.clone_from(&snapshot.last_actions);
        self.opponent = snapshot.opponent;
        self.generator = snapshot.generator.clone();
        self.episode_length = snapshot.episode_length;
        self.episode_return = snapshot.episode_return;
        self.clear_shares();
        level::describe(&self.arena, &self.units, &mut self.level);
        if let (Some(perceiver), Some(interface)) = (&mut self.perceiver, self.arena.interface()) {
            perceiver.load(
                interface,
                &self.arena,
                &self.units,
                &snapshot.perception,
                snapshot.episode_length,
            );
        }
        self.refresh_derived();
    }
}
