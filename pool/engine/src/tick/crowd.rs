//! Units packed for searches by position.

use glam::Vec2;

use crate::fast_math;
use crate::simd::{F32x4, MASK_BITS, Vec2x4, WIDTH, mask};
use crate::units::{clear_and_reserve, refill};

/// Some units, packed for one tick, and the searches among them.
///
/// Searches compute squared distances in f32, with a relative error below 2^-21: four roundings. Their
/// margins are far larger, so they find some units too many, but miss none.
#[derive(Debug, Default)]
pub(super) struct Crowd {
    /// Battle-wide ids, ascending.
    ids: Vec<u32>,
    /// The positions, four per entry. The last entry is padded with positions at infinity, which no search
    /// finds.
    positions: Vec<Vec2x4>,
    /// Around each [`MASK_BITS`] units.
    boxes: Vec<Bounds>,
}

/// The smallest box around some points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    lower: Vec2,
    upper: Vec2,
}

/// Squared distances that differ by less than this factor are compared in f64.
const MARGIN: f32 = 1.0001;

/// Entries of four positions in a block of [`MASK_BITS`] units.
const FOURS: usize = MASK_BITS / WIDTH;

impl Crowd {
    pub fn reserve(&mut self, n_units: usize) {
        clear_and_reserve(&mut self.ids, n_units);
        clear_and_reserve(&mut self.positions, n_units.div_ceil(WIDTH));
        clear_and_reserve(&mut self.boxes, n_units.div_ceil(MASK_BITS));
    }

    pub fn clear(&mut self) {
        self.ids.clear();
        self.positions.clear();
        self.boxes.clear();
    }

    /// Replaces the units; `positions` are by battle-wide id.
    pub fn gather(&mut self, ids: impl Iterator<Item = u32>, positions: &[Vec2]) {
        refill(&mut self.ids, ids);
        let fours = self.ids.chunks(WIDTH).map(|ids| {
            Vec2x4::new(std::array::from_fn(|i| {
                ids.get(i).map_or(Vec2::INFINITY, |&id| positions[id as usize])
            }))
        });
        refill(&mut self.positions, fours);
        refill(&mut self.boxes, self.positions.chunks(FOURS).map(Bounds::of));
    }

    /// All units, by ascending id.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// The box around all units.
    pub fn bounds(&self) -> Bounds {
        self.boxes.iter().fold(Bounds::default(), Bounds::and)
    }

    /// Visits by ascending id those that may be the nearest within a [`search_bound`] of a position. Returns a
    /// squared distance that all others are farther than; it is more than that of the search radius if all
    /// others are beyond it.
    #[inline(always)]
    pub fn visit_nearest(&self, position: Vec2, bound: f32, visit: impl FnMut(u32)) -> f64 {
        let centre = Vec2x4::splat(position);
        let mut least = bound;
        for (bounds, fours) in self.boxes.iter().zip(self.positions.chunks(FOURS)) {
            if bounds.distance_squared(position) <= least {
                let mut nearest = F32x4::splat(least);
                for four in fours {
                    nearest = nearest.fast_min((*four - centre).length_squared());
                }
                least = nearest.to_array().into_iter().fold(least, fast_math::min);
            }
        }
        // The least positive number makes up for squares that are too small to have a relative error.
        let within = fast_math::min(least * MARGIN + f32::MIN_POSITIVE, bound);
        if least < bound {
            self.visit_within(position, within, visit);
        }
        // Half of the margin is more than the error of `within` and of the distances compared with it.
        f64::from(within) * (1.0 - f64::from(MARGIN - 1.0) / 2.0)
    }

    /// Visits by ascending id all units within a [`search_bound`], or another squared distance, of a position,
    /// and perhaps some that are a little farther.
    #[inline(always)]
    pub fn visit_within(&self, position: Vec2, bound: f32, mut visit: impl FnMut(u32)) {
        let (centre, limit) = (Vec2x4::splat(position), F32x4::splat(bound));
        let blocks = self.positions.chunks(FOURS).zip(self.ids.chunks(MASK_BITS));
        for (bounds, (fours, ids)) in self.boxes.iter().zip(blocks) {
            if bounds.distance_squared(position) <= bound {
                let mut near = mask(fours, |four| (*four - centre).length_squared().simd_le(limit));
                while near != 0 {
                    visit(ids[near.trailing_zeros() as usize]);
                    // Clears the lowest bit.
                    near &= near - 1;
                }
            }
        }
    }
}

/// The square of a search radius with the margin; finite, so that no search finds the padding.
pub(crate) fn search_bound(radius: f64) -> f32 {
    fast_math::min((radius * radius) as f32 * MARGIN, f32::MAX)
}

impl Default for Bounds {
    /// Around no point.
    fn default() -> Bounds {
        Bounds { lower: Vec2::INFINITY, upper: Vec2::NEG_INFINITY }
    }
}

impl Bounds {
    fn of(fours: &[Vec2x4]) -> Bounds {
        let (mut lower, mut upper) = (Vec2x4::splat(Vec2::INFINITY), Vec2x4::splat(Vec2::NEG_INFINITY));
        for four in fours {
            lower = Vec2x4 { x: lower.x.fast_min(four.x), y: lower.y.fast_min(four.y) };
            // The padding is no upper bound.
            let is_unit = four.x.simd_lt(F32x4::splat(f32::INFINITY));
            let four = Vec2x4::either(is_unit, *four, upper);
            upper = Vec2x4 { x: upper.x.fast_max(four.x), y: upper.y.fast_max(four.y) };
        }
        let least = |of: F32x4| of.to_array().into_iter().fold(f32::INFINITY, fast_math::min);
        let greatest = |of: F32x4| of.to_array().into_iter().fold(f32::NEG_INFINITY, fast_math::max);
        Bounds {
            lower: Vec2::new(least(lower.x), least(lower.y)),
            upper: Vec2::new(greatest(upper.x), greatest(upper.y)),
        }
    }

    /// The box around two boxes.
    pub fn and(self, other: &Bounds) -> Bounds {
        Bounds { lower: self.lower.min(other.lower), upper: self.upper.max(other.upper) }
    }

    /// The squared distance of a point; infinite from the box around no point. Rounding keeps the order of
    /// differences, squares and sums. So it is never more than that of a point in the box, without a margin.
    #[inline(always)]
    pub fn distance_squared(&self, point: Vec2) -> f32 {
        let beyond =
            |lower: f32, x: f32, upper: f32| fast_math::max(fast_math::max(lower - x, x - upper), 0.0);
        let x = beyond(self.lower.x, point.x, self.upper.x);
        let y = beyond(self.lower.y, point.y, self.upper.y);
        x * x + y * y
    }
}
