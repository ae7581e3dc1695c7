//! A snapshot as a record of bytes: its columns, one after the other, at places that follow from the number
//! of units. So records of one scenario have equal sizes, can be written in place, and can be kept in arrays.
//!
//! The columns are declared in `columns`.

use bytemuck::Pod;
use serde::{Deserialize, Serialize};

use super::SnapshotError;
use super::columns::{COLUMN_COUNT, COLUMNS, Column, ColumnAxis};
use crate::arena::Arena;
use crate::rules::Rules;
use crate::sizes::Sizes;

/// Increased when a column or the meaning of one changes.
pub const RECORD_VERSION: u32 = 7;

pub(super) const MAGIC: u32 = u32::from_le_bytes(*b"SMSN");

// Columns are copied as the processor has them.
const _: () = assert!(cfg!(target_endian = "little"), "records are little-endian");

/// The most own actions that an observation can have.
pub const MAX_LAST_ACTIONS: usize = 16;

/// The sizes that the places of the columns follow from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordSizes {
    /// Agents.
    pub n_agents: usize,
    /// Enemies.
    pub n_enemies: usize,
    /// Joint actions that are kept for observations.
    pub n_past: usize,
    /// Entries of the column `perception`.
    pub n_perception: usize,
    /// Entries of the columns of phases.
    pub n_phases: usize,
}

impl RecordSizes {
    /// The sizes of the records of battles, with so many joint actions kept.
    pub fn new(sizes: &Sizes, n_past: usize) -> RecordSizes {
        let Sizes { n_agents, n_enemies, perception_size, n_phases, .. } = *sizes;
        RecordSizes { n_agents, n_enemies, n_past, n_perception: perception_size, n_phases }
    }
}

/// Where the columns of a record are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordLayout {
    pub(super) sizes: RecordSizes,
    /// By column; the end of the last one is at the end.
    pub(super) offsets: [usize; COLUMN_COUNT + 1],
}

impl RecordLayout {
    /// Bytes before the first column that says more than what the record is of: ten numbers and the hash of
    /// the scenario.
    pub const START_OF_VALUES: usize = size_of::<[u32; 10]>() + size_of::<u64>();

    /// The layout for these sizes.
    pub fn new(sizes: RecordSizes) -> RecordLayout {
        let mut offsets = [0; COLUMN_COUNT + 1];
        for (i, spec) in COLUMNS.iter().enumerate() {
            // Sizes may be lies of a header.
            let extents = spec.axes.iter().map(|axis| extent(sizes, *axis));
            let bytes = extents.fold(spec.dtype.size(), usize::saturating_mul);
            offsets[i + 1] = usize::saturating_add(offsets[i], bytes);
        }
        RecordLayout { sizes, offsets }
    }

    /// The layout of a record, by its own header; everything but the values of its columns is checked.
    ///
    /// # Errors
    /// If the bytes are no record, are of another version, or were damaged.
    pub fn of(record: &[u8]) -> Result<RecordLayout, SnapshotError> {
        let number = |column: Column| {
            let at = column as usize * size_of::<u32>(); // true of the columns before the first u64
            record.get(at..at + size_of::<u32>()).map(bytemuck::pod_read_unaligned::<u32>)
        };
        if number(Column::Magic) != Some(MAGIC) {
            return Err(SnapshotError::NoRecord);
        }
        let version = number(Column::Version).ok_or(SnapshotError::NoRecord)?;
        if version != RECORD_VERSION {
            return Err(SnapshotError::Version { given: version, expected: RECORD_VERSION });
        }
        let size = |column| number(column).map(|n| n as usize).ok_or(SnapshotError::NoRecord);
        let layout = RecordLayout::new(RecordSizes {
            n_agents: size(Column::NAgents)?,
            n_enemies: size(Column::NEnemies)?,
            n_past: size(Column::NPast)?,
            n_perception: size(Column::NPerception)?,
            n_phases: size(Column::NPhases)?,
        });
        if layout.size() != record.len() {
            return Err(SnapshotError::Size { given: record.len(), expected: layout.size() });
        }
        let (stored, computed) = (number(Column::Checksum), checksum(record));
        if stored == Some(computed) { Ok(layout) } else { Err(SnapshotError::Checksum) }
    }

    /// The rule set of a record.
    ///
    /// # Errors
    /// If the column has no rule set's number.
    ///
    /// # Panics
    /// As [`column`](Self::column).
    pub fn rules(&self, record: &[u8]) -> Result<Rules, SnapshotError> {
        let given: u32 = self.get_one(record, Column::Rules);
        Rules::ALL.get(given as usize).copied().ok_or(SnapshotError::NoSuchRules { given })
    }

    /// The sizes.
    pub fn sizes(&self) -> RecordSizes {
        self.sizes
    }

    /// Bytes of a record, a multiple of 8.
    pub fn size(&self) -> usize {
        self.offsets[COLUMN_COUNT].saturating_add(7) & !7
    }

    /// The extents of a column's axes.
    pub fn shape(&self, column: Column) -> Vec<usize> {
        column.spec().axes.iter().map(|axis| extent(self.sizes, *axis)).collect()
    }

    /// The bytes of a column.
    ///
    /// # Panics
    /// If the record is shorter than [`size`](Self::size).
    pub fn column<'a>(&self, record: &'a [u8], column: Column) -> &'a [u8] {
        &record[self.offsets[column as usize]..self.offsets[column as usize + 1]]
    }

    /// The bytes of a column; after changes, [`seal`](Self::seal) the record.
    ///
    /// # Panics
    /// As [`column`](Self::column).
    pub fn column_mut<'a>(&self, record: &'a mut [u8], column: Column) -> &'a mut [u8] {
        &mut record[self.offsets[column as usize]..self.offsets[column as usize + 1]]
    }

    /// Writes the checksum of a record.
    ///
    /// # Panics
    /// As [`column`](Self::column).
    pub fn seal(&self, record: &mut [u8]) {
        let checksum = checksum(record);
        self.put(record, Column::Checksum, &[checksum]);
    }

    pub(super) fn put<T: Pod>(&self, record: &mut [u8], column: Column, values: &[T]) {
        debug_assert_eq!(size_of::<T>() % column.spec().dtype.size(), 0);
        self.column_mut(record, column).copy_from_slice(bytemuck::cast_slice(values));
    }

    pub(super) fn put_each<T: Pod>(
        &self,
        record: &mut [u8],
        column: Column,
        values: impl Iterator<Item = T>,
    ) {
        for (out, value) in self.column_mut(record, column).chunks_exact_mut(size_of::<T>()).zip(values) {
            out.copy_from_slice(bytemuck::bytes_of(&value));
        }
    }

    pub(super) fn get<'a, T: Pod>(
        &self,
        record: &'a [u8],
        column: Column,
    ) -> impl ExactSizeIterator<Item = T> + use<'a, T> {
        self.column(record, column).chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned)
    }

    /// A column of units by battle-wide id: in a record they are agents first, in a battle in the order of
    /// the scenario's groups.
    pub(super) fn get_by_id<T: Pod>(
        &self,
        record: &[u8],
        column: Column,
        arena: &Arena,
    ) -> impl Iterator<Item = T> {
        let column = self.column(record, column);
        let (len, at) = (column.len() / arena.sizes().n_units(), |id| arena.place(id));
        arena.unit_ids().map(move |id| bytemuck::pod_read_unaligned(&column[at(id) * len..][..len]))
    }

    pub(super) fn get_one<T: Pod>(&self, record: &[u8], column: Column) -> T {
        bytemuck::pod_read_unaligned(self.column(record, column))
    }
}

fn extent(sizes: RecordSizes, axis: ColumnAxis) -> usize {
    match axis {
        ColumnAxis::Unit => sizes.n_agents + sizes.n_enemies,
        ColumnAxis::Past => sizes.n_past,
        ColumnAxis::Perception => sizes.n_perception,
        ColumnAxis::Phase => sizes.n_phases,
        ColumnAxis::Xy => 2,
    }
}

fn checksum(record: &[u8]) -> u32 {
    crc32c::crc32c(&record[2 * size_of::<u32>()..])
}
