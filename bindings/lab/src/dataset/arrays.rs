//! The arrays that a dataset is expanded to, declared once, and memory for them.

use smaclite_engine::Sizes;
use smaclite_pool::fields::{Axis, Dtype};

/// An array; the discriminant is its index in [`ARRAYS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
#[allow(missing_docs)] // `ARRAYS` says what each one means
pub enum ArrayName {
    Obs,
    State,
    AvailActions,
    Actions,
    Reward,
    Terminated,
    Truncated,
    BattleWon,
    FinalObs,
    FinalState,
    FinalAvailActions,
    EpisodeStart,
}

/// What an array has one row for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PerRow {
    /// Every step, in the order of the episodes.
    Step,
    /// Every episode.
    Episode,
}

/// Name, type and shape of an array. Where a lane has a field of that name, they are the same.
#[derive(Clone, Copy, Debug)]
pub struct ArraySpec {
    /// Which array this is.
    pub array: ArrayName,
    /// Its name in Python, in files and in messages.
    pub name: &'static str,
    /// Element type.
    pub dtype: Dtype,
    /// The first axis.
    pub per: PerRow,
    /// The other axes.
    pub axes: &'static [Axis],
    /// One line for documentation.
    pub meaning: &'static str,
}

const fn spec(
    array: ArrayName,
    name: &'static str,
    dtype: Dtype,
    per: PerRow,
    axes: &'static [Axis],
    meaning: &'static str,
) -> ArraySpec {
    ArraySpec { array, name, dtype, per, axes, meaning }
}

/// How many arrays there are.
pub(super) const N_ARRAYS: usize = 12;

use Axis::{Action, Agent, Obs, State};
use Dtype::{Bool, F32, I32};
use PerRow::{Episode, Step};

/// The table of arrays.
pub const ARRAYS: [ArraySpec; N_ARRAYS] = [
    spec(ArrayName::Obs, "obs", F32, Step, &[Agent, Obs], "observations before the step"),
    spec(ArrayName::State, "state", F32, Step, &[State], "state before the step"),
    spec(
        ArrayName::AvailActions,
        "avail_actions",
        Bool,
        Step,
        &[Agent, Action],
        "which actions are available in the step",
    ),
    spec(ArrayName::Actions, "actions", I32, Step, &[Agent], "actions of the step"),
    spec(ArrayName::Reward, "reward", F32, Step, &[], "team reward of the step"),
    spec(ArrayName::Terminated, "terminated", Bool, Step, &[], "the step ended the battle"),
    spec(ArrayName::Truncated, "truncated", Bool, Step, &[], "the step reached the episode limit"),
    spec(ArrayName::BattleWon, "battle_won", Bool, Step, &[], "the step ended the battle in a victory"),
    spec(ArrayName::FinalObs, "final_obs", F32, Episode, &[Agent, Obs], "observations after the last step"),
    spec(ArrayName::FinalState, "final_state", F32, Episode, &[State], "state after the last step"),
    spec(
        ArrayName::FinalAvailActions,
        "final_avail_actions",
        Bool,
        Episode,
        &[Agent, Action],
        "available actions after the last step",
    ),
    spec(ArrayName::EpisodeStart, "episode_start", I32, Episode, &[], "row of the episode's first step"),
];

/// A name that no array has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown array `{0}`; the arrays are {names}", names = ARRAYS.map(|spec| spec.name).join(", "))]
pub struct UnknownArray(pub String);

impl ArrayName {
    /// All of them.
    pub const ALL: [ArrayName; N_ARRAYS] = {
        let mut all = [ArrayName::Obs; N_ARRAYS];
        let mut i = 0;
        while i < N_ARRAYS {
            all[i] = ARRAYS[i].array;
            i += 1;
        }
        all
    };

    /// Its row of [`ARRAYS`].
    pub const fn spec(self) -> &'static ArraySpec {
        &ARRAYS[self as usize]
    }

    /// The array of that name.
    ///
    /// # Errors
    /// If there is none.
    pub fn from_name(name: &str) -> Result<ArrayName, UnknownArray> {
        let found = ARRAYS.iter().find(|spec| spec.name == name);
        found.map(|spec| spec.array).ok_or_else(|| UnknownArray(name.to_owned()))
    }

    /// How many rows it has of so many steps and episodes.
    pub(super) fn n_rows(self, steps: usize, episodes: usize) -> usize {
        match self.spec().per {
            PerRow::Step => steps,
            PerRow::Episode => episodes,
        }
    }

    /// The axes after the first.
    pub fn row_shape(self, sizes: &Sizes) -> Vec<usize> {
        let length = |axis: &Axis| match axis {
            Axis::Agent => sizes.n_agents,
            Axis::Obs => sizes.obs_size,
            Axis::State => sizes.state_size,
            Axis::Action => sizes.n_actions,
            _ => unreachable!("no array of a dataset has this axis"),
        };
        self.spec().axes.iter().map(length).collect()
    }

    /// Bytes of a row.
    pub(super) fn row_bytes(self, sizes: &Sizes) -> usize {
        self.row_shape(sizes).iter().product::<usize>() * self.spec().dtype.size()
    }
}

/// The elements of an array, row by row. The memory is aligned for every element type.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    words: Vec<u32>,
    n_bytes: usize,
}

impl Values {
    pub(super) fn zeros(n_bytes: usize) -> Values {
        Values { words: vec![0; n_bytes.div_ceil(4)], n_bytes }
    }

    /// The elements as a file has them.
    pub fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.n_bytes]
    }

    /// The memory, and how many bytes of it are elements.
    pub fn into_words(self) -> (Vec<u32>, usize) {
        (self.words, self.n_bytes)
    }

    pub(super) fn resize(&mut self, n_bytes: usize) {
        self.words.resize(n_bytes.div_ceil(4), 0);
        self.n_bytes = n_bytes;
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.words)[..self.n_bytes]
    }
}

/// The bytes of the rows of all arrays that belong to some episodes. Arrays that are not wanted are empty.
pub(super) struct Rows<'a> {
    parts: [&'a mut [u8]; N_ARRAYS],
    row_bytes: [usize; N_ARRAYS],
}

impl<'a> Rows<'a> {
    pub fn new(values: &'a mut [Values; N_ARRAYS], sizes: &Sizes) -> Rows<'a> {
        let row_bytes = ArrayName::ALL.map(|array| array.row_bytes(sizes));
        Rows { parts: values.each_mut().map(Values::bytes_mut), row_bytes }
    }

    /// Takes the rows of the first steps and episodes away.
    pub fn take(&mut self, steps: usize, episodes: usize) -> Rows<'a> {
        let row_bytes = self.row_bytes;
        let parts = std::array::from_fn(|i| {
            let rest = std::mem::take(&mut self.parts[i]);
            let rows = ARRAYS[i].array.n_rows(steps, episodes);
            let (front, rest) = rest.split_at_mut(if rest.is_empty() { 0 } else { rows * row_bytes[i] });
            self.parts[i] = rest;
            front
        });
        Rows { parts, row_bytes }
    }

    /// A row of an array of elements of type `T`; `None` if the array is not wanted.
    pub fn row<T: bytemuck::Pod>(&mut self, array: ArrayName, row: usize) -> Option<&mut [T]> {
        debug_assert_eq!(array.spec().dtype.size(), size_of::<T>());
        let size = self.row_bytes[array as usize];
        self.parts[array as usize].get_mut(row * size..(row + 1) * size).map(bytemuck::cast_slice_mut)
    }

    /// The bytes of some rows; empty if the array is not wanted.
    pub fn bytes(&self, array: ArrayName, rows: std::ops::Range<usize>) -> &[u8] {
        let size = self.row_bytes[array as usize];
        self.parts[array as usize].get(rows.start * size..rows.end * size).unwrap_or(&[])
    }
}
