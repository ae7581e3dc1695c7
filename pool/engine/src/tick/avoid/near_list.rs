//! The results of the search for neighbours: which units have neighbours or may see edges, and the neighbours
//! as bits.
//!
//! Results are written before it is known whether they are needed: no branch, which would be hard to predict.

use super::columns::WORD;

/// The units of a plane that have neighbours or may see an edge, with their neighbours.
#[derive(Debug, Default)]
pub(super) struct NearList {
    /// Unit by unit. Entries from `n` on are stale.
    entries: Vec<Near>,
    n: usize,
}

/// Some neighbours of a unit, those of one word; or that the unit may see an edge.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Near {
    /// The unit's index.
    index: u32,
    /// Enough for four million units; scenarios have at most 1,000.
    word: u16,
    /// Whether this entry says that the unit may see an edge. It is the unit's first then, and has no
    /// neighbours.
    may_see_edges: bool,
    /// Bit i stands for the unit with index `WORD * word + i`.
    bits: u64,
}

/// A unit of the list: it has neighbours, or may see an edge, or both.
pub(super) struct NearUnit<'a> {
    pub index: usize,
    pub may_see_edges: bool,
    pub neighbours: &'a [Near],
}

impl NearList {
    /// Reserves memory for `n_units` units.
    pub fn reserve(&mut self, n_units: usize) {
        // Every unit has at most one entry per word, and one more.
        self.entries.resize(n_units * (n_units.div_ceil(WORD) + 1), Near::default());
    }

    /// Removes all units.
    pub fn clear(&mut self) {
        self.n = 0;
    }

    /// Notes whether a unit may see an edge, before its neighbours are added.
    #[inline(always)]
    pub fn add_unit(&mut self, index: u32, may_see_edges: bool) {
        self.entries[self.n] = Near { index, word: 0, may_see_edges, bits: 0 };
        self.n += usize::from(may_see_edges);
    }

    /// Adds the neighbours of a unit in a word, if there are any.
    #[inline(always)]
    pub fn add_neighbours(&mut self, index: u32, word: usize, bits: u64) {
        self.entries[self.n] = Near { index, word: word as u16, may_see_edges: false, bits };
        self.n += usize::from(bits != 0);
    }

    /// The units of the list.
    #[inline(always)]
    pub fn units(&self) -> impl Iterator<Item = NearUnit<'_>> {
        self.entries[..self.n].chunk_by(|a, b| a.index == b.index).map(
            #[inline(always)]
            |entries| {
                let Near { index, may_see_edges, .. } = entries[0];
                let neighbours = &entries[usize::from(may_see_edges)..];
                NearUnit { index: index as usize, may_see_edges, neighbours }
            },
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
