//! Observations: what each agent sees within its sight range.

use glam::Vec2;
use wide::bytemuck::cast;
use wide::{f64x2, i32x4};

use super::View;
use super::gathered::{
    Faction, Gathered, SIGHT_SQUARED, TARGETING_SQUARED, at_most, distances_squared, rounded, stride,
    within_targeting_range,
};
use crate::SIGHT_RANGE;
use crate::command::action;
use crate::simd::{F32x4, MASK_BITS, WIDTH};

/// Working memory.
#[derive(Debug, Default)]
pub(crate) struct ObsScratch {
    /// The allies of one agent after the other: all agents but this one.
    others: Faction,
    /// A row for those at the end of the output, and what is written beyond it.
    row: Vec<f32>,
}

/// Floats of a block before the body: the mark, distance, dx, dy.
const HEAD: usize = 4;

/// Writes the rows of all agents. Rows may be longer than `obs_size`; the rest of them becomes 0.
///
/// A row is written from left to right in whole registers, four units at a time. Each part may end beyond its
/// end, where the next part, or the next row, is written later. So rows near the end of the output are written
/// elsewhere and copied.
#[inline(never)]
pub(crate) fn write_obs(view: &View, out: &mut [f32], scratch: &mut ObsScratch) {
    let sizes = view.arena.sizes();
    let row_len = out.len() / sizes.n_agents;
    assert!(row_len >= sizes.obs_size && out.len() == sizes.n_agents * row_len, "one row per agent");
    let ObsScratch { others, row: last_row } = scratch;
    let allies = &view.gathered.allies;
    others.copy_all_but_first(allies, sizes.n_agents);
    let layout = Layout::new(view, row_len);
    for agent in 0..sizes.n_agents {
        if agent > 0 {
            // The others of this agent are those of the last one, with the last one in the place of this one.
            others.copy_unit(agent - 1, allies);
        }
        let begin = agent * row_len;
        if let Some(row) = out.get_mut(begin..begin + layout.extent) {
            layout.write_row(view, others, agent, row);
        } else {
            last_row.resize(layout.extent, 0.0);
            layout.write_row(view, others, agent, last_row);
            out[begin..begin + row_len].copy_from_slice(&last_row[..row_len]);
        }
    }
}

/// Where the parts of a row begin, and how its blocks are written.
struct Layout {
    allies: usize,
    own: usize,
    rest: usize,
    end: usize,
    /// Floats from the start of a row that writing it may touch.
    extent: usize,
    write_enemies: WriteUnits,
    write_allies: WriteUnits,
}

impl Layout {
    fn new(view: &View, row_len: usize) -> Layout {
        let (sizes, features) = (view.arena.sizes(), &view.arena.features);
        let (enemy, ally) = (features.enemy_body(), features.ally_body());
        let (enemies, rest) = (4, sizes.obs_size);
        let (allies, own) = (enemies + sizes.n_enemies * (HEAD + enemy), rest - ally);
        // The end of the last of four units, and of the last register of its body.
        let extent = |begin, n_units: usize, body| {
            begin + n_units.next_multiple_of(WIDTH) * (HEAD + body) + stride(body) - body
        };
        let extents = [
            extent(enemies, sizes.n_enemies, enemy),
            extent(allies, sizes.n_agents - 1, ally),
            own + stride(ally),
        ];
        Layout {
            allies,
            own,
            rest,
            end: row_len,
            extent: extents.into_iter().fold(row_len, usize::max),
            write_enemies: writer(enemy),
            write_allies: writer(ally),
        }
    }

    #[inline]
    fn write_row(&self, view: &View, others: &Faction, agent: usize, row: &mut [f32]) {
        let gathered = view.gathered;
        let available = view.available.of(agent)[0];
        if available == 1 << action::NO_OP {
            // The agent is dead.
            row[..self.end].fill(0.0);
            return;
        }
        row[..4].copy_from_slice(move_features(available).as_array());
        let position = gathered.allies.position(agent);
        if view.arena.stats(view.arena.agents[agent]).is_healer {
            (self.write_enemies)(&gathered.enemies, position, SIGHT_SQUARED, &mut row[4..]);
            mark_healable(view, position, agent, &mut row[4..]);
        } else {
            (self.write_enemies)(&gathered.enemies, position, TARGETING_SQUARED, &mut row[4..]);
        }
        (self.write_allies)(others, position, SIGHT_SQUARED, &mut row[self.allies..]);
        gathered.allies.write_body(agent, &mut row[self.own..]);
        if self.end > self.rest {
            row[self.rest..self.end].fill(0.0);
        }
    }
}

/// Whether each of the moves is available, as 0 or 1.
fn move_features(available: u64) -> F32x4 {
    let bits = i32x4::new([0, 1, 2, 3].map(|i| 1 << (action::NORTH + i)));
    let is_available = (i32x4::splat(available as i32) & bits).simd_eq(bits);
    cast::<i32x4, F32x4>(is_available) & F32x4::ONE
}

/// The mark of an enemy says whether the target action of its number is available. A healer's target actions
/// mean allies, so beside enemy i it says whether ally i is within targeting range. It does so for healers too,
/// which the available actions exclude.
fn mark_healable(view: &View, healer: Vec2, agent: usize, blocks: &mut [f32]) {
    let Gathered { allies, enemies } = view.gathered;
    let mut blocks =
        blocks.chunks_exact_mut(HEAD + enemies.body_size).take(view.arena.enemies.len()).enumerate();
    let mut fours = allies.xs.chunks(MASK_BITS / WIDTH).zip(allies.ys.chunks(MASK_BITS / WIDTH));
    while blocks.len() > 0 {
        let in_range = fours.next().map_or(0, |(xs, ys)| within_targeting_range(healer, xs, ys));
        for (enemy, block) in blocks.by_ref().take(MASK_BITS) {
            // It is 1 as yet if the enemy is seen.
            if in_range >> (enemy % MASK_BITS) & 1 == 0 || enemy == agent {
                block[0] = 0.0;
            }
        }
    }
}

/// Writes the blocks of units for an observer at a position: a mark, which is 1 for units that are seen and
/// whose squared distance is at most the third argument, distance, dx, dy, and the body.
type WriteUnits = fn(&Faction, Vec2, f64, &mut [f32]);

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
fn write_units<const BODY: usize>(units: &Faction, from: Vec2, marked_within: f64, out: &mut [f32]) {
    let body = if BODY == 0 { units.body_size } else { BODY };
    let (block, stride) = (HEAD + body, stride(body));
    let (x, y, range) = (F32x4::splat(from.x), F32x4::splat(from.y), F32x4::splat(SIGHT_RANGE as f32));
    let mut rest = out;
    let positions = units.xs.iter().zip(&units.ys);
    for ((&xs, &ys), bodies) in positions.zip(units.bodies.chunks_exact(stride)) {
        let blocks = &mut rest[..WIDTH * block + stride - body];
        let squared = distances_squared(from, xs, ys);
        let is_seen = at_most(squared, SIGHT_SQUARED);
        if is_seen.any() {
            // The distance is computed in f64 and rounded once; dx and dy are f32 throughout, as in the
            // published environment.
            let distance = squared.map(|squared| squared.sqrt() / f64x2::splat(SIGHT_RANGE));
            let mark = at_most(squared, marked_within) & F32x4::ONE;
            let heads = [mark, rounded(distance), (xs - x) / range, (ys - y) / range];
            let heads = F32x4::transpose(heads.map(|column| column & is_seen));
            for (i, head) in heads.iter().enumerate() {
                blocks[i * block..i * block + HEAD].copy_from_slice(head.as_array());
                if stride == 1 {
                    blocks[i * block + HEAD] = (bodies[0] & is_seen).as_array()[i];
                } else {
                    let is_seen = F32x4::splat(is_seen.as_array()[i]);
                    let begin = i * block + HEAD;
                    let fours = &bodies[i * (stride / WIDTH)..(i + 1) * (stride / WIDTH)];
                    for (j, four) in fours.iter().enumerate() {
                        blocks[begin + j * WIDTH..begin + (j + 1) * WIDTH]
                            .copy_from_slice((*four & is_seen).as_array());
                    }
                }
            }
        } else {
            blocks[..WIDTH * block].fill(0.0);
        }
        rest = &mut rest[WIDTH * block..];
    }
}
