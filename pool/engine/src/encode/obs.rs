//! Observations: what each agent sees within its sight range.

use std::ops::Range;

use glam::Vec2;
use wide::bytemuck::cast;
use wide::{f64x2, i32x4};

use super::View;
use super::gathered::{
    Faction, Gathered, SIGHT_SQUARED, TARGETING_SQUARED, at_most, distances_squared, fours, rounded, stride,
    within_targeting_range, write_body,
};
use crate::SIGHT_RANGE;
use crate::command::action;
use crate::simd::{F32x4, MASK_BITS, WIDTH};

/// Working memory: a row for those at the end of the output, and what is written beyond it.
#[derive(Debug, Default)]
pub(crate) struct ObsScratch {
    row: Vec<f32>,
}

/// Floats before the enemies: the moves.
const MOVES: usize = 4;
/// Floats of a unit before its body: the mark, distance, dx, dy.
const HEAD: usize = 4;

/// Writes the rows of all agents. Rows may be longer than `obs_size`; the rest of them becomes 0.
///
/// A row is written from left to right in whole registers, four units at a time. Each part may end beyond
/// its end, where the next part, or the next row, is written later. So rows near the end of the output are
/// written elsewhere and copied.
#[inline(never)]
pub(crate) fn write_obs(view: &View, out: &mut [f32], scratch: &mut ObsScratch) {
    let (sizes, features) = (view.arena.sizes(), &view.arena.features);
    let row_len = out.len() / sizes.n_agents;
    assert!(row_len >= sizes.obs_size && out.len() == sizes.n_agents * row_len, "one row per agent");
    let (enemy_body, ally_body) = (features.enemy_body(), features.ally_body());
    // Up to three units too many, or an own body of whole registers.
    let extent = row_len + (WIDTH - 1) * (HEAD + enemy_body.max(ally_body));
    let writer = RowWriter {
        view,
        allies: MOVES + sizes.n_enemies * (HEAD + enemy_body),
        row_len,
        write_enemies: writer(enemy_body),
        write_allies: writer(ally_body),
    };
    for agent in 0..sizes.n_agents {
        let begin = agent * row_len;
        if let Some(row) = out.get_mut(begin..begin + extent) {
            writer.write(agent, row);
        } else {
            scratch.row.resize(extent, 0.0);
            writer.write(agent, &mut scratch.row);
            out[begin..begin + row_len].copy_from_slice(&scratch.row[..row_len]);
        }
    }
}

struct RowWriter<'a> {
    view: &'a View<'a>,
    /// Floats before the allies.
    allies: usize,
    row_len: usize,
    write_enemies: WriteUnits,
    write_allies: WriteUnits,
}

impl RowWriter<'_> {
    /// Writes a row, and anything beyond it.
    fn write(&self, agent: usize, row: &mut [f32]) {
        let View { arena, gathered: Gathered { allies, enemies }, available, .. } = self.view;
        let available = available.first_bits(agent);
        if available == 1 << action::NO_OP {
            // The agent is dead.
            row[..self.row_len].fill(0.0);
            return;
        }
        row[..MOVES].copy_from_slice(move_features(available).as_array());
        let position = allies.position(agent);
        let blocks = &mut row[MOVES..];
        if arena.stats(arena.agents[agent]).is_healer {
            (self.write_enemies)(enemies, 0..arena.enemies.len(), position, SIGHT_SQUARED, blocks);
            mark_healable(self.view, position, agent, blocks);
        } else {
            (self.write_enemies)(enemies, 0..arena.enemies.len(), position, TARGETING_SQUARED, blocks);
        }
        // An agent has no block in its own row.
        let (before, after) = (0..agent, agent + 1..arena.agents.len());
        let own_block = self.allies + agent * (HEAD + allies.body_size);
        (self.write_allies)(allies, before, position, SIGHT_SQUARED, &mut row[self.allies..]);
        (self.write_allies)(allies, after, position, SIGHT_SQUARED, &mut row[own_block..]);
        let end = arena.sizes().obs_size;
        write_body(allies.body(agent), &mut row[end - allies.body_size..]);
        if self.row_len > end {
            row[end..self.row_len].fill(0.0);
        }
    }
}

/// Whether each of the moves is available, as 0 or 1.
fn move_features(available: u64) -> F32x4 {
    let bits = i32x4::new([0, 1, 2, 3].map(|i| 1 << (action::NORTH + i)));
    let is_available = (i32x4::splat(available as i32) & bits).simd_eq(bits);
    cast::<i32x4, F32x4>(is_available) & F32x4::ONE
}

/// The mark of an enemy says whether the target action of its number is available. A healer's target
/// actions mean allies, so beside enemy i it says whether ally i is within targeting range. It does so for
/// healers too, which the available actions exclude.
fn mark_healable(view: &View, healer: Vec2, agent: usize, blocks: &mut [f32]) {
    let Gathered { allies, enemies } = view.gathered;
    let mut in_range = 0;
    let blocks = blocks.chunks_exact_mut(HEAD + enemies.body_size);
    for (enemy, block) in blocks.take(view.arena.enemies.len()).enumerate() {
        if enemy % MASK_BITS == 0 {
            in_range = within_targeting_range(healer, allies, enemy);
        }
        // It is 1 as yet if the enemy is seen.
        if in_range >> (enemy % MASK_BITS) & 1 == 0 || enemy == agent {
            block[0] = 0.0;
        }
    }
}

/// Writes the blocks of a range of units for an observer at a position: a mark, which is 1 for units that are
/// seen and whose squared distance is at most the fourth argument, distance, dx, dy, and the body.
type WriteUnits = fn(&Faction, Range<usize>, Vec2, f64, &mut [f32]);

/// [`write_units`] for bodies of this size.
fn writer(body_size: usize) -> WriteUnits {
    match body_size {
        1 => write_units::<1>,
        2 => write_units::<2>,
        3 => write_units::<3>,
        4 => write_units::<4>,
        5 => write_units::<5>,
        6 => write_units::<6>,
        7 => write_units::<7>,
        8 => write_units::<8>,
        _ => write_units::<0>,
    }
}

/// `BODY` is the size of bodies where it is known to the compiler, and 0 for all others.
fn write_units<const BODY: usize>(
    units: &Faction,
    range: Range<usize>,
    observer: Vec2,
    marked_within: f64,
    out: &mut [f32],
) {
    let body = if BODY == 0 { units.body_size } else { BODY };
    let (block, stride) = (HEAD + body, stride(body));
    let (x, y, sight) =
        (F32x4::splat(observer.x), F32x4::splat(observer.y), F32x4::splat(SIGHT_RANGE as f32));
    let n_units = range.len().next_multiple_of(WIDTH);
    let (begin, end) = (range.start, range.start + n_units);
    let positions = fours(&units.xs[begin..end]).zip(fours(&units.ys[begin..end]));
    let bodies = units.bodies[begin * stride..end * stride].chunks_exact(WIDTH * stride);
    let blocks = out[..n_units * block].chunks_exact_mut(WIDTH * block);
    for (((xs, ys), bodies), blocks) in positions.zip(bodies).zip(blocks) {
        let squared = distances_squared(observer, xs, ys);
        let is_seen = at_most(squared, SIGHT_SQUARED);
        if !is_seen.any() {
            blocks.fill(0.0);
            continue;
        }
        // The distance is computed in f64 and rounded once; dx and dy are f32 throughout, as in the published
        // environment.
        let distance = squared.map(|squared| squared.sqrt() / f64x2::splat(SIGHT_RANGE));
        let (dx, dy) = (F32x4::new(*xs) - x, F32x4::new(*ys) - y);
        let mark = at_most(squared, marked_within) & F32x4::ONE;
        let heads = [mark, rounded(distance), dx / sight, dy / sight].map(|column| column & is_seen);
        for (i, head) in F32x4::transpose(heads).iter().enumerate() {
            let to = &mut blocks[i * block..];
            to[..HEAD].copy_from_slice(head.as_array());
            if stride == 1 {
                to[HEAD] = (register(bodies, 0) & is_seen).as_array()[i];
                continue;
            }
            let is_seen = F32x4::splat(is_seen.as_array()[i]);
            for begin in (0..stride).step_by(WIDTH) {
                let four = register(bodies, i * stride + begin) & is_seen;
                // What follows a body is written over by the next unit, which the last of four does not have.
                let n = if i + 1 < WIDTH { WIDTH } else { WIDTH.min(body - begin) };
                to[HEAD + begin..HEAD + begin + n].copy_from_slice(&four.as_array()[..n]);
            }
        }
    }
}

/// Four floats from this one on.
#[inline]
fn register(floats: &[f32], begin: usize) -> F32x4 {
    F32x4::new(std::array::from_fn(|i| floats[begin + i]))
}
