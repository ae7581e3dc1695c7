//! The units as the encoders read them: tables that are filled once after each step, with positions in
//! columns and the features that do not depend on the observer.

use glam::Vec2;

use super::ratio;
use crate::arena::{Arena, Features, UnitStats};
use crate::simd::x4::{F32x4, F64x4, Four, Mask4, Vec2x4, WIDTH, four};
use crate::units::Units;
use crate::{SIGHT_RANGE, TARGETING_RANGE};
use smaclite_scenarios::Faction;

/// The units of both factions.
#[derive(Clone, Debug)]
pub(crate) struct UnitTables {
    pub allies: UnitTable,
    pub enemies: UnitTable,
}

impl UnitTables {
    /// Memory for the units of an arena, with their types.
    pub fn new(arena: &Arena) -> UnitTables {
        let features = &arena.features;
        let mut tables = UnitTables {
            allies: UnitTable::new(arena.agents.len(), features.body(Faction::Ally)),
            enemies: UnitTable::new(arena.enemies.len(), features.body(Faction::Enemy)),
        };
        tables.set_types(arena);
        tables
    }

    /// Takes in the types of the units.
    pub fn set_types(&mut self, arena: &Arena) {
        let Features { n_types, ref of_type, ally_shields, enemy_shields, .. } = arena.features;
        let tables = [
            (&mut self.allies, &arena.agents, ally_shields),
            (&mut self.enemies, &arena.enemies, enemy_shields),
        ];
        for (table, ids, has_shield) in tables.into_iter().filter(|_| n_types > 0) {
            let first = 1 + usize::from(has_shield);
            for (body, &id) in table.bodies.chunks_exact_mut(stride(table.body_size)).zip(ids) {
                body[first..first + n_types].fill(0.0);
                body[first + of_type[arena.approaches[id as usize].unit_type as usize]] = 1.0;
            }
        }
    }

    /// The units of a faction.
    pub fn of(&self, faction: Faction) -> &UnitTable {
        match faction {
            Faction::Ally => &self.allies,
            Faction::Enemy => &self.enemies,
        }
    }

    /// Takes in what a step has changed.
    #[inline(never)]
    pub fn update(&mut self, arena: &Arena, units: &Units) {
        self.allies.update(arena, units, &arena.agents, arena.features.ally_shields);
        self.enemies.update(arena, units, &arena.enemies, arena.features.enemy_shields);
    }
}

/// The units of one faction, by in-faction id.
///
/// Columns are read in whole registers, from any unit on, so they are longer than there are units.
/// Coordinates beyond the last unit are infinite, as are those of dead units: they are out of sight of
/// every unit. Bodies begin at multiples of [`stride`]; what follows a body up to the next is 0.
#[derive(Clone, Debug)]
pub(crate) struct UnitTable {
    pub xs: Vec<f32>,
    pub ys: Vec<f32>,
    /// Health, \[shield\], \[type\] of one unit after the other; those of dead units are stale.
    pub bodies: Vec<f32>,
    pub body_size: usize,
    /// With which registers of these columns are made.
    pub four: Four,
}

/// The distance between two bodies in memory, in floats: whole registers, but bodies of one float (in battles
/// of equal units without shields) are packed.
pub(crate) const fn stride(body_size: usize) -> usize {
    if body_size == 1 { 1 } else { body_size.next_multiple_of(WIDTH) }
}

impl UnitTable {
    fn new(n_units: usize, body_size: usize) -> UnitTable {
        let length = n_units + WIDTH - 1;
        UnitTable {
            xs: vec![f32::INFINITY; length],
            ys: vec![f32::INFINITY; length],
            bodies: vec![0.0; length * stride(body_size)],
            body_size,
            four: four(),
        }
    }

    fn update(&mut self, arena: &Arena, units: &Units, ids: &[u32], has_shield: bool) {
        let positions = self.xs.iter_mut().zip(&mut self.ys);
        let bodies = self.bodies.chunks_exact_mut(stride(self.body_size));
        for ((&id, (x, y)), body) in ids.iter().zip(positions).zip(bodies) {
            let i = id as usize;
            if !units.alive[i] {
                (*x, *y) = (f32::INFINITY, f32::INFINITY);
                continue;
            }
            (*x, *y) = units.pos[i].into();
            let stats: &UnitStats = arena.stats(id);
            body[0] = ratio(units.hp[i], stats.hp);
            // A scenario decides per faction whether shields are features, whatever its unit types have.
            if has_shield {
                body[1] = ratio(units.shield[i], stats.shield);
            }
        }
    }

    /// The position of a unit; infinite if it is dead.
    pub fn position(&self, unit: usize) -> Vec2 {
        Vec2::new(self.xs[unit], self.ys[unit])
    }

    /// The position and the body of each unit, and of some at infinity.
    pub fn units(&self) -> impl Iterator<Item = (Vec2, &[f32])> {
        let positions = self.xs.iter().zip(&self.ys).map(|(&x, &y)| Vec2::new(x, y));
        positions.zip(self.bodies.chunks_exact(stride(self.body_size)))
    }

    /// Health, \[shield\], \[type\] of a unit, and zeros up to the next.
    pub fn body(&self, unit: usize) -> &[f32] {
        let stride = stride(self.body_size);
        &self.bodies[unit * stride..(unit + 1) * stride]
    }
}

/// Writes a [body](UnitTable::body) with the zeros that follow it.
#[inline]
pub(crate) fn write_body(body: &[f32], out: &mut [f32]) {
    if body.len() == 1 {
        out[0] = body[0];
    } else {
        for (out, four) in out.chunks_exact_mut(WIDTH).zip(body.chunks_exact(WIDTH)) {
            out.copy_from_slice(four);
        }
    }
}

/// A unit is in sight if its squared distance is at most this. What counts is that the root, the distance,
/// is less than [`SIGHT_RANGE`], and the rounded root of the number above this is not.
pub(crate) const SIGHT_SQUARED: f64 = (SIGHT_RANGE * SIGHT_RANGE).next_down().next_down();

/// A unit is within targeting range if its squared distance is at most this, and then the distance is at most
/// [`TARGETING_RANGE`].
pub(crate) const TARGETING_SQUARED: f64 = TARGETING_RANGE * TARGETING_RANGE;

/// The squares of the distances from one point to four, in f64 as [`distance_squared`] computes them.
///
/// [`distance_squared`]: crate::distance::distance_squared
#[inline(always)]
pub(crate) fn distances_squared(four: Four, from: Vec2, xs: &[f32; WIDTH], ys: &[f32; WIDTH]) -> F64x4 {
    let dx = F64x4::splat(four, f64::from(from.x)).sub(F64x4::widened(four, *xs));
    let dy = F64x4::splat(four, f64::from(from.y)).sub(F64x4::widened(four, *ys));
    dx.sum_of_squares(dy)
}

/// How many units a word of bits has.
pub(crate) const UNITS_PER_WORD: usize = u64::BITS as usize;

/// Which of [`UNITS_PER_WORD`] units, from this one on, are within targeting range of a position, as bits.
#[inline(never)]
pub(crate) fn within_targeting_range(from: Vec2, units: &UnitTable, begin: usize) -> u64 {
    const WITHIN: f32 = TARGETING_SQUARED as f32;
    // In f32 a squared distance near 36 is wrong by less than 36 * 4 / 2^24, or 1e-5: the two squares and
    // the sum add a relative 2^-24 each, and the subtractions twice that. So if none is nearer to 36 than
    // ten times that, all comparisons are right.
    const UNSURE: f32 = 1e-4;
    let end = units.xs.len().min(begin + UNITS_PER_WORD);
    let (Some(xs), Some(ys)) = (units.xs.get(begin..end), units.ys.get(begin..end)) else { return 0 };
    let four = units.four;
    let [zero, range, unsure] = [0.0, WITHIN, UNSURE].map(|x| F32x4::splat(four, x));
    let centre = Vec2x4::splat(four, from);
    let (mut within, mut shift) = (0, 0);
    let mut nearest_to_range = F32x4::splat(four, f32::INFINITY);
    for (xs, ys) in fours(xs).zip(fours(ys)) {
        let offset = Vec2x4 { x: F32x4::new(four, *xs), y: F32x4::new(four, *ys) } - centre;
        let beyond = offset.length_squared() - range;
        nearest_to_range = nearest_to_range.min(beyond.abs());
        within |= u64::from(beyond.lt(zero).bits()) << shift;
        shift += WIDTH;
    }
    if nearest_to_range.lt(unsure).any() {
        within = exactly_within_targeting_range(four, from, xs, ys);
    }
    within
}

#[cold]
fn exactly_within_targeting_range(four: Four, from: Vec2, xs: &[f32], ys: &[f32]) -> u64 {
    let within = |xs, ys| at_most(distances_squared(four, from, xs, ys), TARGETING_SQUARED).bits();
    let fours = fours(xs).zip(fours(ys)).enumerate();
    fours.fold(0, |mask, (i, (xs, ys))| mask | u64::from(within(xs, ys)) << (WIDTH * i))
}

/// The entries of a column, four at a time.
#[inline]
pub(crate) fn fours(column: &[f32]) -> impl Iterator<Item = &[f32; WIDTH]> {
    column.as_chunks().0.iter()
}

/// Which of four numbers are at most `bound`.
#[inline(always)]
pub(crate) fn at_most(numbers: F64x4, bound: f64) -> Mask4 {
    numbers.le(F64x4::splat(numbers.four(), bound))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::square_within;

    #[test]
    fn comparing_squares_is_comparing_distances() {
        assert_eq!(SIGHT_SQUARED, square_within(SIGHT_RANGE.next_down()));
        assert_eq!(TARGETING_SQUARED, square_within(TARGETING_RANGE));
    }
}
