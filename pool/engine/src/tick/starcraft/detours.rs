//! Ways around units that stand.
//!
//! A unit that would walk into units that stand turns to the first direction in which it would not: by 20,
//! 40, ... degrees, to the side to which it moves already and to the other in turn. Avoidance alone
//! (`tick::avoid`) would let it stand behind them.

use glam::Vec2;

use super::super::{TickScratch, World};
use super::bodies::side_of;
use super::crowd::{Crowd, Member};
use crate::TICK;
use crate::simd::x4::{F32x4, Four, Vec2x4, WIDTH, four};
use crate::simd::{F32s, InstructionSet, Kernel, MAX_WIDTH, Mask, Vec2s};

/// How far ahead of itself a unit looks for others that stand in its way, in squares.
const LOOK_AHEAD: f32 = 0.25;
/// Cosine and sine of 20 degrees, by which a unit turns to find a free way; given as numbers, since the last
/// bits of trigonometric functions depend on the machine.
const TURN: [f32; 2] = [0.939_692_6, 0.342_020_15];
/// The number of directions that it tries: up to 100 degrees to either side.
const DIRECTIONS: usize = 10;
/// Units that touch do not block the way past each other.
const TOUCH: f32 = 0.98;

/// Which of the standing units of a plane are near a unit that walks, as the bits of each group.
#[derive(Debug, Default)]
pub(in crate::tick) struct Near {
    groups: Vec<u32>,
}

/// A unit that walks.
struct Walker {
    at: Vec2,
    side: f32,
    radius: f32,
    target: Option<u32>,
}

impl Near {
    pub fn reserve(&mut self, n_units: usize) {
        self.groups.resize(n_units.div_ceil(MAX_WIDTH), 0);
    }

    /// Finds the units near a walker that do not give way: neither its target nor idle ones of its side.
    /// Returns whether one of them is in its way.
    #[inline(always)]
    fn find<S: InstructionSet>(
        &mut self,
        simd: S,
        standing: &Crowd,
        walker: &Walker,
        straight: Vec2,
    ) -> bool {
        let (at, straight) = (Vec2s::splat(simd, walker.at), Vec2s::splat(simd, straight));
        let target = walker.target.map_or(-1.0, |target| target as f32);
        let [radius, ahead, touch, side, target] = [walker.radius, LOOK_AHEAD, TOUCH, walker.side, target]
            .map(
                #[inline(always)]
                |number| F32s::splat(simd, number),
            );
        let mut blocked = 0;
        for (near, (len, group)) in self.groups.iter_mut().zip(standing.groups()) {
            *near = group.which(simd, len, |them| {
                let reach = radius + them.radii + ahead;
                (them.at - at).length_squared().lt(reach * reach)
                    & !(them.ids.eq(target) | them.sides.eq(side))
            });
            if *near != 0 {
                blocked |= *near
                    & group.which(simd, len, |them| {
                        blocking(them.at - at, (radius + them.radii) * touch, straight)
                    });
            }
        }
        blocked != 0
    }

    /// The first free direction, `None` if there is none.
    ///
    /// All directions are computed, four per register: when to stop would be hard to predict.
    #[cfg_attr(not(target_family = "wasm"), inline(always))] // in browsers size counts
    fn free_direction(
        &self,
        four: Four,
        standing: &Crowd,
        walker: &Walker,
        straight: Vec2,
        vel: Vec2,
    ) -> Option<Vec2> {
        let directions = directions(straight, vel);
        let mut blocked = [F32x4::splat(four, 0.0); DIRECTIONS.div_ceil(WIDTH)].map(|zero| zero.lt(zero));
        for (&near, (_, group)) in self.groups.iter().zip(standing.groups()) {
            let mut left = near;
            while left != 0 {
                let other = group.member(left.trailing_zeros() as usize);
                left &= left - 1;
                let way = Vec2x4::splat(four, other.at - walker.at);
                let reach = F32x4::splat(four, (walker.radius + other.body.radius) * TOUCH);
                for (blocked, &[x, y]) in blocked.iter_mut().zip(&directions) {
                    let direction = Vec2x4 { x: F32x4::new(four, x), y: F32x4::new(four, y) };
                    *blocked = *blocked | blocking(way, reach, direction);
                }
            }
        }
        let blocked = blocked.iter().rev().fold(0, |all, mask| all << WIDTH | mask.bits());
        let first = blocked.trailing_ones() as usize;
        let [x, y] = directions[first / WIDTH];
        (first < DIRECTIONS).then(|| Vec2::new(x[first % WIDTH], y[first % WIDTH]))
    }
}

/// The directions to which a unit turns, in the order in which it tries them; after them 0, which is free.
#[inline(always)]
fn directions(straight: Vec2, vel: Vec2) -> [[[f32; WIDTH]; 2]; DIRECTIONS.div_ceil(WIDTH)] {
    let mut sin = if straight.perp_dot(vel) < 0.0 { -TURN[1] } else { TURN[1] };
    let mut last = [straight; 2];
    let mut directions = [[[0.0; WIDTH]; 2]; DIRECTIONS.div_ceil(WIDTH)];
    for number in 0..DIRECTIONS {
        let direction = Vec2::new(TURN[0], sin).rotate(last[0]);
        let [x, y] = &mut directions[number / WIDTH];
        (x[number % WIDTH], y[number % WIDTH]) = (direction.x, direction.y);
        (last, sin) = ([last[1], direction], -sin);
    }
    directions
}

/// Which of some units, seen from one that walks, are in its way; or in which of some ways a unit is.
#[cfg_attr(not(target_family = "wasm"), inline(always))] // in browsers size counts
fn blocking<S: InstructionSet>(way: Vec2s<S>, reach: F32s<S>, direction: Vec2s<S>) -> Mask<S> {
    let is_ahead = way.dot(direction).gt(F32s::splat(reach.simd(), 0.0));
    is_ahead & way.perp_dot(direction).abs().lt(reach)
}

/// Lets every living unit that would walk into others that stand prefer a way past them. Leaves those that
/// walk where their steps end.
#[inline(never)]
pub(super) fn take(world: &mut World) {
    world.scratch.level.run(Turning { world });
}

struct Turning<'a, 'w> {
    world: &'a mut World<'w>,
}

impl Kernel for Turning<'_, '_> {
    #[inline(always)]
    fn run<S: InstructionSet>(self, simd: S) {
        let World { arena, units, alive_ids, scratch, .. } = self.world;
        let TickScratch { preferred, standing, walking, near, .. } = &mut **scratch;
        walking.iter_mut().for_each(Crowd::clear);
        let four = four();
        // Slices of one length: one check of an id serves all columns.
        let n = units.pos.len();
        let (pos, vel, targets, preferred) =
            (&units.pos[..n], &units.vel[..n], &units.target[..n], &mut preferred[..n]);
        let all_stats = &arena.starcraft_stats[..n];
        for &id in &alive_ids.all {
            let i = id as usize;
            if preferred[i] == Vec2::ZERO {
                continue;
            }
            let (stats, side) = (&all_stats[i], side_of(arena, id));
            let standing = &standing[stats.plane as usize];
            let speed = preferred[i].length();
            if !standing.is_empty() && speed > 0.0 {
                let straight = preferred[i] / speed;
                let walker = Walker { at: pos[i], side, radius: stats.body.radius, target: targets[i] };
                if near.find(simd, standing, &walker, straight)
                    && let Some(free) = near.free_direction(four, standing, &walker, straight, vel[i])
                {
                    preferred[i] = free * speed;
                }
            }
            let at = pos[i] + preferred[i] * TICK as f32;
            let walker = Member { id: id as f32, side, at, body: stats.body };
            walking[stats.plane as usize].add(&walker);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::bodies::NO_SIDE;
    use super::*;
    use crate::arena::BodyStats;
    use crate::random::Generator;

    /// The rule, one unit and one direction after the other.
    fn first_free(units: &[(Vec2, f32)], walker: &Walker, straight: Vec2, vel: Vec2) -> Option<Vec2> {
        let blocks = |&(at, radius): &(Vec2, f32), direction: Vec2| {
            let (way, reach) = (at - walker.at, walker.radius + radius);
            way.length_squared() < (reach + LOOK_AHEAD) * (reach + LOOK_AHEAD)
                && way.dot(direction) > 0.0
                && way.perp_dot(direction).abs() < reach * TOUCH
        };
        let side = if straight.perp_dot(vel) < 0.0 { -1.0 } else { 1.0 };
        let turn = |direction: Vec2, side: f32| Vec2::new(TURN[0], TURN[1] * side).rotate(direction);
        let (mut left, mut right) = (straight, straight);
        let turned = (0..DIRECTIONS / 2).flat_map(|_| {
            (left, right) = (turn(left, side), turn(right, -side));
            [left, right]
        });
        let is_free = |direction: &Vec2| !units.iter().any(|unit| blocks(unit, *direction));
        std::iter::once(straight).chain(turned).find(is_free)
    }

    #[test]
    fn a_unit_takes_the_first_free_direction_among_any_number_of_units() {
        let mut generator = Generator::new(1);
        let mut number = |least: f32, range: f32| least + range * generator.next_share() as f32;
        let mut turned = 0;
        for case in 0..2000 {
            // Few units, so that some ways are free, and many, most of which are far away.
            let n_units = [0, 1, 3, 4, 5, 9, 63, 64, 65, 129, 150][case % 11];
            let width = if n_units < 10 { 4.0 } else { 9.0 };
            let units: Vec<(Vec2, f32)> = (0..n_units)
                .map(|_| (Vec2::new(number(0.0, width), number(0.0, width)), number(0.2, 0.3)))
                .collect();
            let (mut standing, mut near) = (Crowd::default(), Near::default());
            standing.reserve(n_units + 2);
            near.reserve(n_units + 2);
            // Its target, which it may walk into, is among them.
            let target = n_units as u32;
            let walker =
                Walker { at: Vec2::splat(width / 2.0), side: 1.0, radius: 0.375, target: Some(target) };
            let mut add = |id, side, at, radius| {
                standing.add_if(
                    true,
                    &Member { id: id as f32, side, at, body: BodyStats { radius, weight: 1.0 } },
                );
            };
            add(target, NO_SIDE, walker.at + Vec2::splat(0.1), 0.3);
            // So are an idle unit of its side, which it pushes, and idle ones of the other side.
            add(target + 1, walker.side, walker.at + Vec2::splat(0.2), 0.3);
            for (&(at, radius), id) in units.iter().zip(0..) {
                add(id, if id % 2 == 0 { NO_SIDE } else { 0.0 }, at, radius);
            }
            let straight = Vec2::new(number(-1.0, 2.0), number(-1.0, 2.0)).normalize();
            let vel = Vec2::new(number(-1.0, 2.0), number(-1.0, 2.0));
            let expected = first_free(&units, &walker, straight, vel);
            let taken = match near.find(four(), &standing, &walker, straight) {
                true => near.free_direction(four(), &standing, &walker, straight, vel),
                false => Some(straight),
            };
            assert_eq!(taken, expected, "case {case}");
            turned += usize::from(expected.is_some_and(|direction| direction != straight));
        }
        assert!(turned > 200, "{turned} cases with a detour");
    }
}
