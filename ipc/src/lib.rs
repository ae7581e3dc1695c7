//! A pool across processes: the supervisor that runs it, the client of a learner, and the shared memory and
//! the control socket between them. Only this crate uses iceoryx2. It does not step battles (that is
//! `smaclite_pool`), and it has no command line (`smaclite_cli`).
//!
//! A learner in Rust:
//!
//! ```
//! use smaclite_engine::BattleSetup;
//! use smaclite_ipc::{Client, LaneConfig, RuntimeDir, Supervisor, SupervisorConfig, WaitOptions};
//! use smaclite_scenarios::ScenarioFiles;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let runtime_dir = RuntimeDir::for_current_user()?;
//! // Usually another process: `smaclite-pool serve 2s3z:4 --name rust-example`.
//! let (_, files) = ScenarioFiles::resolve("2s3z")?;
//! let lanes = vec![LaneConfig::new("2s3z", BattleSetup::new(files), 4)];
//! let (name, options) = ("rust-example".to_owned(), Default::default());
//! let config = SupervisorConfig { name, lanes, options, runtime_dir: runtime_dir.clone() };
//! let supervisor = Supervisor::start(config)?;
//!
//! let wait = WaitOptions::forever();
//! let mut client = Client::connect(&runtime_dir, "rust-example", None, Default::default(), wait)?;
//! let batch = client.reset(Some(1), None, WaitOptions::forever())?;
//! assert_eq!(batch.obs().len(), 4 * 5 * client.description().sizes.obs_size);
//! let mut actions = vec![0; 4 * 5];
//! client.sample_actions(None, &mut actions)?;
//! let batch = client.step(&actions, None, WaitOptions::forever())?;
//! assert_eq!(batch.env_id(), [0, 1, 2, 3]);
//! # drop(supervisor);
//! # Ok(())
//! # }
//! ```

#![deny(unsafe_code)] // allowed where a module says why

mod batch;
mod capacity;
mod clean;
mod client;
mod connection_failures;
mod connections;
pub mod control;
mod error;
mod folder_use;
mod follower;
mod lane_scenario;
mod name;
mod os;
mod process_owned;
mod refusals;
mod runtime_dir;
mod services;
mod spectator;
mod supervisor;
mod transport;
mod wait_options;
pub mod wire;

pub use batch::Batch;
pub use capacity::Capacity;
pub use clean::{CleanError, CleanReport, clean, left_over_files};
pub use client::{Client, ClientError, ConnectError, Order};
pub use control::client::ControlSocketError;
pub use control::protocol::{ControlError, LaneDescription, LaneStatus, PoolStatus};
pub use folder_use::FolderUse;
#[doc(hidden)] // for tests that speak iceoryx2 themselves
pub use folder_use::iceoryx;
pub use follower::{FollowedPart, Follower, Piece};
pub use lane_scenario::lane_scenario;
pub use name::{NameError, check_name};
pub use os::memory::TooLittleMemory;
#[doc(hidden)] // for the same tests
pub use os::variant::PoolService;
pub use process_owned::{NotOwner, ProcessOwned};
pub use runtime_dir::{ROOT_VARIABLE, RuntimeDir, RuntimeDirError};
pub use services::IpcError;
pub use smaclite_pool::transport::Seeds;
pub use smaclite_pool::{MAX_LOG_BYTES, WaitStrategy};
pub use spectator::Spectator;
pub use supervisor::{LaneConfig, LaneConfigError, PreparedPool, StartError, Supervisor, SupervisorConfig};
pub use wait_options::WaitOptions;

use control::client::ControlClient;
use control::protocol::{ControlRequest, ControlResponse};
use std::time::Duration;

/// How often a wait checks what cannot wake it: whether the peer lives, and whether the caller wants to stop.
const CHECK_INTERVAL: Duration = Duration::from_millis(100);

/// The status of a pool, if it answers in time.
///
/// # Errors
/// If no pool of that name runs, or it does not answer in time.
pub fn status(
    runtime_dir: &RuntimeDir,
    pool: &str,
    wait: WaitOptions<'_>,
) -> Result<PoolStatus, ConnectError> {
    match ControlClient::request(runtime_dir, pool, &ControlRequest::Status, wait)?.1 {
        ControlResponse::Status(status) => Ok(status),
        ControlResponse::Refused(refusal) => Err(refusal.into()),
        other => Err(ControlError::unexpected(&other).into()),
    }
}

/// Names of the pools that run in a runtime folder, sorted; those of stopped supervisors too.
pub fn running_pools(runtime_dir: &RuntimeDir) -> Vec<String> {
    control::client::running_pools(runtime_dir)
}
