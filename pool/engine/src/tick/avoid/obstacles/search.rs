//! The search for the edges that a unit sees.

use glam::Vec2;

use crate::arena::EdgeBlock;
use crate::simd::{Column, F32s, InstructionSet, MAX_WIDTH, Vec2s};
use crate::tick::avoid::nearest_list::NearestList;

/// Finds the edges of a list that a unit sees, nearest first, one edge per entry. `range` is a squared
/// distance.
#[inline(always)]
pub(in crate::tick::avoid) fn find<S: InstructionSet>(
    simd: S,
    position: Vec2,
    near: &[EdgeBlock],
    range: f32,
    found: &mut NearestList,
) {
    found.clear();
    let position = Vec2s::splat(simd, position);
    let [zero, one, range] = [0.0, 1.0, range].map(
        #[inline(always)]
        |x| F32s::splat(simd, x),
    );
    let mut distances = Column::default();
    for block in near {
        for first in (0..MAX_WIDTH).step_by(S::WIDTH) {
            if block.numbers[first] == EdgeBlock::NO_EDGE {
                break;
            }
            let [start, end] = [&block.start, &block.end].map(
                #[inline(always)]
                |point| Vec2s::load_from(simd, point, first),
            );
            let span = end - start;
            // The list is that of the unit's square; the unit itself may be on the line of an edge, and sees
            // the outer side of edges only. Not that of an empty entry, of which the span is zero.
            let is_outside = (start - position).perp_dot(span).lt(zero);
            // The projection on the line, as a share of the edge: below 0 or above 1 the nearest point is an
            // end.
            let share = (position - start).dot(span).div(span.length_squared());
            let nearest = share.lt(zero).either(start, share.gt(one).either(end, start + span * share));
            let distance_squared = (position - nearest).length_squared();
            distance_squared.store(&mut distances);
            let mut seen = (is_outside & distance_squared.lt(range)).bits();
            while seen != 0 {
                let entry = seen.trailing_zeros() as usize;
                seen &= seen - 1;
                found.insert(distances[entry], block.numbers[first + entry] as usize);
            }
        }
    }
}
