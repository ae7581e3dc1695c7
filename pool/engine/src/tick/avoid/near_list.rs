//! The results of the search for neighbours: which units have neighbours or may see edges, and the neighbours
//! as bits.
//!
//! Results are written before it is known whether they are needed: no branch, which would be hard to predict.

use super::columns::WORD;

/// The units of a plane that have neighbours or may see an edge, with their neighbours.
#[derive(Debug, Default)]
pub(super) struct NearList {
    /// Entries from `n_units` on are stale.
    units: Vec<NearUnit>,
    n_units: usize,
    /// The neighbours of all units, unit by unit; entries from `n_near` on are stale.
    near: Vec<Near>,
    n_near: usize,
    /// Where the neighbours of the unit that is listed next begin.
    begin: usize,
}

/// A unit of the list.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct NearUnit {
    /// The unit's index.
    pub index: u32,
    /// Whether the unit may see an edge. If not, it has neighbours.
    pub may_see_edges: bool,
    /// Where its neighbours begin and end.
    begin: u32,
    end: u32,
}

/// Some neighbours of a unit: those of one word. There is at least one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Near {
    word: u32,
    /// Bit i stands for the unit with index `WORD * word + i`.
    bits: u64,
}

impl NearList {
    /// Reserves memory for `n_units` units.
    pub fn reserve(&mut self, n_units: usize) {
        // One unit, and one word of it, is written and not counted.
        self.units.resize(n_units + 1, NearUnit::default());
        self.near.resize(n_units * n_units.div_ceil(WORD) + 1, Near::default());
    }

    pub fn clear(&mut self) {
        (self.n_units, self.n_near, self.begin) = (0, 0, 0);
    }

    /// Adds neighbours of the unit that is listed next, if there are any.
    #[inline(always)]
    pub fn add_neighbours(&mut self, word: usize, bits: u64) {
        self.near[self.n_near] = Near { word: word as u32, bits };
        self.n_near += usize::from(bits != 0);
    }

    /// Lists a unit with the neighbours that were added since the last one. One that has none and sees no
    /// edges is not listed.
    #[inline(always)]
    pub fn add_unit(&mut self, index: u32, may_see_edges: bool) {
        let (begin, end) = (self.begin as u32, self.n_near as u32);
        self.begin = self.n_near;
        self.units[self.n_units] = NearUnit { index, may_see_edges, begin, end };
        self.n_units += usize::from(may_see_edges | (begin < end));
    }

    /// The units that are listed, and the neighbours of each.
    #[inline(always)]
    pub fn units(&self) -> impl Iterator<Item = (&NearUnit, &[Near])> {
        self.units[..self.n_units].iter().map(
            #[inline(always)]
            |unit| (unit, &self.near[unit.begin as usize..unit.end as usize]),
        )
    }
}

impl Near {
    /// Visits the indices of the neighbours, ascending.
    #[inline(always)]
    pub fn for_each(&self, mut visit: impl FnMut(usize)) {
        let (begin, mut bits) = (self.word as usize * WORD, self.bits);
        while bits != 0 {
            visit(begin + bits.trailing_zeros() as usize);
            // Clears the lowest bit.
            bits &= bits - 1;
        }
    }

    /// These neighbours, all of the first word.
    #[cfg(test)]
    pub fn of(indices: &[usize]) -> Near {
        Near { bits: indices.iter().fold(0, |bits, index| bits | 1 << index), ..Near::default() }
    }
}
