//! What a battle shows: available actions, observations, states, and its numbers.

use smaclite_scenarios::Faction;

use super::Battle;
use crate::encode::{self, Available, UnitFeatures};
use crate::neighbour_order::NeighbourOrder;
use crate::opponents::Opponent;
use crate::scratch::Scratch;
use crate::smacv2::{Frame, Interface, Perception};
use crate::units::Units;

impl Battle {
    /// The actions available to an agent: bit `a % 64` of word `a / 64` for action `a`.
    ///
    /// # Panics
    /// If there is no such agent.
    pub fn available(&self, agent: usize) -> &[u64] {
        self.available.of(agent)
    }

    /// The actions available to all units of a side that joint actions play: [`available`](Self::available),
    /// unit by unit.
    pub fn available_bits(&self, side: Faction) -> &[u64] {
        self.available_of(side).all()
    }

    pub(crate) fn available_of(&self, side: Faction) -> &Available {
        match side {
            Faction::Ally => &self.available,
            Faction::Enemy => &self.enemy_available,
        }
    }

    /// What plays the enemies in this episode.
    pub fn opponent(&self) -> Opponent {
        self.opponent
    }

    /// Whether an action is available to an agent; false if there is no such agent or action.
    pub fn is_available(&self, agent: usize, action: usize) -> bool {
        agent < self.arena.agents.len() && self.available.has(agent, action)
    }

    /// Writes the observations of all units of a side that joint actions play: f32 `[n_units, obs_size]`, all
    /// zeros for the dead, and for enemies that a script plays.
    ///
    /// A row consists of, as the side sees it,
    /// - whether the moves north, south, east and west are available: 0 or 1;
    /// - for each enemy: whether the target action of its number is available, distance, dx, dy, health,
    ///   \[shield\], \[type\];
    /// - for each other ally: 1, distance, dx, dy, health, \[shield\], \[type\];
    /// - own health, \[shield\], \[type\].
    ///
    /// Distances are divided by the sight range of 9 squares, health and shield by their maximum. Blocks of
    /// units that are dead or not nearer than the sight range are zero.
    ///
    /// `out` may have longer rows, `[n_units, more than obs_size]`: the rest of each row becomes 0.
    ///
    /// # Panics
    /// If `out` has another size than the [side's](crate::Arena::sizes_of).
    pub fn write_obs(&self, side: Faction, out: &mut [f32], scratch: &mut Scratch) {
        if let (Faction::Ally, Some(perceiver), Some(interface)) =
            (side, &self.perceiver, self.arena.interface())
        {
            let last_actions = self.last_actions_of(side);
            return interface.write_obs(perceiver.frame(), perceiver.perception(), last_actions, out);
        }
        encode::write_obs(&self.view(side), out, &mut scratch.obs);
    }

    /// Writes the state for a side that joint actions play: f32 `[state_size]`.
    ///
    /// It consists of, where the units of the side are its agents,
    /// - for each agent: health, cooldown (energy for healers), x, y, \[shield\], \[type\];
    /// - for each enemy: health, x, y, \[shield\], \[type\];
    /// - for each agent: a one-hot of its last action, all zeros after a reset.
    ///
    /// x and y are relative to the centre of the map and divided by its sides, the other values by their
    /// maximum. Blocks of dead units are zero, except for the last action.
    ///
    /// # Panics
    /// If `out` has another size than the [side's](crate::Arena::sizes_of).
    pub fn write_state(&self, side: Faction, out: &mut [f32]) {
        if let (Faction::Ally, Some(perceiver), Some(interface)) =
            (side, &self.perceiver, self.arena.interface())
        {
            let last_actions = self.last_actions_of(side);
            return interface.write_state(perceiver.frame(), perceiver.perception(), last_actions, out);
        }
        encode::write_state(&self.view(side), self.last_actions_of(side), out);
    }

    /// Writes which actions are available to the units of a side that joint actions play: u8 0 or 1,
    /// `[n_units, n_actions]`. Enemies that a script plays have no-op alone, as the dead.
    ///
    /// # Panics
    /// If `out` has another size than the [side's](crate::Arena::sizes_of).
    pub fn write_avail_actions(&self, side: Faction, out: &mut [u8]) {
        self.available_of(side).write(out);
    }

    /// Writes which units of a side that joint actions play are alive: u8 0 or 1, `[n_units]`. Enemies that a
    /// script plays count as dead.
    ///
    /// # Panics
    /// If `out` has another size than the [side's](crate::Arena::sizes_of).
    pub fn write_alive(&self, side: Faction, out: &mut [u8]) {
        let ids = self.arena.ids(side);
        assert_eq!(out.len(), ids.len(), "one byte per unit");
        let is_played = side == Faction::Ally || self.opponent == Opponent::Learner;
        for (out, &id) in out.iter_mut().zip(ids) {
            *out = u8::from(is_played && self.units.alive[id as usize]);
        }
    }

    /// The features of a unit as a side sees it, by battle-wide id: those in [the state](Self::write_state),
    /// if that is the side of the agents; the enemies' are not [mirrored](crate::Sides::Mirrored) here.
    ///
    /// # Panics
    /// If there is no such unit.
    pub fn unit_features(&self, id: u32, side: Faction) -> UnitFeatures {
        let features = UnitFeatures::of(&self.view(side), id, self.arena.faction(id) == side);
        if let (Faction::Ally, Some(perceiver), Some(interface)) =
            (self.arena.faction(id), &self.perceiver, self.arena.interface())
            && side == Faction::Ally
        {
            let agent = self.arena.id_in_faction(id);
            let health = interface.health_share(perceiver.frame(), perceiver.perception(), agent) as f32;
            return UnitFeatures {
                health: if self.units.alive[id as usize] { health } else { 0.0 },
                ..features
            };
        }
        features
    }

    /// SMACv2's interface and what the agents perceive through it, if the scenario has its options.
    pub fn perceived(&self) -> Option<(&Interface, &Frame, &Perception)> {
        let (perceiver, interface) = (self.perceiver.as_ref()?, self.arena.interface()?);
        Some((interface, perceiver.frame(), perceiver.perception()))
    }

    fn view(&self, side: Faction) -> encode::View<'_> {
        encode::View {
            arena: &self.arena,
            units: &self.units,
            tables: &self.tables,
            available: self.available_of(side),
            faction: side,
            mirror: side == Faction::Enemy && self.arena.sides().are_mirrored(),
        }
    }

    /// The type of each unit in this episode, as an index into the types of the scenario, by battle-wide id.
    pub fn types(&self) -> impl Iterator<Item = usize> {
        self.arena.type_indices().map(|unit_type| unit_type as usize)
    }

    /// The current state of all units.
    pub fn units(&self) -> &Units {
        &self.units
    }

    /// Number of agents that died in this episode.
    pub fn dead_allies(&self) -> usize {
        self.arena.agents.len() - self.alive_ids.allies.len()
    }

    /// Number of enemies that died in this episode.
    pub fn dead_enemies(&self) -> usize {
        self.arena.enemies.len() - self.alive_ids.enemies.len()
    }

    /// The sum of the rewards of this episode.
    pub fn episode_return(&self) -> f64 {
        self.episode_return
    }

    /// Number of steps of this episode.
    pub fn episode_length(&self) -> u32 {
        self.episode_length
    }

    /// Writes the level that the episode began with, or that of the state that was restored since, f32
    /// `[n_units, 5]`, see [`LEVEL_COLUMNS`](crate::LEVEL_COLUMNS).
    ///
    /// # Panics
    /// If `out` has another size.
    pub fn write_level(&self, out: &mut [f32]) {
        out.copy_from_slice(&self.level);
    }

    pub(crate) fn neighbour_order(&self) -> &NeighbourOrder {
        &self.neighbour_order
    }

    /// The last action of each agent and then of each enemy; `None` after a reset, and for enemies that
    /// joint actions do not play.
    pub(crate) fn last_actions(&self) -> &[Option<u32>] {
        &self.last_actions
    }

    pub(super) fn last_actions_of(&self, side: Faction) -> &[Option<u32>] {
        let (agents, enemies) = self.last_actions.split_at(self.arena.agents.len());
        match side {
            Faction::Ally => agents,
            Faction::Enemy => enemies,
        }
    }
}
