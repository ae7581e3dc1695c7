//! Many battles: lanes of environments, worker threads, batches. What lives here works on plain memory through the
//! [`transport`] traits and knows nothing of iceoryx2 or of the rules of a battle.
//!
//! The way of a batch: a worker that leads takes a [request](transport::Request) from a lane's inlet, checks all of
//! it, and shares its environments out; workers step them and write each result into its slot of the frame that
//! the lane's outlet loaned; whoever writes the last slot sends the frame.

#![deny(unsafe_code)] // `slot`, and the one place that splits a frame with it, say why they may

pub mod env_ids;
pub mod environment;
pub mod fields;
pub mod fnv;
pub mod layout;
pub mod rejection;
#[allow(unsafe_code)]
pub mod slot;
pub mod transport;

mod frame_assembler;
mod hosted_env;
#[allow(unsafe_code)]
mod lane;
mod lane_settings;
mod leader_followers;
mod sync;
mod workers;

pub use hosted_env::Autoreset;
pub use lane::{LaneSpec, LaneStats};
pub use lane_settings::{LaneSettings, LaneSettingsError, MAX_ENVS};
pub use leader_followers::WaitStrategy;
pub use rejection::Rejection;
pub use workers::{Pool, PoolOptions};
