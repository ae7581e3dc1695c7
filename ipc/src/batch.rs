//! A received frame, read in place. The memory stays valid and unchanged for as long as the batch lives, also
//! after its client and its supervisor are gone.

#![allow(unsafe_code)] // reads the sample at an address taken once

use crate::services::{FramePort, FrameSample};
use crate::wire::FrameHeader;
use faer::MatRef;
use smaclite_pool::fields::Field;
use smaclite_pool::layout::{Element, Layout};
use std::mem::ManuallyDrop;
use std::ptr::NonNull;
use std::sync::Arc;

/// One batch: M slots of every field of the lane.
///
/// In a forked child it is readable, but only unchanged while the parent holds it: the child's copy holds
/// nothing, so after the parent's drop a later frame may be written there.
pub struct Batch {
    /// Only held. Asking it for its payload locks a mutex of its port, which a thread of the parent may have
    /// locked at the moment of a fork.
    sample: ManuallyDrop<FrameSample>,
    /// The sample's payload.
    bytes: NonNull<[u8]>,
    header: FrameHeader,
    layout: Arc<Layout>,
    owner: u32,
    port: ManuallyDrop<Arc<FramePort>>,
}

// SAFETY: everything but `bytes` and `sample` is `Send` by itself. `sample` is, too: iceoryx2 declares it.
// `bytes` is the address of memory that any thread may read.
unsafe impl Send for Batch {}

// SAFETY: a shared batch reads `bytes`, `header` and `layout`, which nothing changes, and leaves `sample` and
// `port` alone until it is dropped, which takes the batch by value.
unsafe impl Sync for Batch {}

impl Batch {
    pub(crate) fn new(sample: FrameSample, layout: Arc<Layout>, port: Arc<FramePort>) -> Batch {
        let (bytes, header) = (NonNull::from(sample.payload()), *sample.user_header());
        let (sample, port) = (ManuallyDrop::new(sample), ManuallyDrop::new(port));
        Batch { sample, bytes, header, layout, owner: std::process::id(), port }
    }

    /// Where each field lies.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The frame's bytes in shared memory.
    pub fn bytes(&self) -> &[u8] {
        // SAFETY: `new` took the address from the sample, whose memory is mapped, initialised, and written by
        // no process until the sample is given back; `drop` does that, and the borrow is that of the batch. A
        // forked child never gives it back, so there it stays mapped; what the parent may do there, the
        // type's documentation says.
        unsafe { self.bytes.as_ref() }
    }

    /// The frame's header.
    pub fn header(&self) -> &FrameHeader {
        &self.header
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

    /// The observations as a matrix with one row per agent, `[M * n_agents, obs_size]`, in place: a policy's
    /// first layer is a matrix product straight from shared memory.
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
