//! Many battles: lanes of environments, worker threads, batches. What lives here works on plain memory
//! through the [`transport`] traits and knows nothing of iceoryx2, and of battles only how to
//! step, observe, save and restore them.
//!
//! The path of a batch: a [request](transport::Request) comes from a lane's inlet, or is a call of a learner
//! of this process. The lane accepts all of it or nothing, and publishes its environments as work. Threads
//! take chunks of them, step them and write each result into its slot of a frame that the lane's outlet
//! loaned. Completing the last slot publishes the frame.

#![deny(unsafe_code)] // except in `slot` and its one caller, `env_group`, which say why

pub mod enemy_team;
pub mod env_ids;
pub mod fields;
pub mod layout;
pub mod rejection;
#[allow(unsafe_code)]
pub mod slot;
pub mod transport;

mod autoreset;
mod crew;
mod enemy_player;
#[allow(unsafe_code)]
mod env_group;
mod episode_log;
mod frames;
mod hosted_env;
mod joint_action;
mod lane;
mod lane_settings;
mod lane_stats;
mod own_features;
mod pool_options;
mod scheduler;
mod sync;
mod wait_strategy;
mod work;

pub use autoreset::Autoreset;
pub use episode_log::{EpisodePart, FollowerId, MAX_LOG_BYTES, TooManyFollowed};
pub use joint_action::{JointAction, MakeHook, StepHook};
pub use lane::Lane;
pub use lane_settings::{LaneSettings, LaneSettingsError, LaneSpec, MAX_ENVS};
pub use lane_stats::LaneStats;
pub use pool_options::PoolOptions;
pub use rejection::Rejection;
pub use scheduler::{LocalLearner, Pool, PoolHandle, PoolStartError};
pub use wait_strategy::{Deadline, Polling, WaitStrategy};
