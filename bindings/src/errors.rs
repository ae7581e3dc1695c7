//! Maps every Rust error to an exception class of `smaclite_pool.errors`. The texts are those of the Rust
//! errors.

use pyo3::prelude::*;
use smaclite_engine::Actor;
use smaclite_ipc::{
    ClientError, ConnectError as Connect, ControlError, ControlSocketError as Control, StartError as Start,
};
use smaclite_pool::Rejection;
use smaclite_units::file::{printable_text, without_os_errors};

/// Declares the exception classes, and a function that imports all of them.
macro_rules! exception_classes {
    ($($name:ident)*) => {
        /// The exception classes.
        pub mod class {
            $(pyo3::import_exception!(smaclite_pool.errors, $name);)*
        }

        /// Imports every class. When the interpreter exits, destructors still call this module, and then
        /// nothing can be imported any more.
        pub fn load_classes(py: Python<'_>) {
            $(py.get_type::<class::$name>();)*
        }
    };
}

exception_classes! {
    PoolError
    InvalidRequest
    IllegalAction
    ScenarioError
    StartError
    TooLittleMemory
    ConnectError
    NoSuchPool
    LaneTaken
    PoolDied
    LaneFailed
    Timeout
    TooManyBatchesHeld
    Forked
    Busy
    Closed
}

/// The message of an error that may repeat what a file or an argument says: as the program prints it, without
/// what would change a terminal, and without the numbers of the system's errors.
pub fn shown(error: &impl ToString) -> String {
    without_os_errors(&printable_text(&error.to_string()))
}

/// An invalid argument or request.
pub fn invalid_request(text: impl ToString) -> PyErr {
    class::InvalidRequest::new_err(text.to_string())
}

/// For errors of the methods of [`smaclite_ipc::Client`].
pub fn client_error(error: ClientError) -> PyErr {
    let text = error.to_string();
    match error {
        ClientError::Rejected(rejection) => rejection_error(rejection),
        ClientError::WrongLength { .. }
        | ClientError::NothingToReceive { .. }
        | ClientError::TooFewForBatch { .. }
        | ClientError::NoBatch
        | ClientError::NotInBatch { .. }
        | ClientError::NoMasks
        | ClientError::NoEnemyMasks
        | ClientError::NoSnapshots
        | ClientError::WrongSnapshots { .. }
        | ClientError::NoLevels
        | ClientError::WrongLevels { .. }
        | ClientError::WrongSeeds { .. }
        | ClientError::WrongForks { .. } => invalid_request(text),
        ClientError::Timeout(_) => class::Timeout::new_err(text),
        ClientError::PoolDied { .. } => class::PoolDied::new_err(text),
        ClientError::TooManyHeld { .. } => class::TooManyBatchesHeld::new_err(text),
        ClientError::Forked { .. } => class::Forked::new_err(text),
        ClientError::NotAccepted { .. }
        | ClientError::Interrupted
        | ClientError::FramesLost { .. }
        | ClientError::Control(_)
        | ClientError::Refused(_)
        | ClientError::Ipc(_) => class::PoolError::new_err(text),
    }
}

fn rejection_error(rejection: Rejection) -> PyErr {
    let text = rejection.to_string();
    match rejection {
        Rejection::UnavailableAction { env, actor, action, available } => {
            let (agent, side) = match actor {
                Actor::Agent(agent) => (agent, "allies"),
                Actor::Enemy(enemy) => (enemy, "enemies"),
            };
            class::IllegalAction::new_err((text, env, agent, action, available, side))
        }
        Rejection::LaneFailed { .. } => class::LaneFailed::new_err(text),
        _ => invalid_request(text),
    }
}

/// For errors of attaching to a pool and of requests on its control socket.
pub fn connect_error(error: Connect) -> PyErr {
    let text = error.to_string();
    match error {
        Connect::Refused(ControlError::LaneTaken { learner_pid, .. }) => {
            class::LaneTaken::new_err((text, learner_pid))
        }
        Connect::Refused(ControlError::LaneFailed { .. }) => class::LaneFailed::new_err(text),
        Connect::Control(Control::Name(_)) => invalid_request(text),
        Connect::Control(Control::NoSuchPool { .. }) => class::NoSuchPool::new_err(text),
        Connect::Control(Control::Gone { .. }) => class::PoolDied::new_err(text),
        Connect::Memory(_) => class::TooLittleMemory::new_err(text),
        _ => class::ConnectError::new_err(text),
    }
}

/// For errors of starting a pool.
pub fn start_error(error: Start) -> PyErr {
    let text = error.to_string();
    match error {
        Start::Name(_) | Start::Lane { .. } | Start::NoLanes => invalid_request(text),
        Start::Memory(_) => class::TooLittleMemory::new_err(text),
        _ => class::StartError::new_err(text),
    }
}
