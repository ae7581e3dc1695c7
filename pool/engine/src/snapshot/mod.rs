//! The state of a battle between two steps, as plain data. `ranges` checks that it fits an arena.

use smaclite_units::Plane;
use thiserror::Error;

mod columns;
mod ranges;
mod read;
mod record;
mod write;

pub use columns::{COLUMN_COUNT, COLUMNS, Column, ColumnAxis, ColumnSpec};
pub use record::{MAX_LAST_ACTIONS, RECORD_VERSION, RecordLayout, RecordSizes};

use crate::arena::Arena;
use crate::battle::begin_march;
use crate::neighbour_order::{NeighbourOrder, PlaneOrder};
use crate::opponents::Opponent;
use crate::random::Generator;
use crate::rules::Rules;
use crate::sides::Actor;
use crate::smacv2::WrongWord;
use crate::units::Units;

/// All of a battle that changes. It can be edited, or created from a recording;
/// [`Battle::restore`](crate::Battle::restore) checks it.
#[derive(Clone, Debug, Default, PartialEq)]
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

impl Snapshot {
    /// Lets a script play the enemies from now on. `arena` is that of its battle.
    pub fn play_on(&mut self, arena: &Arena, script: Opponent) {
        // Enemies begin to march in the first step of an episode, which was played by something else.
        let begins = script.marches() && !self.opponent.marches() && self.episode_length > 0;
        if arena.rules == Rules::Starcraft && begins {
            begin_march(arena, &mut self.units, &mut self.generator);
        }
        self.opponent = script;
        self.last_actions[arena.agents.len()..].fill(None); // no joint action plays enemies
    }
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
    /// A record with another rule set.
    #[error("the snapshot is of rules `{given}`, and the battle has rules `{expected}`")]
    OtherRules {
        /// The record's rules.
        given: Rules,
        /// The arena's rules.
        expected: Rules,
    },
    /// A rule set that does not exist.
    #[error("snapshot column 'rules' must be below {}, got {given}", Rules::ALL.len())]
    NoSuchRules {
        /// The number in the column.
        given: u32,
    },
    /// A record of another scenario.
    #[error(
        "the snapshot is of another scenario, or of the same with other keys or `smacv2` options: column \
         'scenario' must be {expected:#018x}, got {given:#018x}"
    )]
    OtherScenario {
        /// The record's hash.
        given: u64,
        /// The arena's hash.
        expected: u64,
    },
    /// A record for observations with another number of past actions.
    #[error(
        "the snapshot is of a lane with `obs_last_actions` {given}, and this one has {expected}: a snapshot \
         has the past actions that observations show, also those of a team that plays the enemies"
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
        /// The unit's place in the columns.
        unit: usize,
        /// Its value.
        value: f64,
        /// The least possible value.
        min: f64,
        /// The greatest possible value.
        max: f64,
    },
    /// A living unit without health.
    #[error("snapshot column 'hp' must be above 0 for unit {unit}, which is alive, got 0")]
    NoHealth {
        /// The unit's place in the columns.
        unit: usize,
    },
    /// A type that the unit cannot have.
    #[error("snapshot column 'unit_type' is {given} for unit {unit}, but must be {expected}")]
    NoSuchType {
        /// The unit's place in the columns.
        unit: usize,
        /// Its type.
        given: u32,
        /// The types that it can have.
        expected: String,
    },
    /// A target that does not exist.
    #[error(
        "snapshot column '{column}' must be between -1 and {} for unit {unit}, got {target}",
        n_units - 1
    )]
    NoSuchTarget {
        /// The column.
        column: &'static str,
        /// The unit's place in the columns.
        unit: usize,
        /// Its target.
        target: i64,
        /// Number of units.
        n_units: usize,
    },
    /// A unit attacks its own side, or heals the other one.
    #[error("snapshot column '{column}' must be a unit of {side} side, or -1, for unit {unit}, got {target}")]
    TargetOfOtherSide {
        /// The column.
        column: &'static str,
        /// The unit's place in the columns.
        unit: usize,
        /// That of its target.
        target: usize,
        /// Which side it attacks or heals.
        side: &'static str,
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
    #[error("in the snapshot a learner plays the enemies, which needs sides `both` or `mirrored`")]
    OneSide,
    /// A word of what agents perceived that no battle has.
    #[error("snapshot column 'perception' has {0}")]
    Perception(#[from] WrongWord),
    /// A return that no battle has.
    #[error("snapshot column 'episode_return' must be between -{max:e} and {max:e}, got {value:e}")]
    Return {
        /// The return.
        value: f64,
        /// The greatest possible one.
        max: f64,
    },
    /// A length that fields cannot say.
    #[error("snapshot column 'episode_length' must be at most {max}, got {value}")]
    Length {
        /// The length.
        value: u32,
        /// The greatest possible one.
        max: u32,
    },
}

impl Snapshot {
    /// Whether the episode is over, in a battle of this arena.
    pub fn is_over(&self, arena: &Arena) -> bool {
        let is_at_limit = arena.episode_limit().is_some_and(|limit| self.episode_length >= limit);
        if let Some(interface) = arena.interface() {
            let of_place = |place| self.types[arena.id_at(place) as usize];
            let types: Vec<u32> = (0..self.types.len()).map(of_place).collect();
            let is_alive = |place| self.units.alive[arena.id_at(place) as usize];
            let has_ended = interface.end(&types, is_alive).is_some();
            return is_at_limit || self.episode_length > 0 && has_ended;
        }
        let lives = |ids: &[u32]| ids.iter().any(|id| self.units.alive[*id as usize]);
        is_at_limit || !lives(&arena.agents) || !lives(&arena.enemies)
    }
}
