//! The offset of each field in a frame. It is a pure function of the field table, the sizes of the scenario,
//! the number of slots and the chosen fields, so the writer and every reader compute the same offsets. They
//! compare the hash.

use crate::fields::{Axis, Dtype, FIELD_COUNT, FIELDS, Field, FieldSet, FieldSpec};
use smaclite_engine::{LEVEL_COLUMNS, Sizes, fnv::Fnv1a};

/// Increases when the frame header, the request header or the meaning of a field changes.
pub const FORMAT_VERSION: u32 = 5;

/// Every block starts on a cache line, which also suits the widest vector loads and DLPack consumers.
pub const BLOCK_ALIGN: usize = 64;

/// Frames also carry rejections as text, so the frames of small lanes have room for the longest one: it lists
/// all actions of the largest scenario.
pub(crate) const MIN_FRAME_BYTES: usize = 8192;

/// Offsets of all fields of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    sizes: Sizes,
    snapshot_size: usize,
    slots: usize,
    fields: FieldSet,
    offsets: [usize; FIELD_COUNT],
    /// Elements of one slot.
    rows: [usize; FIELD_COUNT],
    bytes: usize,
    hash: u64,
}

impl Layout {
    /// The layout of a frame of `slots` slots. `snapshot_size` are the bytes of a snapshot.
    pub fn new(sizes: Sizes, snapshot_size: usize, slots: usize, fields: FieldSet) -> Layout {
        let extent = |axis: &Axis| extent(sizes, snapshot_size, *axis);
        let mut offsets = [usize::MAX; FIELD_COUNT];
        let row = |spec: &FieldSpec| spec.axes.iter().map(extent).product::<usize>();
        let rows = FIELDS.each_ref().map(row);
        let mut end = 0usize;
        let mut hash = Fnv1a::default();
        hash.write_u64(u64::from(FORMAT_VERSION));
        hash.write_u64(slots as u64);
        for field in fields.iter() {
            let spec = field.spec();
            offsets[field as usize] = end;
            let row = rows[field as usize];
            hash.write(spec.name.as_bytes());
            hash.write(spec.dtype.name().as_bytes());
            spec.axes.iter().for_each(|a| hash.write_u64(extent(a) as u64));
            hash.write_u64(end as u64);
            end = (end + slots * row * spec.dtype.size()).next_multiple_of(BLOCK_ALIGN);
        }
        Layout {
            sizes,
            snapshot_size,
            slots,
            fields,
            offsets,
            rows,
            bytes: end.max(MIN_FRAME_BYTES),
            hash: hash.finish(),
        }
    }

    /// The scenario's sizes.
    pub fn sizes(&self) -> Sizes {
        self.sizes
    }

    /// Bytes of a snapshot.
    pub fn snapshot_size(&self) -> usize {
        self.snapshot_size
    }

    /// Floats of a level; 0 if frames have none.
    pub fn level_len(&self) -> usize {
        if self.fields.contains(Field::Level) { self.row_len(Field::Level) } else { 0 }
    }

    /// Slots of a frame.
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// The fields of a frame.
    pub fn fields(&self) -> FieldSet {
        self.fields
    }

    /// Bytes of a frame's payload.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Equal exactly when version, slots, fields, types, shapes and offsets are.
    pub fn hash(&self) -> u64 {
        self.hash
    }

    /// Elements of one slot of a field.
    pub fn row_len(&self, field: Field) -> usize {
        self.rows[field as usize]
    }

    /// Shape of a field for `slots` slots: `[slots, ...]`.
    pub fn shape(&self, field: Field) -> Vec<usize> {
        let extents = field.spec().axes.iter().map(|axis| extent(self.sizes, self.snapshot_size, *axis));
        std::iter::once(self.slots).chain(extents).collect()
    }

    /// First byte of a field, a multiple of [`BLOCK_ALIGN`]; `None` if the lane omits the field.
    pub fn offset(&self, field: Field) -> Option<usize> {
        self.fields.contains(field).then(|| self.offsets[field as usize])
    }

    /// The field's elements in a frame, or `None` if the lane omits it.
    ///
    /// # Panics
    /// If `T` is not the field's type, or `frame` is shorter than [`Layout::bytes`] or not aligned to 4.
    pub fn view<'a, T: Element>(&self, frame: &'a [u8], field: Field) -> Option<&'a [T]> {
        assert!(T::is_of(field.spec().dtype), "{}", field.spec().name);
        let start = self.offset(field)?;
        let len = self.slots * self.row_len(field) * size_of::<T>();
        Some(bytemuck::cast_slice(&frame[start..start + len]))
    }
}

fn extent(sizes: Sizes, snapshot_size: usize, axis: Axis) -> usize {
    match axis {
        Axis::Agent => sizes.n_agents,
        Axis::Obs => sizes.obs_size,
        Axis::State => sizes.state_size,
        Axis::Action => sizes.n_actions,
        Axis::Enemy => sizes.n_enemies,
        Axis::EnemyObs => sizes.enemies.map_or(0, |enemies| enemies.obs_size),
        Axis::EnemyState => sizes.enemies.map_or(0, |enemies| enemies.state_size),
        Axis::EnemyAction => sizes.enemies.map_or(0, |enemies| enemies.n_actions),
        Axis::Snapshot => snapshot_size,
        Axis::Unit => sizes.n_units(),
        Axis::LevelColumn => LEVEL_COLUMNS.len(),
    }
}

/// A Rust type that a field can have; booleans are read as the bytes they are.
pub trait Element: bytemuck::AnyBitPattern {
    /// Whether it represents this field type.
    fn is_of(dtype: Dtype) -> bool;
}

impl Element for f32 {
    fn is_of(dtype: Dtype) -> bool {
        dtype == Dtype::F32
    }
}
impl Element for i32 {
    fn is_of(dtype: Dtype) -> bool {
        dtype == Dtype::I32
    }
}
impl Element for u8 {
    fn is_of(dtype: Dtype) -> bool {
        matches!(dtype, Dtype::Bool | Dtype::U8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use smaclite_engine::EnemySizes;

    fn sizes() -> impl Strategy<Value = Sizes> {
        (1usize..40, 1usize..80, 1usize..90, 1usize..400, 1usize..900).prop_map(
            |(n_agents, n_enemies, n_actions, obs_size, state_size)| Sizes {
                n_agents,
                n_enemies,
                n_actions,
                obs_size,
                state_size,
                perception_size: 0,
                n_phases: 0,
                enemies: Some(EnemySizes { n_actions: obs_size, obs_size: n_actions, state_size: n_agents }),
            },
        )
    }

    /// Bytes of another type would be nonsense without an error.
    #[test]
    fn a_field_is_viewed_as_its_own_type_alone() {
        let enemies = Some(EnemySizes { n_actions: 3, obs_size: 4, state_size: 5 });
        let (n_agents, n_enemies, n_actions) = (2, 3, 9);
        let sizes =
            Sizes { n_agents, n_enemies, n_actions, obs_size: 7, state_size: 8, enemies, ..Sizes::default() };
        let layout = Layout::new(sizes, 40, 2, FieldSet::ALL);
        let words = vec![0_u32; layout.bytes().div_ceil(4)];
        let frame: &[u8] = bytemuck::cast_slice(&words);
        fn has_view<T: Element>(layout: &Layout, frame: &[u8], field: Field) -> bool {
            std::panic::catch_unwind(|| layout.view::<T>(frame, field).is_some()).unwrap_or(false)
        }
        for field in layout.fields().iter() {
            let dtype = field.spec().dtype;
            let views =
                [has_view::<f32>, has_view::<i32>, has_view::<u8>].map(|view| view(&layout, frame, field));
            let is_bytes = matches!(dtype, Dtype::U8 | Dtype::Bool);
            assert_eq!(views, [dtype == Dtype::F32, dtype == Dtype::I32, is_bytes], "{}", field.spec().name);
        }
    }

    proptest! {
        #[test]
        fn blocks_are_aligned_disjoint_and_inside(sizes in sizes(), slots in 1usize..70) {
            let layout = Layout::new(sizes, 40, slots, FieldSet::ALL);
            let mut end = 0;
            for field in layout.fields().iter() {
                let start = layout.offset(field).unwrap();
                prop_assert_eq!(start % BLOCK_ALIGN, 0);
                prop_assert!(start >= end, "{} overlaps its predecessor", field.spec().name);
                let [first, row @ ..] = &layout.shape(field)[..] else { panic!("a shape without slots") };
                prop_assert_eq!((*first, row.iter().product::<usize>()), (slots, layout.row_len(field)));
                end = start + layout.row_len(field) * slots * field.spec().dtype.size();
            }
            prop_assert!(end <= layout.bytes());
        }

        #[test]
        fn the_hash_tells_layouts_apart(sizes in sizes(), slots in 1usize..70) {
            let hash = Layout::new(sizes, 40, slots, FieldSet::ALL).hash();
            prop_assert_ne!(hash, Layout::new(sizes, 40, slots + 1, FieldSet::ALL).hash());
            prop_assert_ne!(hash, Layout::new(sizes, 40, slots, FieldSet::without_final()).hash());
            let wider = Sizes { obs_size: sizes.obs_size + 1, ..sizes };
            prop_assert_ne!(hash, Layout::new(wider, 40, slots, FieldSet::ALL).hash());
            prop_assert_eq!(hash, Layout::new(sizes, 40, slots, FieldSet::ALL).hash());
        }
    }
}
