//! A received frame, read in place. The memory stays valid and unchanged for as long as the batch lives, also after its
//! client and its supervisor are gone.

#![allow(unsafe_code)] // `Sync` for a sample that is only read

use crate::services::{FramePort, FrameSample};
use crate::wire::FrameHeader;
use faer::MatRef;
use smaclite_pool::fields::Field;
use smaclite_pool::layout::{Element, Layout};
use std::mem::ManuallyDrop;
use std::sync::Arc;

/// One batch: M slots of every field of the lane.
pub struct Batch {
    sample: ManuallyDrop<FrameSample>,
    layout: Arc<Layout>,
    owner: u32,
    port: ManuallyDrop<Arc<FramePort>>,
}

// SAFETY: a `FrameSample` is not `Sync` only because of its reference count, which is touched when it is dropped, and
// that takes the batch by value. The port is only held, and let go of with the batch. Everything a shared batch does is reading the payload and header, which are mapped
// read-only and not written again before the sample is given back.
unsafe impl Sync for Batch {}

impl Batch {
    pub(crate) fn new(sample: FrameSample, layout: Arc<Layout>, port: Arc<FramePort>) -> Batch {
        let (sample, port) = (ManuallyDrop::new(sample), ManuallyDrop::new(port));
        Batch { sample, layout, owner: std::process::id(), port }
    }

    /// Where each field lies.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The frame's bytes in shared memory.
    pub fn bytes(&self) -> &[u8] {
        self.sample.payload()
    }

    /// The frame's header.
    pub fn header(&self) -> &FrameHeader {
        self.sample.user_header()
    }

    /// Counts the frames of the lane, from 1.
    pub fn sequence(&self) -> u64 {
        self.header().sequence
    }

    /// All elements of a field, slot after slot, or `None` if the lane leaves it out.
    ///
    /// # Panics
    /// If `T` is not the field's type ([`Field::spec`]).
    pub fn field<T: Element>(&self, field: Field) -> Option<&[T]> {
        self.layout.view(self.bytes(), field)
    }

    fn always<T: Element>(&self, field: Field) -> &[T] {
        self.field(field).expect("no lane leaves this field out")
    }

    /// `[M]`: which environment each slot is.
    pub fn env_id(&self) -> &[i32] {
        self.always(Field::EnvId)
    }

    /// `[M]`: team reward of the step just made.
    pub fn reward(&self) -> &[f32] {
        self.always(Field::Reward)
    }

    /// `[M]`, 0 or 1: the battle ended.
    pub fn terminated(&self) -> &[u8] {
        self.always(Field::Terminated)
    }

    /// `[M]`, 0 or 1: the episode limit was reached.
    pub fn truncated(&self) -> &[u8] {
        self.always(Field::Truncated)
    }

    /// `[M, n_agents, obs_size]`, row-major; empty if the lane leaves it out.
    pub fn obs(&self) -> &[f32] {
        self.field(Field::Obs).unwrap_or(&[])
    }

    /// The observations as a matrix with one row per agent, `[M * n_agents, obs_size]`, in place: a policy's first
    /// layer is a matrix product straight from shared memory.
    pub fn obs_matrix(&self) -> MatRef<'_, f32> {
        let columns = self.layout.row_len(Field::Obs) / self.layout.sizes().n_agents;
        let obs = self.obs();
        MatRef::from_row_major_slice(obs, obs.len() / columns, columns)
    }
}

impl Drop for Batch {
    fn drop(&mut self) {
        if self.owner == std::process::id() {
            // SAFETY: each is dropped once, here, and not used after.
            unsafe {
                ManuallyDrop::drop(&mut self.sample);
                ManuallyDrop::drop(&mut self.port);
            }
        }
        // A forked child forgets it: giving it back is the parent's right.
    }
}
