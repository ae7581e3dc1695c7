//! Units of a plane, in groups of which one instruction computes several.

use glam::Vec2;

use crate::arena::BodyStats;
use crate::simd::{Column, F32s, InstructionSet, MAX_WIDTH, Mask, Vec2s};

/// Units, of which the first `len` count; there are groups for all units.
#[derive(Debug, Default)]
pub(in crate::tick) struct Crowd {
    len: usize,
    groups: Vec<Group>,
}

/// Units, one per entry of each column. Ids and sides are exact as floats.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::tick) struct Group {
    at: [Column; 2],
    ids: Column,
    sides: Column,
    radii: Column,
    weights: Column,
}

/// A unit of a crowd. Its id is a float as in a group, which is exact.
#[derive(Clone, Copy)]
pub(in crate::tick) struct Member {
    pub id: f32,
    pub side: f32,
    pub at: Vec2,
    pub body: BodyStats,
}

/// Units of a group, in registers.
pub(in crate::tick) struct Members<S: InstructionSet> {
    pub at: Vec2s<S>,
    pub ids: F32s<S>,
    pub sides: F32s<S>,
    pub radii: F32s<S>,
}

impl Crowd {
    pub fn reserve(&mut self, n_units: usize) {
        self.groups.resize(n_units.div_ceil(MAX_WIDTH), Group::default());
    }

    pub fn clear(&mut self) {
        self.len = 0;
    }

    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Adds a unit.
    #[inline(always)]
    pub fn add(&mut self, member: &Member) {
        self.add_if(true, member);
    }

    /// Adds a unit if a condition holds, without a branch: what units do is hard to predict.
    #[inline(always)]
    pub fn add_if(&mut self, condition: bool, member: &Member) {
        let (group, entry) = (&mut self.groups[self.len / MAX_WIDTH], self.len % MAX_WIDTH);
        for (column, number) in group.at.iter_mut().zip(member.at.to_array()) {
            column[entry] = number;
        }
        (group.ids[entry], group.sides[entry]) = (member.id, member.side);
        (group.radii[entry], group.weights[entry]) = (member.body.radius, member.body.weight);
        self.len += usize::from(condition);
    }

    /// The groups, each with the number of its units.
    #[inline(always)]
    pub fn groups(&self) -> impl Iterator<Item = (usize, &Group)> {
        let mut left = self.len;
        self.groups.iter().map_while(move |group| {
            let len = usize::min(left, MAX_WIDTH);
            left -= len;
            (len > 0).then_some((len, group))
        })
    }
}

impl Group {
    /// Which of the first `len` units a condition holds of, as bits.
    #[inline(always)]
    pub fn which<S: InstructionSet>(
        &self,
        simd: S,
        len: usize,
        condition: impl Fn(&Members<S>) -> Mask<S>,
    ) -> u32 {
        let mut bits = 0;
        // A number of parts that is known: no index is checked.
        for first in (0..MAX_WIDTH / S::WIDTH).map(|part| part * S::WIDTH).take_while(|first| *first < len) {
            let column = |column: &Column| F32s::from_slice(simd, &column[first..]);
            let members = Members {
                at: Vec2s::load_from(simd, &self.at, first),
                ids: column(&self.ids),
                sides: column(&self.sides),
                radii: column(&self.radii),
            };
            bits |= condition(&members).bits() << first;
        }
        // Entries behind the last unit are those of earlier ticks.
        bits & (u32::MAX >> (u32::BITS as usize - len))
    }

    /// One of the units.
    #[inline(always)]
    pub fn member(&self, entry: usize) -> Member {
        Member {
            id: self.ids[entry],
            side: self.sides[entry],
            at: Vec2::new(self.at[0][entry], self.at[1][entry]),
            body: BodyStats { radius: self.radii[entry], weight: self.weights[entry] },
        }
    }
}
