//! Levels: where an episode begins, as rows of numbers that curricula and environment design can write.

use glam::Vec2;
use smaclite_units::Plane;
use thiserror::Error;

use crate::arena::Arena;
use crate::buffers::refill;
use crate::sides::Actor;
use crate::units::Units;
use smaclite_scenarios::Faction;

/// What a level says of a unit, in this order: f32 `[n_units, 5]`, agents first and then the enemies, by
/// their numbers in their faction.
///
/// - `type`: index into the types of the scenario; another than that of the scenario's groups only in
///   generated scenarios;
/// - `x`, `y`: position in squares, on the map;
/// - `health`: the share of its full health, above 0 and at most 1;
/// - `alive`: 1, or 0 for a unit that is not in the battle. Its position and health do not matter.
pub const LEVEL_COLUMNS: [&str; 5] = ["type", "x", "y", "health", "alive"];

/// A level that a battle cannot begin with.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum LevelError {
    /// A level of another number of units.
    #[error("a level has {expected} numbers, got {given}")]
    Size {
        /// Its length.
        given: usize,
        /// The length that the battle needs.
        expected: usize,
    },
    /// A number that is out of range.
    #[error("{column} of {actor} must be {expected}, got {given}")]
    OutOfRange {
        /// The column.
        column: &'static str,
        /// The unit.
        actor: Actor,
        /// The number.
        given: f32,
        /// What is accepted.
        expected: String,
    },
    /// A ground unit that starts on a blocked square, and not where the scenario lets it start.
    #[error("{actor} starts at ({x}, {y}), where the map is blocked")]
    Blocked {
        /// The unit.
        actor: Actor,
        /// Its position.
        x: f32,
        /// Its position.
        y: f32,
    },
    /// Two units of one plane that start at one point.
    #[error("{first} and {second} start at one point")]
    SamePoint {
        /// A unit.
        first: Actor,
        /// Another one.
        second: Actor,
    },
    /// A faction without a living unit.
    #[error("at least one {} must be alive", if *.0 == Faction::Ally { "agent" } else { "enemy" })]
    NobodyAlive(Faction),
    /// A faction of healers alone, which have lost with SMACv2's interface.
    #[error(
        "at least one {} that is no healer must be alive, because healers alone have lost with `smacv2`",
        if *.0 == Faction::Ally { "agent" } else { "enemy" }
    )]
    HealersAlone(Faction),
}

/// A row of a level.
#[derive(Clone, Copy)]
struct Row {
    unit_type: f32,
    position: Vec2,
    health: f32,
    alive: f32,
}

fn rows(level: &[f32]) -> impl Iterator<Item = Row> + Clone {
    level.as_chunks().0.iter().map(|&[unit_type, x, y, health, alive]| {
        let position = Vec2::new(x, y);
        Row { unit_type, position, health, alive }
    })
}

impl Arena {
    /// Floats of a level.
    pub fn level_size(&self) -> usize {
        self.sizes().n_units() * LEVEL_COLUMNS.len()
    }

    /// Checks that a battle of this arena can begin with a level.
    ///
    /// # Errors
    /// The first number that it cannot begin with.
    pub fn check_level(&self, level: &[f32]) -> Result<(), LevelError> {
        let (given, expected) = (level.len(), self.level_size());
        if given != expected {
            return Err(LevelError::Size { given, expected });
        }
        let n_agents = self.agents.len();
        for (place, (row, id)) in rows(level).zip(self.ids_by_place()).enumerate() {
            self.check_row(row, id, Actor::at(place, n_agents))?;
        }
        let lives = |row: &Row| row.alive == 1.0;
        for (place, row) in rows(level).enumerate().filter(|(_, row)| lives(row)) {
            let plane = |row: Row| self.types()[row.unit_type as usize].plane;
            let mut others = rows(level).enumerate().take(place).filter(|(_, row)| lives(row));
            let same = |other: Row| other.position == row.position && plane(other) == plane(row);
            if let Some((other, _)) = others.find(|(_, other)| same(*other)) {
                let (first, second) = (Actor::at(other, n_agents), Actor::at(place, n_agents));
                return Err(LevelError::SamePoint { first, second });
            }
        }
        for (faction, range) in [(Faction::Ally, 0..n_agents), (Faction::Enemy, n_agents..expected)] {
            let mut living = rows(level).skip(range.start).take(range.len()).filter(lives).peekable();
            if living.peek().is_none() {
                return Err(LevelError::NobodyAlive(faction));
            }
            let mut heal = living.map(|row| self.types()[row.unit_type as usize].is_healer());
            if self.interface().is_some() && heal.all(|heals| heals) {
                return Err(LevelError::HealersAlone(faction));
            }
        }
        Ok(())
    }

    fn check_row(&self, row: Row, id: u32, actor: Actor) -> Result<(), LevelError> {
        let error = |column, given, expected| Err(LevelError::OutOfRange { column, actor, given, expected });
        let (own, n_types) = (self.approaches[id as usize].unit_type, self.types().len());
        let is_type = match self.drawer() {
            Some(_) => row.unit_type.fract() == 0.0 && (0.0..n_types as f32).contains(&row.unit_type),
            None => row.unit_type == own as f32,
        };
        if !is_type {
            let any = format!("a whole number from 0 to {}", n_types - 1);
            return error("type", row.unit_type, self.drawer().map_or(own.to_string(), |_| any));
        }
        if row.alive != 0.0 && row.alive != 1.0 {
            return error("alive", row.alive, "0 or 1".to_owned());
        }
        if row.alive == 0.0 {
            return Ok(());
        }
        let (width, height) = (self.terrain.width() as f32, self.terrain.height() as f32);
        for (column, x, side) in [("x", row.position.x, width), ("y", row.position.y, height)] {
            if !(0.0..=side).contains(&x) {
                return error(column, x, format!("from 0 to {side}"));
            }
        }
        if !(row.health > 0.0 && row.health <= 1.0) {
            return error("health", row.health, "a share above 0 and at most 1".to_owned());
        }
        let square = row.position.min(Vec2::new(width, height) - 0.5).floor().as_ivec2();
        let is_ground = self.types()[row.unit_type as usize].plane == Plane::Ground;
        // Scenarios may let a unit start there; where starts are drawn, they are elsewhere.
        let is_own_start = self.drawer().is_none() && row.position == self.starts[id as usize];
        if is_ground && !is_own_start && !self.terrain.is_walkable(i64::from(square.x), i64::from(square.y)) {
            let Vec2 { x, y } = row.position;
            return Err(LevelError::Blocked { actor, x, y });
        }
        Ok(())
    }
}

impl Arena {
    /// The types of a level's units, by battle-wide id.
    pub(crate) fn level_types(&self, level: &[f32], types: &mut Vec<u32>) {
        refill(types, self.type_indices());
        for (place, row) in rows(level).enumerate() {
            types[self.id_at(place) as usize] = row.unit_type as u32;
        }
    }

    /// The point of the map that is nearest to a position; 0 in place of what is no number.
    fn on_map(&self, position: Vec2) -> Vec2 {
        let on_side = |x: f32, side: u32| if x.is_nan() { 0.0 } else { x.clamp(0.0, side as f32) };
        Vec2::new(on_side(position.x, self.terrain.width()), on_side(position.y, self.terrain.height()))
    }
}

impl Units {
    /// Sets positions, health and life as a level has them; after a reset of the units. The arena's start
    /// positions remain those of the scenario, with which the next episode begins.
    pub(crate) fn set_level(&mut self, arena: &Arena, level: &[f32]) {
        for (place, row) in rows(level).enumerate() {
            let id = arena.id_at(place) as usize;
            self.alive[id] = row.alive == 1.0;
            // The position of a unit that is not in the battle may be any number, also NaN; but all states
            // of battles are finite, or no snapshot of them would be valid.
            self.pos[id] = if self.alive[id] { row.position } else { arena.on_map(row.position) };
            // A unit of full health has exactly its maximum.
            self.hp[id] *= if self.alive[id] { f64::from(row.health) } else { 0.0 };
        }
    }
}

/// The level of units as they are.
pub(crate) fn describe(arena: &Arena, units: &Units, level: &mut Vec<f32>) {
    let row = |id: u32| {
        let (i, full) = (id as usize, arena.stats(id).hp);
        let Vec2 { x, y } = units.pos[i];
        let alive = f32::from(u8::from(units.alive[i]));
        [arena.approaches[i].unit_type as f32, x, y, (units.hp[i] / full) as f32, alive]
    };
    refill(level, arena.ids_by_place().flat_map(row));
}
