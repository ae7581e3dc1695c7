//! Units of a plane, in groups that one instruction computes.

use glam::Vec2;

use crate::arena::BodyStats;
use crate::simd::x4::{F32x4, Four, Vec2x4, WIDTH};

/// Units, of which the first `len` count; there are groups for all units.
#[derive(Debug, Default)]
pub(in crate::tick) struct Crowd {
    len: usize,
    groups: Vec<Group>,
}

/// Four units, one per entry of each column. Ids and sides are exact as floats.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::tick) struct Group {
    at: [[f32; WIDTH]; 2],
    ids: [f32; WIDTH],
    sides: [f32; WIDTH],
    radii: [f32; WIDTH],
    weights: [f32; WIDTH],
}

/// A unit of a crowd.
#[derive(Clone, Copy)]
pub(in crate::tick) struct Member {
    pub id: u32,
    pub side: f32,
    pub at: Vec2,
    pub body: BodyStats,
}

impl Crowd {
    pub fn reserve(&mut self, n_units: usize) {
        self.groups.resize(n_units.div_ceil(WIDTH), Group::default());
    }

    pub fn clear(&mut self) {
        self.len = 0;
    }

    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Adds a unit if a condition holds, without a branch: what units do is hard to predict.
    #[inline(always)]
    pub fn add_if(&mut self, condition: bool, member: &Member) {
        let (group, entry) = (&mut self.groups[self.len / WIDTH], self.len % WIDTH);
        for (column, number) in group.at.iter_mut().zip(member.at.to_array()) {
            column[entry] = number;
        }
        (group.ids[entry], group.sides[entry]) = (member.id as f32, member.side);
        (group.radii[entry], group.weights[entry]) = (member.body.radius, member.body.weight);
        self.len += usize::from(condition);
    }

    /// Fills the last group with units that are near no other, and returns the groups.
    pub fn padded(&mut self) -> &[Group] {
        let nowhere = Member { id: u32::MAX, side: 0.0, at: Vec2::INFINITY, body: BodyStats::default() };
        while !self.len.is_multiple_of(WIDTH) {
            self.add_if(true, &nowhere);
        }
        &self.groups[..self.len / WIDTH]
    }
}

impl Group {
    /// The positions of the units.
    #[inline(always)]
    pub fn at(&self, four: Four) -> Vec2x4 {
        let [x, y] = self.at.map(|numbers| F32x4::new(four, numbers));
        Vec2x4 { x, y }
    }

    #[inline(always)]
    pub fn radii(&self, four: Four) -> F32x4 {
        F32x4::new(four, self.radii)
    }

    #[inline(always)]
    pub fn ids(&self, four: Four) -> F32x4 {
        F32x4::new(four, self.ids)
    }

    #[inline(always)]
    pub fn sides(&self, four: Four) -> F32x4 {
        F32x4::new(four, self.sides)
    }

    /// Which of the units overlap another, as bits.
    #[inline(always)]
    pub fn touching(&self, four: Four, unit: &Member) -> u32 {
        let way = Vec2x4::splat(four, unit.at) - self.at(four);
        let reach = F32x4::splat(four, unit.body.radius) + self.radii(four);
        way.length_squared().lt(reach * reach).bits()
    }

    /// One of the units.
    #[inline(always)]
    pub fn member(&self, entry: usize) -> Member {
        Member {
            id: self.ids[entry] as u32,
            side: self.sides[entry],
            at: Vec2::new(self.at[0][entry], self.at[1][entry]),
            body: BodyStats { radius: self.radii[entry], weight: self.weights[entry] },
        }
    }
}
