//! One battle: the exact rules of the game, and what agents observe of it.
//!
//! An [`Arena`] is a scenario prepared for play, shared by all its battles; a [`Battle`] is one episode after
//! another, stepped by joint actions. The engine knows nothing of threads, shared memory or files, and its
//! only error in play is an [`IllegalAction`].
//!
//! Equal seeds and actions give equal bits on every machine: arithmetic is in f32 or f64 as the rules say,
//! and never fused. The execution order of each tick is drawn at random, and so are opponents and their
//! actions where a lane says so; nothing else is.
//!
//! ```
//! use std::sync::Arc;
//! use smaclite_engine::{Arena, Battle, Rules, Scratch};
//! use smaclite_scenarios::Scenario;
//!
//! let scenario = Scenario::standard("2s3z").unwrap();
//! let mut battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::Smaclite)), 1);
//! let mut scratch = Scratch::new();
//! let step = battle.step(&[4; 5], &mut scratch)?; // all agents move east
//! assert_eq!((step.reward, step.terminated), (0.0, false)); // the factions have not met yet
//! # Ok::<(), smaclite_engine::IllegalAction>(())
//! ```
//!
//! # Where the rules are
//!
//! | rule | file |
//! | --- | --- |
//! | the five phases of a tick | `tick/mod.rs` |
//! | when a unit loses its target | `tick/targets.rs` |
//! | which unit is attacked, also of two equally near ones, and which is healed | `tick/target_choice.rs` |
//! | where a unit wants to go, and when it is within attack range | `tick/preferred.rs` |
//! | collision avoidance between units and at walls (ORCA) | `tick/avoid/` |
//! | execution order of the units of a tick | `battle/` (`set_execution_order`), `random.rs` |
//! | what the enemies do | `battle/commands.rs`, `opponents.rs`, `policy/` |
//! | movement, start of the cooldown, regeneration of shields, health and energy | `tick/execute.rs` |
//! | damage, shields and armor, explosions, lasers, healing and its energy | `tick/targeters.rs` |
//! | death, and what a dead unit keeps | `tick/deaths.rs` |
//! | rewards: earning | `tick/targeters.rs` (`hit`, `explode`) |
//! | rewards: options, scaling, shares of units | `rewards.rs`, `battle/rewards.rs` |
//! | which sides joint actions play, and the mirror | `sides.rs`, `battle/`, `encode/` |
//! | victory, defeat and the time limit | `battle/` (`finish_step`) |
//! | available actions: targets | `encode/avail.rs` |
//! | available actions: moves near walls | `arena/moves.rs` |
//! | targeting range | `encode/unit_tables.rs` |
//! | sight range and observations | `encode/obs.rs` |
//! | the state | `encode/state.rs` |
//! | differences between the rule sets `smaclite` and `paper`, R1 to R4 | `rules.rs` |
//!
//! # Profiles
//!
//! The phases of a tick and the encoders are `#[inline(never)]`: each is called once per tick or step, so
//! this costs nothing, and each appears as a function in profiles (`benches/src/instructions.rs`).
#![forbid(unsafe_code)]

mod arena;
mod battle;
mod battle_setup;
mod block_index;
mod buffers;
mod command;
mod distance;
mod dtype;
mod encode;
mod extent;
mod fast_math;
mod features;
pub mod fnv;
mod level;
mod neighbour_order;
mod opponents;
pub mod policy;
mod random;
mod rewards;
mod rules;
mod scratch;
mod sides;
mod simd;
mod sizes;
pub mod smacv2;
mod snapshot;
mod step;
mod tactic;
mod tick;
mod units;

use smaclite_scenarios::Smacv2;
use smaclite_units::UnitType;

pub use arena::Arena;
pub use battle::Battle;
pub use battle_setup::{BattleSetup, EpisodeLimit};
pub use command::{IllegalAction, action};
pub use dtype::Dtype;
pub use encode::{
    NotUniversal, RowMap, TargetLayout, UnitFeatures, UnitLayout, UnitRows, UniversalForm, UniversalRows,
    action_names, feature_bounds, obs_features, state_features,
};
pub use features::FeatureBlock;
/// The vectors of the interface.
pub use glam;
pub use level::{LEVEL_COLUMNS, LevelError};
pub use neighbour_order::{NeighbourOrder, PlaneOrder};
pub use opponents::{Opponent, Opponents, OpponentsError};
pub use random::{Generator, StreamPosition};
pub use rules::{Rules, UnknownRules};
pub use scratch::Scratch;
pub use sides::{Actor, Sides, SidesError};
pub use sizes::{EnemySizes, Sizes};
pub use smaclite_scenarios::{Faction, Rewards};
pub use snapshot::{
    COLUMN_COUNT, COLUMNS, Column, ColumnAxis, ColumnSpec, MAX_LAST_ACTIONS, RECORD_VERSION, RecordLayout,
    RecordSizes, Snapshot, SnapshotError,
};
pub use step::{ExecutionOrder, Step, Tick};
pub use units::Units;

/// The instruction set with which battles are computed on this processor, such as `AVX2`.
pub fn instruction_set() -> &'static str {
    simd::Level::default().name()
}

/// Ticks per step.
pub const TICKS_PER_STEP: usize = 8;

const TICKS_PER_SECOND: f64 = 16.0;
/// Length of a tick in seconds.
const TICK: f64 = 1.0 / TICKS_PER_SECOND;

/// How far agents see, in squares; distances in observations are divided by it. It is the same for all unit
/// types, as in SMAC.
pub const SIGHT_RANGE: f64 = 9.0;
/// The range within which target actions are available to agents, in squares, whatever the attack range of
/// the unit: beyond its attack range, a unit walks to its target first.
pub const TARGETING_RANGE: f64 = 6.0;

/// How far agents of a type see, and within which range they have target actions, in squares: the two ranges
/// above, or those of the type if SMACv2's option `use_unit_ranges` asks for them.
pub fn agent_ranges(options: Option<&Smacv2>, unit_type: &UnitType) -> [f64; 2] {
    match options {
        Some(options) if options.use_unit_ranges => {
            [unit_type.sight_range, unit_type.targeting_range.max(options.min_attack_range)]
        }
        _ => [SIGHT_RANGE, TARGETING_RANGE],
    }
}

/// Shield regeneration per tick: 2 per second.
const SHIELD_PER_TICK: f64 = 2.0 * TICK;
/// Seconds after a hit before a shield regenerates.
const SHIELD_DELAY: f64 = 10.0;
/// Energy regeneration per tick: 0.5625 per second.
const ENERGY_PER_TICK: f64 = 0.5625 * TICK;
/// The largest amount of health that a healer restores per tick: 9 per second.
const HEAL_PER_TICK: f64 = 9.0 * TICK;
/// Health per unit of energy.
const HEALTH_PER_ENERGY: f64 = 3.0;
/// The energy that a healer needs to start healing a new target.
const MIN_ENERGY_FOR_NEW_TARGET: f64 = 5.0;

/// Unscaled reward for killing an enemy, if a scenario has no other.
pub const KILL_REWARD: f64 = Rewards::DEFAULT.death_value;
