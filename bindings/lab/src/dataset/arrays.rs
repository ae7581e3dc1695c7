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

    /// Elements of a row.
    pub(super) fn row_len(self, sizes: &Sizes) -> usize {
        self.row_shape(sizes).iter().product()
    }
}

/// The elements of an array, row by row.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Values {
    F32(Vec<f32>),
    I32(Vec<i32>),
    /// Each 0 or 1.
    Bool(Vec<u8>),
}

impl Values {
    pub(super) fn zeros(dtype: Dtype, len: usize) -> Values {
        match dtype {
            Dtype::F32 => Values::F32(vec![0.0; len]),
            Dtype::I32 => Values::I32(vec![0; len]),
            Dtype::Bool | Dtype::U8 => Values::Bool(vec![0; len]),
        }
    }

    /// Number of elements.
    pub fn len(&self) -> usize {
        match self {
            Values::F32(values) => values.len(),
            Values::I32(values) => values.len(),
            Values::Bool(values) => values.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The elements as a file has them.
    pub fn bytes(&self) -> &[u8] {
        match self {
            Values::F32(values) => bytemuck::cast_slice(values),
            Values::I32(values) => bytemuck::cast_slice(values),
            Values::Bool(values) => values,
        }
    }

    pub(super) fn resize(&mut self, len: usize) {
        match self {
            Values::F32(values) => values.resize(len, 0.0),
            Values::I32(values) => values.resize(len, 0),
            Values::Bool(values) => values.resize(len, 0),
        }
    }

    fn part(&mut self) -> Part<'_> {
        match self {
            Values::F32(values) => Part::F32(values),
            Values::I32(values) => Part::I32(values),
            Values::Bool(values) => Part::Bool(values),
        }
    }
}

/// Some rows of an array.
enum Part<'a> {
    F32(&'a mut [f32]),
    I32(&'a mut [i32]),
    Bool(&'a mut [u8]),
}

impl<'a> Part<'a> {
    fn split_at(self, len: usize) -> (Part<'a>, Part<'a>) {
        match self {
            Part::F32(values) => {
                let (front, back) = values.split_at_mut(len);
                (Part::F32(front), Part::F32(back))
            }
            Part::I32(values) => {
                let (front, back) = values.split_at_mut(len);
                (Part::I32(front), Part::I32(back))
            }
            Part::Bool(values) => {
                let (front, back) = values.split_at_mut(len);
                (Part::Bool(front), Part::Bool(back))
            }
        }
    }

    fn bytes(&self) -> &[u8] {
        match self {
            Part::F32(values) => bytemuck::cast_slice(values),
            Part::I32(values) => bytemuck::cast_slice(values),
            Part::Bool(values) => values,
        }
    }
}

/// Rows of all arrays that belong to some episodes. Arrays that are not wanted are empty.
pub(super) struct Rows<'a> {
    parts: [Part<'a>; N_ARRAYS],
    row_lens: [usize; N_ARRAYS],
}

impl<'a> Rows<'a> {
    pub fn new(values: &'a mut [Values; N_ARRAYS], sizes: &Sizes) -> Rows<'a> {
        let row_lens = ArrayName::ALL.map(|array| array.row_len(sizes));
        Rows { parts: values.each_mut().map(Values::part), row_lens }
    }

    /// The rows of the first steps and episodes, and the rest.
    pub fn split_at(self, steps: usize, episodes: usize) -> (Rows<'a>, Rows<'a>) {
        let Rows { parts, row_lens } = self;
        let mut back = Vec::with_capacity(N_ARRAYS);
        let mut i = 0;
        let front = parts.map(|part| {
            let rows = if ARRAYS[i].per == Step { steps } else { episodes };
            let len = if part.bytes().is_empty() { 0 } else { rows * row_lens[i] };
            let (front, rest) = part.split_at(len);
            back.push(rest);
            i += 1;
            front
        });
        let mut back = back.into_iter();
        let back = front.each_ref().map(|_| back.next().unwrap_or(Part::Bool(&mut [])));
        (Rows { parts: front, row_lens }, Rows { parts: back, row_lens })
    }

    fn range(&self, array: ArrayName, row: usize) -> std::ops::Range<usize> {
        let len = self.row_lens[array as usize];
        row * len..(row + 1) * len
    }

    /// A row of an array of floats; `None` if the array is not wanted.
    pub fn floats(&mut self, array: ArrayName, row: usize) -> Option<&mut [f32]> {
        let range = self.range(array, row);
        match &mut self.parts[array as usize] {
            Part::F32(values) => values.get_mut(range),
            _ => None,
        }
    }

    /// A row of an array of integers.
    pub fn integers(&mut self, array: ArrayName, row: usize) -> Option<&mut [i32]> {
        let range = self.range(array, row);
        match &mut self.parts[array as usize] {
            Part::I32(values) => values.get_mut(range),
            _ => None,
        }
    }

    /// A row of an array of truth values.
    pub fn bools(&mut self, array: ArrayName, row: usize) -> Option<&mut [u8]> {
        let range = self.range(array, row);
        match &mut self.parts[array as usize] {
            Part::Bool(values) => values.get_mut(range),
            _ => None,
        }
    }

    /// The bytes of some rows; empty if the array is not wanted.
    pub fn bytes(&self, array: ArrayName, rows: std::ops::Range<usize>) -> &[u8] {
        let bytes = self.parts[array as usize].bytes();
        let row_bytes = self.row_lens[array as usize] * array.spec().dtype.size();
        bytes.get(rows.start * row_bytes..rows.end * row_bytes).unwrap_or(&[])
    }
}
