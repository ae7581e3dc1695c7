//! Pools made of real processes, for the tests of what is promised when processes die, stop or lie.
//!
//! A child is the running program itself, started again with a role (`process`, `role`); the parent tells it
//! what to do by lines of text. Every test has a room of its own (`room`), so that nothing of one test is
//! seen by another.

pub mod crash;
pub mod dice;
pub mod fork;
pub mod games;
pub mod plan;
pub mod player;
pub mod process;
pub mod raw;
pub mod replay;
pub mod role;
pub mod room;
pub mod stranger;
pub mod torture;

pub use plan::{LanePlan, PoolPlan};
pub use player::Player;
pub use process::Child;
pub use replay::Replay;
pub use room::Room;
