//! A pool over iceoryx2: services, shared-memory layout, the supervisor, the client, and the `smaclite-pool`
//! program. Only this crate knows iceoryx2; it knows nothing of how battles are stepped.
//!
//! A learner in Rust:
//!
//! ```
//! use smaclite_ipc::{Client, LaneConfig, Patience, Place, Supervisor, SupervisorConfig};
//! use smaclite_scenarios::Scenario;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let place = Place::at(folder.path().to_owned())?;
//! // Usually another process: `smaclite-pool serve 2s3z:4 --name train`.
//! let lanes = vec![LaneConfig::new("2s3z", Scenario::resolve("2s3z")?, 4)];
//! let config = SupervisorConfig { name: "train".into(), lanes, options: Default::default(), place: place.clone() };
//! let supervisor = Supervisor::start(config)?;
//!
//! let mut client = Client::connect(&place, "train", None, Default::default())?;
//! let batch = client.reset(Some(1), None, Patience::forever())?;
//! assert_eq!(batch.obs_matrix().nrows(), 4 * 5);
//! let mut actions = vec![0; 4 * 5];
//! client.sample_actions(None, &mut actions)?;
//! let batch = client.step(&actions, None, Patience::forever())?;
//! assert_eq!(batch.env_id(), [0, 1, 2, 3]);
//! # drop(supervisor);
//! # Ok(())
//! # }
//! ```

#![deny(unsafe_code)] // allowed where a module says why

mod batch;
pub mod cli;
mod client;
pub mod control;
mod error;
mod legal;
mod memory;
mod place;
mod services;
mod spectator;
mod stay;
mod supervisor;
mod transport;
mod variant;
pub mod wire;

pub use batch::Batch;
pub use client::{Client, ClientError, ConnectError, Patience};
pub use control::client::ControlError;
pub use control::protocol::{LaneDescription, LaneStatus, PoolStatus, Refusal};
pub use memory::TooLittleMemory;
pub use place::{Place, PlaceError, ROOT_VARIABLE, check_name};
pub use services::{Capacity, IpcError};
pub use smaclite_pool::Wait;
pub use spectator::Spectator;
#[doc(hidden)] // for tests that speak iceoryx2 themselves
pub use stay::iceoryx;
pub use supervisor::{Game, LaneConfig, PreparedPool, StartError, Supervisor, SupervisorConfig};
#[doc(hidden)] // for the same tests
pub use variant::PoolService;

use control::client::{ANSWER_TIME, ControlClient};
use control::protocol::{Answer, Ask};

/// What a pool is doing. It has 10 seconds to answer.
pub fn status(place: &Place, pool: &str) -> Result<PoolStatus, ConnectError> {
    status_within(place, pool, Patience { timeout: Some(ANSWER_TIME), interrupted: &mut || false })
}

/// What a pool is doing, if it answers in time.
pub fn status_within(place: &Place, pool: &str, patience: Patience<'_>) -> Result<PoolStatus, ConnectError> {
    match ControlClient::ask(place, pool, &Ask::Status, patience)?.1 {
        Answer::Status(status) => Ok(status),
        Answer::Refused(refusal) => Err(refusal.into()),
        other => Err(Refusal::unexpected(&other).into()),
    }
}

/// Names of the pools that run at a place, sorted. A supervisor that is stopped runs.
pub fn running_pools(place: &Place) -> Vec<String> {
    control::client::running_pools(place)
}
