//! The test kit: what several tests share. The tests themselves are in the files and folders next to `src`.
//!
//! For the engine: [`Recording`] reads battles recorded from the published environment, from the folder that
//! the environment variable `SMACLITE_TRACES` names, else from `golden` (`golden/README.md` describes the
//! format); [`compare`] compares them with the engine's battles.
//!
//! For pools: [`LanePlan`] and [`PoolPlan`] describe lanes and pools. [`Reference`] computes every [`Row`] of
//! every frame that a lane must produce, and [`conformance`] checks every way to step one. [`long_run`]
//! compares very many steps by their checksums. [`fault`] makes an environment fail, sleep or wait. [`heap`]
//! counts allocations.
//! - In one process: [`in_memory`] is a transport of channels and vectors.
//! - With real processes: a [`Child`] is the running program itself, started again with one of the [`roles`],
//!   and the parent sends it commands as lines of text. Every test has a [`TestDir`], so that tests do not
//!   see each other's pools. A [`Learner`] compares every frame with the reference. [`raw_client`] sends
//!   requests that the real client would never send, [`other_user`] acts as another user of the machine,
//!   [`crash_points`] kills a pool at a given system call, and [`fork`] forks. [`chaos`] does all of this at
//!   random.
#![deny(unsafe_code)] // exceptions: `fork`, and unsafe traits that `heap` and `in_memory` implement

pub mod chaos;
pub mod compare;
pub mod conformance;
pub mod crash_points;
pub mod fault;
pub mod fork;
pub mod heap;
pub mod in_memory;
pub mod learner;
pub mod long_run;
pub mod npy;
pub mod other_user;
mod own_features;
pub mod plan;
pub mod process;
pub mod raw_client;
pub mod recording;
pub mod reference;
mod resources;
pub mod roles;
pub mod row;
pub mod skip;
pub mod test_dir;
pub mod waiting;

pub use learner::Learner;
pub use plan::{LanePlan, PoolPlan};
pub use process::Child;
pub use recording::Recording;
pub use reference::Reference;
pub use row::Row;
pub use skip::skip;
pub use test_dir::TestDir;
