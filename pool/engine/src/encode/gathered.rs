//! The units as the encoders read them, gathered once after each step: positions four at a time, and the
//! features that do not depend on the observer.

use glam::Vec2;
use wide::bytemuck::{cast, cast_slice, cast_slice_mut};
use wide::f64x2;

use super::ratio;
use crate::arena::{Arena, UnitStats};
use crate::simd::{F32x4, Mask, Vec2x4, WIDTH};
use crate::units::Units;
use crate::{SIGHT_RANGE, TARGETING_RANGE};

/// The units of both factions.
#[derive(Clone, Debug)]
pub(crate) struct Gathered {
    pub allies: Faction,
    pub enemies: Faction,
}

impl Gathered {
    /// Memory for the units of an arena, with their types.
    pub fn new(arena: &Arena) -> Gathered {
        let features = &arena.features;
        let of = |ids: &[u32], size, has_shield| {
            let mut faction = Faction::new(ids.len(), size);
            for (unit, &id) in ids.iter().enumerate().filter(|_| features.n_types > 0) {
                faction.body_mut(unit)[1 + usize::from(has_shield) + features.type_of[id as usize]] = 1.0;
            }
            faction
        };
        Gathered {
            allies: of(&arena.agents, features.ally_body(), features.ally_shields),
            enemies: of(&arena.enemies, features.enemy_body(), features.enemy_shields),
        }
    }

    /// Gathers what a step has changed.
    #[inline(never)]
    pub fn update(&mut self, arena: &Arena, units: &Units) {
        self.allies.update(arena, units, &arena.agents, arena.features.ally_shields);
        self.enemies.update(arena, units, &arena.enemies, arena.features.enemy_shields);
    }
}

/// The units of one faction, by in-faction id.
///
/// Bodies begin at multiples of [`stride`], so that they are read in whole registers. What follows a body up to
/// the next is 0, and so are the bodies beyond the last unit.
#[derive(Clone, Debug, Default)]
pub(crate) struct Faction {
    /// Positions, four per entry. Dead units, and those that complete the last entry, are at infinity: out of
    /// sight of every unit.
    pub positions: Vec<Vec2x4>,
    /// Health, \[shield\], \[type\] of one unit after the other; those of dead units are stale.
    pub bodies: Vec<F32x4>,
    pub body_size: usize,
}

/// The distance between two bodies in memory, in floats: whole registers, but bodies of one float (in battles
/// of equal units without shields) are packed.
pub(crate) const fn stride(body_size: usize) -> usize {
    if body_size == 1 { 1 } else { body_size.next_multiple_of(WIDTH) }
}

impl Faction {
    fn new(n_units: usize, body_size: usize) -> Faction {
        let n_entries = n_units.div_ceil(WIDTH);
        Faction {
            positions: vec![Vec2x4::splat(Vec2::INFINITY); n_entries],
            bodies: vec![F32x4::ZERO; n_entries * stride(body_size)],
            body_size,
        }
    }

    fn update(&mut self, arena: &Arena, units: &Units, ids: &[u32], has_shield: bool) {
        let stride = stride(self.body_size);
        let position =
            |id: &u32| if units.alive[*id as usize] { units.pos[*id as usize] } else { Vec2::INFINITY };
        for (four, ids) in self.positions.iter_mut().zip(ids.chunks(WIDTH)) {
            let position = |i| ids.get(i).map_or(Vec2::INFINITY, position);
            *four = Vec2x4::new(std::array::from_fn(position));
        }
        let bodies: &mut [f32] = cast_slice_mut(&mut self.bodies);
        for (&id, body) in ids.iter().zip(bodies.chunks_exact_mut(stride)) {
            let stats: &UnitStats = arena.stats(id);
            body[0] = ratio(units.hp[id as usize], stats.hp);
            // A scenario decides per faction whether shields are features, whatever its unit types have.
            if has_shield {
                body[1] = ratio(units.shield[id as usize], stats.shield);
            }
        }
    }

    /// Health of a unit, as a share of its maximum.
    pub fn health(&self, unit: usize) -> f32 {
        cast_slice(&self.bodies)[unit * stride(self.body_size)]
    }

    /// Writes health, \[shield\], \[type\] of a unit, and zeros up to the next multiple of [`WIDTH`].
    pub fn write_body(&self, unit: usize, out: &mut [f32]) {
        let stride = stride(self.body_size);
        if stride == 1 {
            out[0] = self.health(unit);
        } else {
            let fours = &self.bodies[unit * (stride / WIDTH)..(unit + 1) * (stride / WIDTH)];
            for (out, four) in out.chunks_exact_mut(WIDTH).zip(fours) {
                out.copy_from_slice(four.as_array());
            }
        }
    }

    fn body_mut(&mut self, unit: usize) -> &mut [f32] {
        let begin = unit * stride(self.body_size);
        &mut cast_slice_mut(&mut self.bodies)[begin..begin + self.body_size]
    }

    /// Becomes the first `n_units` units of another faction from unit `first` on.
    pub fn copy_from(&mut self, other: &Faction, first: usize, n_units: usize) {
        self.body_size = other.body_size;
        self.positions.clear();
        self.positions.resize(n_units.div_ceil(WIDTH), Vec2x4::splat(Vec2::INFINITY));
        self.bodies.clear();
        self.bodies.resize(self.positions.len() * stride(other.body_size), F32x4::ZERO);
        for unit in 0..n_units {
            self.copy_unit(unit, other, first + unit);
        }
    }

    /// Replaces a unit by one of another faction with bodies of the same size.
    pub fn copy_unit(&mut self, unit: usize, other: &Faction, from: usize) {
        let stride = stride(self.body_size);
        let (to_four, from_four) = (&mut self.positions[unit / WIDTH], &other.positions[from / WIDTH]);
        to_four.x.as_mut_array()[unit % WIDTH] = from_four.x.as_array()[from % WIDTH];
        to_four.y.as_mut_array()[unit % WIDTH] = from_four.y.as_array()[from % WIDTH];
        if stride == 1 {
            let (to, from) =
                (&mut self.bodies[unit / WIDTH], other.bodies[from / WIDTH].as_array()[from % WIDTH]);
            to.as_mut_array()[unit % WIDTH] = from;
        } else {
            let n = stride / WIDTH;
            for i in 0..n {
                self.bodies[unit * n + i] = other.bodies[from * n + i];
            }
        }
    }
}

/// A unit is in sight if its squared distance is at most this. What counts is that the root, the distance, is less
/// than [`SIGHT_RANGE`], and the rounded root of the number above this is not.
pub(crate) const SIGHT_SQUARED: f64 = (SIGHT_RANGE * SIGHT_RANGE).next_down().next_down();

/// A unit is within targeting range if its squared distance is at most this, and then the distance is at most
/// [`TARGETING_RANGE`].
pub(crate) const TARGETING_SQUARED: f64 = TARGETING_RANGE * TARGETING_RANGE;

/// The squares of the distances from one point to four, in f64 as [`distance_squared`] computes them, two per
/// register.
///
/// [`distance_squared`]: crate::units::distance_squared
#[inline]
pub(crate) fn distances_squared(from: Vec2, to: &Vec2x4) -> [f64x2; 2] {
    let offset =
        |from: f32, [a, b]: [f32; 2]| f64x2::splat(f64::from(from)) - f64x2::new([a.into(), b.into()]);
    let [xs, ys] = [to.x, to.y].map(|four| four.to_array());
    [0, 2].map(|i| {
        let (dx, dy) = (offset(from.x, [xs[i], xs[i + 1]]), offset(from.y, [ys[i], ys[i + 1]]));
        dx * dx + dy * dy
    })
}

/// Which of four numbers are at most `bound`.
#[inline]
pub(crate) fn at_most(numbers: [f64x2; 2], bound: f64) -> Mask {
    // A comparison sets all bits of an entry or none, so the lower half of an entry has its result.
    let [[a, _, b, _], [c, _, d, _]] =
        numbers.map(|two| cast::<f64x2, [f32; 4]>(two.simd_le(f64x2::splat(bound))));
    F32x4::new([a, b, c, d])
}

/// Four numbers rounded to f32.
#[inline]
pub(crate) fn rounded(numbers: [f64x2; 2]) -> F32x4 {
    let [[a, b], [c, d]] = numbers.map(|two| two.to_array());
    F32x4::new([a as f32, b as f32, c as f32, d as f32])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::square_within;

    #[test]
    fn comparing_squares_is_comparing_distances() {
        assert_eq!(SIGHT_SQUARED, square_within(SIGHT_RANGE.next_down()));
        assert_eq!(TARGETING_SQUARED, square_within(TARGETING_RANGE));
    }
}
