//! Why a learner could not attach, reset, send or receive.

use crate::control::client::{ControlSocketError, in_seconds};
use crate::control::protocol::ControlError;
use crate::os::memory::TooLittleMemory;
use crate::process_owned::NotOwner;
use crate::runtime_dir::RuntimeDirError;
use crate::services::IpcError;
use smaclite_engine::Sizes;
use smaclite_pool::Rejection;
use std::time::Duration;

/// Why a client could not attach.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[allow(missing_docs)] // the inner errors say it
pub enum ConnectError {
    RuntimeDir(#[from] RuntimeDirError),
    Control(#[from] ControlSocketError),
    #[error("{0}")]
    Refused(#[from] ControlError),
    Memory(#[from] TooLittleMemory),
    Ipc(#[from] IpcError),
    #[error(
        "frames of lane `{lane}` have layout {theirs:#x}, but this release computes {ours:#x}; run the same \
         release"
    )]
    Layout {
        lane: String,
        theirs: u64,
        ours: u64,
    },
}

/// Why a client could not reset, send or receive.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum ClientError {
    #[error("{0}")]
    Rejected(#[from] Rejection),
    #[error("got {given} actions; {envs} environments of {} take {expected}", of_each(sizes))]
    WrongLength { given: usize, envs: usize, sizes: Sizes, expected: usize },
    #[error("this lane has no snapshots: name the field `snapshot` among its fields when it is made")]
    NoSnapshots,
    #[error(
        "got {given} bytes of snapshots; {envs} environments take {envs} snapshots of {size} bytes{}",
        difference.as_ref().map_or(String::new(), |difference| format!(": {difference}"))
    )]
    WrongSnapshots {
        given: usize,
        envs: usize,
        size: usize,
        /// How the battles that they are of differ, if their bytes tell.
        difference: Option<String>,
    },
    #[error("this lane has no levels: name the field `level` among its fields when it is made")]
    NoLevels,
    #[error("got {given} numbers; {envs} environments take {envs} levels of {size} numbers")]
    WrongLevels { given: usize, envs: usize, size: usize },
    #[error("seeds must be one, or one per environment, {envs}; got {given}")]
    WrongSeeds { given: usize, envs: usize },
    #[error("a fork takes as many environments to copy as to change, got {from} and {to}")]
    WrongForks { from: usize, to: usize },
    #[error(
        "no batch arrived within {} s; it is still under way: receive it later, or reset",
        in_seconds(*.0)
    )]
    Timeout(Duration),
    #[error(
        "the pool accepted no request for {} s: its supervisor is stopped or overloaded; nothing was sent, \
         try again",
        in_seconds(*time)
    )]
    NotAccepted { time: Duration },
    #[error("interrupted")]
    Interrupted,
    #[error("the supervisor of pool `{pool}` is gone; start it and connect again")]
    PoolDied { pool: String },
    #[error(
        "all {limit} batches that this lane lets a client hold are in use; drop a batch and every array \
         over it, copy what you need longer, or, for a learner, start the lane with more (max_held_batches)"
    )]
    TooManyHeld { limit: usize },
    #[error(
        "nothing to receive: of the {batch_size} results of a batch, {outstanding} are outstanding; send \
         actions first"
    )]
    NothingToReceive { outstanding: usize, batch_size: usize },
    #[error(
        "nothing was sent: with this request {outstanding} of the {batch_size} results of a batch would be \
         outstanding, so none would arrive; use `send`, `async_reset` or `async_fork`, and `recv` later"
    )]
    TooFewForBatch { outstanding: usize, batch_size: usize },
    #[error("there is no batch to sample actions by; receive one first")]
    NoBatch,
    #[error(
        "environment {env} is not in the newest batch, which actions are sampled by; pass the `env_id` of \
         that batch, or some of them"
    )]
    NotInBatch { env: i32 },
    #[error("actions are sampled by the field `avail_actions`, which this lane leaves out of its batches")]
    NoMasks,
    #[error("actions are sampled by `enemy_avail_actions` too, which this lane leaves out of its batches")]
    NoEnemyMasks,
    #[error(
        "frames {first} to {last} were lost: this process did not read them in time; reset all environments"
    )]
    FramesLost { first: u64, last: u64 },
    #[error("this client belongs to process {owner}; a forked process must open its own connection")]
    Forked { owner: u32 },
    #[error(transparent)]
    Ipc(#[from] IpcError),
    #[error(transparent)]
    Control(ControlSocketError),
    #[error("{0}")]
    Refused(#[from] ControlError),
}

impl ClientError {
    /// The error of a later request on the control socket.
    pub(crate) fn of_socket(error: ControlSocketError) -> ClientError {
        match error {
            ControlSocketError::Gone { pool } => ClientError::PoolDied { pool },
            other => ClientError::Control(other),
        }
    }
}

impl From<NotOwner> for ClientError {
    fn from(NotOwner { owner }: NotOwner) -> ClientError {
        ClientError::Forked { owner }
    }
}

/// The units of an environment that actions play.
fn of_each(sizes: &Sizes) -> String {
    let Sizes { n_agents, n_enemies, enemies, .. } = sizes;
    let enemies = enemies.map_or(String::new(), |_| format!(" and {n_enemies} enemies"));
    format!("{n_agents} agents{enemies}")
}
