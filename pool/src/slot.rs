//! Writing a frame from several threads: the memory of a loaned frame, split into slots that one thread each
//! writes. The `unsafe` of this crate lives here and in its one caller, `env_group`.

use crate::fields::Field;
use crate::layout::{BLOCK_ALIGN, Element, Layout};
use bytemuck::{NoUninit, bytes_of};
use std::ptr::{NonNull, null_mut};
use std::sync::atomic::{AtomicPtr, Ordering::Relaxed};

/// The payload of a frame that workers are filling. Its creator keeps the memory alive and gives each slot to
/// one thread at a time.
#[derive(Clone, Copy)]
pub struct FrameMemory {
    base: NonNull<u8>,
    len: usize,
}

// SAFETY: `FrameMemory` is only an address and a length. All access goes through `slot`, whose caller
// guarantees that no two threads access the same slot at once.
unsafe impl Send for FrameMemory {}

impl FrameMemory {
    /// The memory behind `payload`.
    ///
    /// # Panics
    /// If it is not aligned to [`BLOCK_ALIGN`].
    pub fn new(payload: &mut [u8]) -> FrameMemory {
        assert!(payload.as_ptr().addr().is_multiple_of(BLOCK_ALIGN));
        FrameMemory { base: NonNull::from(&mut *payload).cast(), len: payload.len() }
    }

    /// Slot `index` of the frame, for writing.
    ///
    /// # Safety
    /// The payload given to [`FrameMemory::new`] is still alive and not otherwise borrowed, and no other
    /// `Slot` of the same index exists.
    ///
    /// # Panics
    /// If the frame has no such slot or is too small for the layout.
    pub unsafe fn slot<'a>(self, layout: &'a Layout, index: usize) -> Slot<'a> {
        assert!(index < layout.slots() && self.len >= layout.bytes());
        Slot { layout, base: self.base, index }
    }
}

/// The memory of the frame that a parallel loop fills, for all its threads. It publishes nothing: threads
/// load it after they have taken part of the loop, which they can only after it was stored.
pub(crate) struct SharedFrame {
    base: AtomicPtr<u8>,
    /// Of every frame of the lane.
    len: usize,
}

impl SharedFrame {
    /// No frame yet; all will have the size of this layout.
    pub(crate) fn none(layout: &Layout) -> SharedFrame {
        SharedFrame { base: AtomicPtr::new(null_mut()), len: layout.bytes() }
    }

    pub(crate) fn store(&self, memory: Option<FrameMemory>) {
        assert!(memory.is_none_or(|memory| memory.len >= self.len), "a frame is too small for its layout");
        self.base.store(memory.map_or(null_mut(), |memory| memory.base.as_ptr()), Relaxed);
    }

    pub(crate) fn load(&self) -> Option<FrameMemory> {
        NonNull::new(self.base.load(Relaxed)).map(|base| FrameMemory { base, len: self.len })
    }
}

/// One slot of a frame: a row of every field.
pub struct Slot<'a> {
    layout: &'a Layout,
    base: NonNull<u8>,
    index: usize,
}

impl Slot<'_> {
    /// The slot's row of a field, or `None` if the lane omits the field. Until it is written it holds the
    /// data of an earlier frame.
    ///
    /// # Panics
    /// If `T` is not the field's type.
    pub fn row<T: Element>(&mut self, field: Field) -> Option<&mut [T]> {
        assert!(T::is_of(field.spec().dtype), "{}", field.spec().name);
        let len = self.layout.row_len(field);
        let start = self.layout.offset(field)? + self.index * len * size_of::<T>();
        // SAFETY: `slot` checked that the index is below `slots` and the memory holds `Layout::bytes`, and
        // the layout places `slots` rows of `len` elements from the field's offset on, so the row is in
        // bounds. The base is aligned to 64, the offset is a multiple of 64 and the row one of
        // `size_of::<T>()`, so it is aligned. It came as bytes of a slice, so it is initialised, and
        // `Element`s allow any bits. Rows of different slots and fields do not overlap (tested), and the
        // caller of `slot` guarantees that no other thread has this one.
        Some(unsafe { std::slice::from_raw_parts_mut(self.base.as_ptr().add(start).cast::<T>(), len) })
    }

    /// Writes a field of one element per slot, if the lane has it.
    pub fn set<T: Element + NoUninit>(&mut self, field: Field, value: T) {
        // Most of these are as in the frame that had this memory before. A reader's core has their cache
        // lines too, so to write means to wait for it, and to read does not.
        if let Some(row) = self.row::<T>(field)
            && bytes_of(&row[0]) != bytes_of(&value)
        {
            row[0] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fields::FieldSet;
    use smaclite_engine::Sizes;

    #[repr(align(64))]
    struct Aligned([u8; 8192]);

    #[test]
    fn slots_of_several_threads_land_in_their_rows() {
        let sizes =
            Sizes { n_agents: 2, n_enemies: 1, n_actions: 7, obs_size: 3, state_size: 5, ..Sizes::default() };
        let layout = Layout::new(sizes, 0, 8, FieldSet::without_final());
        let mut memory = Box::new(Aligned([0; 8192]));
        let frame = FrameMemory::new(&mut memory.0);
        std::thread::scope(|scope| {
            for worker in 0..4 {
                let layout = &layout;
                scope.spawn(move || {
                    for index in worker * 2..worker * 2 + 2 {
                        // SAFETY: the scope keeps `memory` alive, and each index is visited by one thread,
                        // once.
                        let mut slot = unsafe { frame.slot(layout, index) };
                        slot.set(Field::EnvId, index as i32);
                        slot.row::<f32>(Field::Obs).unwrap().fill(index as f32);
                        assert!(slot.row::<f32>(Field::FinalObs).is_none());
                    }
                });
            }
        });
        let ids: &[i32] = layout.view(&memory.0, Field::EnvId).unwrap();
        assert_eq!(ids, [0, 1, 2, 3, 4, 5, 6, 7]);
        let obs: &[f32] = layout.view(&memory.0, Field::Obs).unwrap();
        for (index, row) in obs.chunks(6).enumerate() {
            assert!(row.iter().all(|x| *x == index as f32), "slot {index}: {row:?}");
        }
    }

    /// Equal elements are not written; 0 and -0 are not equal here.
    #[test]
    fn an_element_has_the_bits_that_were_set_last() {
        let sizes =
            Sizes { n_agents: 1, n_enemies: 1, n_actions: 7, obs_size: 3, state_size: 5, ..Sizes::default() };
        let layout = Layout::new(sizes, 0, 2, FieldSet::without_final());
        let mut memory = Box::new(Aligned([0; 8192]));
        let frame = FrameMemory::new(&mut memory.0);
        for value in [1.5, 0.0, -0.0, 0.0, f32::NAN, 1.5, 1.5] {
            // SAFETY: `memory` is alive, and this is its only slot.
            let mut slot = unsafe { frame.slot(&layout, 1) };
            slot.set(Field::Reward, value);
            assert_eq!(slot.row::<f32>(Field::Reward).unwrap()[0].to_bits(), value.to_bits());
        }
    }
}
