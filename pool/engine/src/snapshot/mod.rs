//! The state of a battle between two steps, as plain data, and the check that it fits an arena.

use serde::{Deserialize, Serialize};
use smaclite_units::{Plane, UnitType};
use thiserror::Error;

mod columns;
mod record;
mod write;

pub use columns::{COLUMN_COUNT, COLUMNS, Column, ColumnAxis, ColumnSpec, ColumnType};
pub use record::{RECORD_VERSION, RecordLayout, RecordSizes};

use crate::arena::Arena;
use crate::neighbour_order::{NeighbourOrder, PlaneOrder};
use crate::opponents::Opponent;
use crate::random::Generator;
use crate::sides::Actor;
use crate::sizes::Sizes;
use crate::units::Units;
use glam::Vec2;

/// All of a battle that changes. It can be edited, or created from a recording;
/// [`Battle::restore`](crate::Battle::restore) checks it.
///
/// Serialised in a binary format that keeps the bits of numbers, it is the same after deserialisation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// The type of each unit, as an index into the types of the scenario, by battle-wide id.
    pub types: Vec<u32>,
    /// The units, by battle-wide id.
    pub units: Units,
    /// The order of equally near neighbours. After a change of `units.alive` create it by
    /// [`NeighbourOrder::new`].
    pub neighbour_order: NeighbourOrder,
    /// The last action of each agent and then of each enemy; `None` after a reset, and for enemies that joint
    /// actions do not play.
    pub last_actions: Vec<Option<u32>>,
    /// What plays the enemies in this episode.
    pub opponent: Opponent,
    /// The generator of execution orders.
    pub generator: Generator,
    /// Number of steps of the episode so far.
    pub episode_length: u32,
    /// Sum of its rewards so far.
    pub episode_return: f64,
    /// What the agents perceived through SMACv2's interface; empty without it. Only the engine gives its
    /// words a meaning.
    pub perception: Vec<u64>,
}

/// Why a snapshot cannot be restored into a battle; the battle is unchanged.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SnapshotError {
    /// The bytes do not begin as a record does.
    #[error("these bytes are no snapshot")]
    NoRecord,
    /// A record of another version.
    #[error("the snapshot has version {given}, this release reads version {expected}")]
    Version {
        /// The record's version.
        given: u32,
        /// The version of this release.
        expected: u32,
    },
    /// A record that is not as long as its header says.
    #[error("the snapshot must have {expected} bytes, got {given}")]
    Size {
        /// Its length.
        given: usize,
        /// The length for the sizes in its header.
        expected: usize,
    },
    /// A record that was changed without a new checksum.
    #[error("the snapshot is damaged: its checksum is that of other bytes")]
    Checksum,
    /// A record of another scenario or rule set.
    #[error(
        "the snapshot is of another scenario or rule set: column 'scenario' must be {expected:#018x}, got \
         {given:#018x}"
    )]
    OtherScenario {
        /// The record's hash.
        given: u64,
        /// The arena's hash.
        expected: u64,
    },
    /// A record for observations with another number of past actions.
    #[error(
        "the snapshot has {given} past joint actions, must have {expected}: obs_last_actions of the lane \
         that it is from and of this one differ"
    )]
    PastActions {
        /// The record's number.
        given: usize,
        /// The lane's number.
        expected: usize,
    },
    /// A column has the wrong length; the snapshot is probably of another scenario.
    #[error("snapshot column '{column}' must have {expected} entries, got {given}")]
    WrongLength {
        /// The column.
        column: &'static str,
        /// Its length.
        given: usize,
        /// The length that the battle needs.
        expected: usize,
    },
    /// A value that the unit cannot have.
    #[error("snapshot column '{column}' must be between {min} and {max} for unit {unit}, got {value}")]
    OutOfRange {
        /// The column.
        column: &'static str,
        /// Battle-wide id of the unit.
        unit: usize,
        /// Its value.
        value: f64,
        /// The least possible value.
        min: f64,
        /// The greatest possible value.
        max: f64,
    },
    /// A type that the unit cannot have.
    #[error("snapshot column 'unit_type' is {given} for unit {unit}, but must be {expected}")]
    NoSuchType {
        /// Battle-wide id of the unit.
        unit: usize,
        /// Its type.
        given: u32,
        /// The types that it can have.
        expected: String,
    },
    /// A target that does not exist.
    #[error("snapshot column 'target' must be below {n_units} for unit {unit}, got {target}")]
    NoSuchTarget {
        /// Battle-wide id of the unit.
        unit: usize,
        /// Its target.
        target: u32,
        /// Number of units.
        n_units: usize,
    },
    /// A last action that does not exist.
    #[error("snapshot column '{column}' must be below {n_actions} for {actor}, got {action}")]
    NoSuchAction {
        /// The column.
        column: &'static str,
        /// The unit.
        actor: Actor,
        /// Its action.
        action: i64,
        /// Number of actions of such a unit.
        n_actions: usize,
    },
    /// The neighbour order is not one of the living units.
    #[error(
        "snapshot columns 'neighbour_rank' and 'neighbour_number' must each contain every living unit of \
         plane {plane} exactly once, without gaps, got {given:?}"
    )]
    NeighbourOrder {
        /// The plane.
        plane: Plane,
        /// Its orders.
        given: PlaneOrder,
    },
    /// An opponent that does not exist.
    #[error("snapshot column 'opponent' must be below {n_opponents}, got {given}")]
    NoSuchOpponent {
        /// The number in the column.
        given: u32,
        /// How many opponents there are.
        n_opponents: usize,
    },
    /// Enemies that joint actions play, where these play the agents alone.
    #[error("in the snapshot a learner plays the enemies, which needs sides `both`")]
    OneSide,
    /// A word of what agents perceived that no battle has.
    #[error("snapshot column 'perception' has the impossible word {value:#018x} at {index}")]
    Perception {
        /// Its place.
        index: usize,
        /// The word.
        value: u64,
    },
    /// The return is not a number.
    #[error("snapshot column 'episode_return' must be finite, got {value}")]
    Return {
        /// The return.
        value: f64,
    },
}

impl Snapshot {
    /// Bytes of memory that it uses, about.
    pub fn memory(&self) -> usize {
        let Snapshot { types, units, neighbour_order, last_actions, .. } = self;
        let vectors = 3 * size_of::<Vec2>();
        let numbers = 6 * size_of::<f64>();
        let others = 2 * size_of::<bool>() + size_of::<Option<u32>>();
        let of_order = |order: &PlaneOrder| (order.list.len() + order.by_number.len()) * size_of::<u32>();
        size_of::<Snapshot>()
            + size_of_val(&types[..])
            + units.pos.len() * (vectors + numbers + others)
            + neighbour_order.planes.iter().map(of_order).sum::<usize>()
            + last_actions.len() * size_of::<Option<u32>>()
            + size_of_val(&self.perception[..])
    }

    /// Whether the episode is over, in a battle of this arena.
    pub fn is_over(&self, arena: &Arena) -> bool {
        let is_at_limit = arena.episode_limit().is_some_and(|limit| self.episode_length >= limit);
        if let Some(interface) = arena.interface() {
            let of_place = |place| self.types[arena.id_at(place) as usize];
            let types: Vec<u32> = (0..self.types.len()).map(of_place).collect();
            let is_alive = |place| self.units.alive[arena.id_at(place) as usize];
            return is_at_limit || interface.end(&types, is_alive).is_some();
        }
        let lives = |ids: &[u32]| ids.iter().any(|id| self.units.alive[*id as usize]);
        is_at_limit || !lives(&arena.agents) || !lives(&arena.enemies)
    }

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
            ("last_action", self.last_actions.len(), n_units),
            ("perception", self.perception.len(), arena.sizes().perception_size),
        ];
        match columns.into_iter().find(|(_, given, expected)| given != expected) {
            Some((column, given, expected)) => Err(SnapshotError::WrongLength { column, given, expected }),
            None => Ok(()),
        }
    }

    fn check_types(&self, arena: &Arena) -> Result<(), SnapshotError> {
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
        match of_units.enumerate().find(|(_, of_unit)| is_wrong(of_unit)) {
            Some((unit, (&given, own))) => {
                Err(SnapshotError::NoSuchType { unit, given, expected: expected(own) })
            }
            None => Ok(()),
        }
    }

    fn check_ranges(&self, arena: &Arena) -> Result<(), SnapshotError> {
        let units = &self.units;
        for (unit, &unit_type) in self.types.iter().enumerate() {
            let stats: &UnitType = &arena.types()[unit_type as usize];
            let (pos, vel) = (units.pos[unit].as_dvec2(), units.vel[unit].as_dvec2());
            let planned_vel = units.planned_vel[unit].as_dvec2();
            // Any finite number; NaN and infinity are in no range.
            let anything = f64::from(f32::MAX);
            let ranges = [
                ("pos", pos.x, -anything, anything),
                ("pos", pos.y, -anything, anything),
                ("vel", vel.x, -anything, anything),
                ("vel", vel.y, -anything, anything),
                ("planned_vel", planned_vel.x, -anything, anything),
                ("planned_vel", planned_vel.y, -anything, anything),
                ("hp", units.hp[unit], 0.0, stats.hp),
                ("shield", units.shield[unit], 0.0, stats.shield),
                ("energy", units.energy[unit], 0.0, stats.energy),
                ("cooldown", units.cooldown[unit], 0.0, f64::MAX),
                ("shield_cooldown", units.shield_cooldown[unit], 0.0, f64::MAX),
                ("healing", units.healing[unit], 0.0, f64::MAX),
            ];
            for (column, value, min, max) in ranges {
                if !(min..=max).contains(&value) {
                    return Err(SnapshotError::OutOfRange { column, unit, value, min, max });
                }
            }
        }
        if self.episode_return.is_finite() {
            Ok(())
        } else {
            Err(SnapshotError::Return { value: self.episode_return })
        }
    }

    fn check_references(&self, arena: &Arena) -> Result<(), SnapshotError> {
        let Sizes { n_agents, .. } = arena.sizes();
        let n_units = arena.sizes().n_units();
        for (unit, &target) in self.units.target.iter().enumerate() {
            if let Some(target) = target.filter(|&target| target as usize >= n_units) {
                return Err(SnapshotError::NoSuchTarget { unit, target, n_units });
            }
        }
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
        if let Some(index) = arena.interface().and_then(|interface| interface.invalid_word(&self.perception))
        {
            return Err(SnapshotError::Perception { index, value: self.perception[index] });
        }
        let is_playable = self.opponent != Opponent::Learner || arena.sides().are_both();
        if is_playable { Ok(()) } else { Err(SnapshotError::OneSide) }
    }
}
