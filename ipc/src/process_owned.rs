//! The fork guard: only the process that made a value changes or drops it.
//!
//! A forked child has a copy of all its parent's memory, and of its open files. If it dropped a port, a
//! sample or a lock of its parent, the parent would lose them.

#![allow(unsafe_code)] // the drop that a forked child must leave out

use crate::os::process_id;
use std::mem::ManuallyDrop;
use std::ops::Deref;

/// A value of the process that made it. A forked child can read its copy, and never drops it.
pub struct ProcessOwned<T> {
    value: ManuallyDrop<T>,
    owner: u32,
}

/// This process is a forked child of the owner.
#[derive(Clone, Copy, Debug)]
pub struct NotOwner {
    /// The process that owns the value.
    pub owner: u32,
}

impl<T> ProcessOwned<T> {
    /// A value of this process.
    pub fn new(value: T) -> Self {
        ProcessOwned { value: ManuallyDrop::new(value), owner: process_id() }
    }

    /// The value, for a change, if this process owns it.
    ///
    /// # Errors
    /// If this process is a forked child of the owner.
    pub fn get_mut(&mut self) -> Result<&mut T, NotOwner> {
        self.check()?;
        Ok(&mut self.value)
    }

    /// Whether this process made the value.
    ///
    /// # Errors
    /// If this process is a forked child of the owner.
    pub fn check(&self) -> Result<(), NotOwner> {
        if self.owner == process_id() { Ok(()) } else { Err(NotOwner { owner: self.owner }) }
    }
}

impl<T> Deref for ProcessOwned<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> Drop for ProcessOwned<T> {
    fn drop(&mut self) {
        if self.check().is_ok() {
            // SAFETY: this is the only place that drops the value. `drop` runs once, and afterwards nothing
            // uses the value: the guard is gone.
            unsafe { ManuallyDrop::drop(&mut self.value) }
        }
    }
}
