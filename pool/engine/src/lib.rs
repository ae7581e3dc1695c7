//! One battle: the rules of the game, exactly, and what agents see of it.
//!
//! An [`Arena`] is a scenario made ready, shared by all its battles; a [`Battle`] is one episode after
//! another, stepped by joint actions. The engine knows nothing of threads, shared memory or files, and it
//! cannot fail but by an [`IllegalAction`].
//!
//! Equal seeds and actions give equal bits, on every machine: arithmetic is in f32 or f64 as the rules say,
//! never fused, and nothing is drawn but the execution order of a tick.
//!
//! ```
//! use std::sync::Arc;
//! use smaclite_engine::{Arena, Battle, Rules, Scratch};
//! use smaclite_scenarios::Scenario;
//!
//! let scenario = Scenario::standard("2s3z").unwrap();
//! let mut battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::Smaclite)), 1);
//! let mut scratch = Scratch::new();
//! let step = battle.step(&[4; 5], &mut scratch)?; // everyone moves east
//! assert_eq!((step.reward, step.terminated), (0.0, false)); // the sides have not met yet
//! # Ok::<(), smaclite_engine::IllegalAction>(())
//! ```
#![forbid(unsafe_code)]

mod arena;
mod battle;
mod command;
mod encode;
mod neighbour_order;
pub mod policy;
mod random;
mod rules;
mod scratch;
mod simd;
mod snapshot;
mod tick;
mod units;

pub use arena::{Arena, Sizes};
pub use battle::{Battle, ExecutionOrder, Step, Tick};
pub use command::{IllegalAction, action};
pub use encode::{FeatureBlock, obs_features, state_features};
pub use neighbour_order::{NeighbourOrder, PlaneOrder};
pub use random::Generator;
pub use rules::{Rules, UnknownRules};
pub use scratch::Scratch;
pub use snapshot::{Snapshot, SnapshotError};
pub use units::Units;

/// Ticks in a step.
pub const TICKS_PER_STEP: usize = 8;

const TICKS_PER_SECOND: f64 = 16.0;
/// Length of a tick in seconds.
const TICK: f64 = 1.0 / TICKS_PER_SECOND;

/// How far agents see, in squares, and what distances in observations are divided by.
pub const SIGHT_RANGE: f64 = 9.0;
/// How far away agents may choose targets, in squares, whatever their units' attack range.
pub const TARGETING_RANGE: f64 = 6.0;

/// Shield that a unit regains in a tick: 2 a second.
const SHIELD_PER_TICK: f64 = 2.0 * TICK;
/// Seconds after a hit before a shield regenerates.
const SHIELD_DELAY: f64 = 10.0;
/// Energy that a unit regains in a tick: 0.5625 a second.
const ENERGY_PER_TICK: f64 = 0.5625 * TICK;
/// Health that a healer gives in a tick at most: 9 a second.
const HEAL_PER_TICK: f64 = 9.0 * TICK;
/// Health that one energy buys.
const HEALTH_PER_ENERGY: f64 = 3.0;
/// A healer with less energy turns to no new target.
const MIN_ENERGY_FOR_NEW_TARGET: f64 = 5.0;

/// Unscaled reward for killing an enemy.
pub const KILL_REWARD: f64 = 10.0;
/// Unscaled reward of a step after which no enemy lives.
pub const WIN_REWARD: f64 = 200.0;
/// The return that the greatest reward is scaled to.
pub const REWARD_SCALE: f64 = 20.0;
