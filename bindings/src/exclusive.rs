//! What one thread at a time uses, of one process.

use crate::errors::{class, client_error};
use crate::exit;
use pyo3::PyResult;
use smaclite_ipc::{ClientError, ProcessOwned};
use std::sync::{Mutex, MutexGuard, TryLockError};

/// A value until it is closed. No call waits for another: a signal handler that runs during a call would wait
/// for its own thread, and a forked child for a thread that only its parent has.
pub struct Exclusive<T> {
    value: Mutex<Option<T>>,
    /// Who made it. Beside the mutex, as a forked child may have a copy that stays locked.
    process: ProcessOwned<()>,
    texts: Texts,
}

/// What errors say.
pub struct Texts {
    pub closed: &'static str,
    pub busy: &'static str,
    pub panicked: &'static str,
}

/// The value, until the end of a call.
pub type Guard<'a, T> = MutexGuard<'a, Option<T>>;

impl<T> Exclusive<T> {
    pub fn new(value: T, texts: Texts) -> Exclusive<T> {
        Exclusive { value: Mutex::new(Some(value)), process: ProcessOwned::new(()), texts }
    }

    /// Locks the value, which is there, for one call.
    pub fn try_lock(&self) -> PyResult<Guard<'_, T>> {
        if exit::is_exiting() {
            return Err(exit::exiting_error());
        }
        self.process.check().map_err(|error| client_error(ClientError::from(error)))?;
        match self.value.try_lock() {
            Ok(value) if value.is_some() => Ok(value),
            Ok(_) => Err(class::Closed::new_err(self.texts.closed)),
            Err(TryLockError::WouldBlock) => Err(class::Busy::new_err(self.texts.busy)),
            Err(TryLockError::Poisoned(_)) => Err(class::PoolError::new_err(self.texts.panicked)),
        }
    }

    /// Takes the value out, unless another thread's call is using it: then `None`. There is nothing to take
    /// if it was taken before, or in a forked child.
    pub fn take_if_idle(&self) -> Option<Option<T>> {
        if self.process.check().is_err() {
            return Some(None);
        }
        match self.value.try_lock() {
            Ok(mut value) => Some(value.take()),
            Err(TryLockError::Poisoned(value)) => Some(value.into_inner().take()),
            Err(TryLockError::WouldBlock) => None,
        }
    }
}
