//! A pool over iceoryx2: services, shared-memory layout, the supervisor, the client, and the `smaclite-pool` program.
//! Only this crate knows iceoryx2; it knows nothing of how battles are stepped.
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
//! let mut never = || false;
//! let batch = client.reset(Some(1), None, Patience { timeout: None, interrupted: &mut never })?;
//! assert_eq!(batch.obs_matrix().nrows(), 4 * 5);
//! let mut actions = vec![0; 4 * 5];
//! client.sample_actions(None, &mut actions)?;
//! let batch = client.step(&actions, None, Patience { timeout: None, interrupted: &mut never })?;
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
pub use supervisor::{Game, LaneConfig, StartError, Supervisor, SupervisorConfig};
#[doc(hidden)] // for the same tests
pub use variant::PoolService;

use control::client::ControlClient;
use control::protocol::{Answer, Ask};

/// What a pool is doing.
pub fn status(place: &Place, pool: &str) -> Result<PoolStatus, ConnectError> {
    match ControlClient::connect(place, pool)?.ask(&Ask::Status)? {
        Answer::Status(status) => Ok(status),
        Answer::Refused(refusal) => Err(refusal.into()),
        other => Err(Refusal::Malformed { what: format!("unexpected answer {other:?}") }.into()),
    }
}
