//! Ways around units that stand.
//!
//! A unit that would walk into units that stand turns to the first direction in which it would not: by 20,
//! 40, ... degrees, to the side to which it moves already and to the other in turn. Avoidance alone
//! (`tick::avoid`) would let it stand behind them.

use glam::Vec2;

use super::super::{TickScratch, World};
use crate::simd::x4::{F32x4, Four, Vec2x4, WIDTH, four};

/// How far ahead of itself a unit looks for others that stand in its way, in squares.
const LOOK_AHEAD: f32 = 1.0;
/// Cosine and sine of 20 degrees, by which a unit turns to find a free way; given as numbers, since the last
/// bits of trigonometric functions depend on the machine.
const TURN: [f32; 2] = [0.939_692_6, 0.342_020_15];
/// How often it turns at most, to either side: up to 100 degrees.
const MAX_TURNS: usize = 5;
/// Units that touch do not block the way past each other.
const TOUCH: f32 = 0.98;

/// The units of a plane that stand in this tick, in groups that one instruction computes. There are groups
/// for all units, of which the first `len` count.
#[derive(Debug, Default)]
pub(in crate::tick) struct Standing {
    len: usize,
    groups: Vec<Group>,
}

/// Four units, one per entry of each column. Of units near one that walks, `x` and `y` are the ways from that
/// to them, and each blocks a way that passes it within its radius, which is negative for a unit that is not
/// near.
#[derive(Clone, Copy, Debug, Default)]
struct Group {
    x: [f32; WIDTH],
    y: [f32; WIDTH],
    radii: [f32; WIDTH],
    /// Exact as floats, which one instruction compares.
    ids: [f32; WIDTH],
}

impl Standing {
    pub fn reserve(&mut self, n_units: usize) {
        self.groups.resize(n_units.div_ceil(WIDTH), Group::default());
    }

    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Adds a unit if it stands, without a branch: whether it does is hard to predict.
    #[inline(always)]
    pub fn add_if(&mut self, stands: bool, id: u32, at: Vec2, radius: f32) {
        let (group, entry) = (&mut self.groups[self.len / WIDTH], self.len % WIDTH);
        (group.x[entry], group.y[entry]) = (at.x, at.y);
        (group.radii[entry], group.ids[entry]) = (radius, id as f32);
        self.len += usize::from(stands);
    }

    /// Fills the last group with units that are near no other, and returns the groups.
    fn padded(&mut self) -> &[Group] {
        while !self.len.is_multiple_of(WIDTH) {
            self.add_if(true, u32::MAX, Vec2::INFINITY, 0.0);
        }
        &self.groups[..self.len / WIDTH]
    }
}

/// Groups of standing units of which one at least is near a unit that walks. The first `len` count.
#[derive(Debug, Default)]
pub(in crate::tick) struct Near {
    len: usize,
    groups: Vec<Group>,
}

/// A unit that walks.
struct Walker {
    at: Vec2,
    radius: f32,
    target: Option<u32>,
}

impl Near {
    pub fn reserve(&mut self, n_units: usize) {
        self.groups.resize(n_units.div_ceil(WIDTH), Group::default());
    }

    /// Finds the units near a walker, but its target. Returns whether one of them is in its way.
    #[inline(always)]
    fn find(&mut self, four: Four, standing: &[Group], walker: &Walker, straight: Vec2) -> bool {
        let (at, straight) = (Vec2x4::splat(four, walker.at), Vec2x4::splat(four, straight));
        let target = F32x4::splat(four, walker.target.map_or(-1.0, |target| target as f32));
        let [radius, ahead, touch, nowhere] =
            [walker.radius, LOOK_AHEAD, TOUCH, -1.0].map(|number| F32x4::splat(four, number));
        let (mut blocked, mut len) = (0, 0);
        for group in standing {
            let [x, y, radii, ids] =
                [group.x, group.y, group.radii, group.ids].map(|numbers| F32x4::new(four, numbers));
            let (way, reach) = (Vec2x4 { x, y } - at, radius + radii);
            let is_near = way.length_squared().lt((reach + ahead) * (reach + ahead)) & !ids.eq(target);
            let reaches = is_near.select(reach * touch, nowhere);
            blocked |= blocking(way, reaches, straight);
            // Written before it is known whether one is near: no branch, which would be hard to predict.
            let [x, y, radii] = [way.x, way.y, reaches].map(F32x4::to_array);
            self.groups[len] = Group { x, y, radii, ..*group };
            len += usize::from(is_near.any());
        }
        self.len = len;
        blocked != 0
    }

    /// Whether no unit is in this way.
    #[inline(always)]
    fn is_free(&self, four: Four, direction: Vec2) -> bool {
        let direction = Vec2x4::splat(four, direction);
        let blocked = self.groups[..self.len].iter().fold(0, |blocked, group| {
            let [x, y, reaches] = [group.x, group.y, group.radii].map(|numbers| F32x4::new(four, numbers));
            blocked | blocking(Vec2x4 { x, y }, reaches, direction)
        });
        blocked == 0
    }

    /// The first free direction, `None` if there is none.
    #[inline(always)]
    fn free_direction(&self, four: Four, straight: Vec2, vel: Vec2) -> Option<Vec2> {
        let side = if straight.perp_dot(vel) < 0.0 { -1.0 } else { 1.0 };
        let [cos, sin] = TURN;
        let turns = [Vec2::new(cos, sin * side), Vec2::new(cos, -sin * side)];
        let mut directions = [straight; 2];
        for _ in 0..MAX_TURNS {
            directions = [turns[0].rotate(directions[0]), turns[1].rotate(directions[1])];
            let free = directions.map(|direction| self.is_free(four, direction));
            if free[0] || free[1] {
                return Some(directions[usize::from(!free[0])]);
            }
        }
        None
    }
}

/// Which of some units, seen from one that walks, are in its way, as bits.
#[cfg_attr(not(target_family = "wasm"), inline(always))] // in browsers size counts
fn blocking(way: Vec2x4, reaches: F32x4, direction: Vec2x4) -> u32 {
    let is_ahead = way.dot(direction).gt(F32x4::splat(reaches.simd(), 0.0));
    (is_ahead & way.perp_dot(direction).abs().lt(reaches)).bits()
}

/// Lets every living unit that would walk into others that stand prefer a way past them.
#[inline(never)]
pub(super) fn take(world: &mut World) {
    let World { arena, units, alive_ids, scratch, .. } = world;
    let TickScratch { preferred, standing, near, .. } = &mut **scratch;
    if standing.iter().all(|plane| plane.len == 0) {
        return;
    }
    let standing = standing.each_mut().map(Standing::padded);
    let four = four();
    // Slices of one length: one check of an id serves all columns.
    let n = units.pos.len();
    let (pos, vel, targets, preferred) =
        (&units.pos[..n], &units.vel[..n], &units.target[..n], &mut preferred[..n]);
    let (all_stats, avoidance) = (&arena.starcraft_stats[..n], &arena.avoidance[..n]);
    for &id in &alive_ids.all {
        let i = id as usize;
        let speed = preferred[i].length();
        if speed == 0.0 {
            continue;
        }
        let straight = preferred[i] / speed;
        let walker = Walker { at: pos[i], radius: avoidance[i].radius, target: targets[i] };
        if near.find(four, standing[all_stats[i].plane as usize], &walker, straight)
            && let Some(free) = near.free_direction(four, straight, vel[i])
        {
            preferred[i] = free * speed;
        }
    }
}
