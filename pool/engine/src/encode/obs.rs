//! Observations: what each unit of a side sees within its sight range. "Allies" and "enemies" are here those
//! of the side that observes.

use std::ops::Range;

use glam::Vec2;

use super::View;
use super::unit_tables::{
    SIGHT_SQUARED, TARGETING_SQUARED, UNITS_PER_WORD, UnitTable, at_most, distances_squared, fours, stride,
    within_targeting_range, write_body,
};
use crate::SIGHT_RANGE;
use crate::command::action;
use crate::simd::x4::{F32x4, F64x4, Four, Mask4, Vec2x4, WIDTH};

/// Working memory: a row for those at the end of the output, and what is written beyond it.
#[derive(Debug, Default)]
pub(crate) struct ObsScratch {
    row: Vec<f32>,
}

/// Floats before the enemies: the moves.
const MOVES: usize = 4;
/// Floats of a unit before its body: the mark, distance, dx, dy.
const HEAD: usize = 4;

/// Writes the rows of all units of a side. Rows may be longer than `obs_size`; the rest of them becomes 0.
///
/// A row is written from left to right in whole registers, four units at a time. Each part may end beyond
/// its end, where the next part, or the next row, is written later. So rows near the end of the output are
/// written elsewhere and copied.
#[inline(never)]
pub(crate) fn write_obs(view: &View, out: &mut [f32], scratch: &mut ObsScratch) {
    let sizes = view.arena.sizes_of(view.faction);
    let row_len = out.len() / sizes.n_agents;
    assert!(row_len >= sizes.obs_size && out.len() == sizes.n_agents * row_len, "one row per agent");
    let (enemy_body, ally_body) = (view.others().body_size, view.own().body_size);
    // Up to three units too many, or an own body of whole registers.
    let extent = row_len + (WIDTH - 1) * (HEAD + enemy_body.max(ally_body));
    let writer = RowWriter {
        view,
        allies: MOVES + sizes.n_enemies * (HEAD + enemy_body),
        row_len,
        sight: view.sign() * SIGHT_RANGE as f32,
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
    /// What offsets are divided by.
    sight: f32,
    write_enemies: WriteUnits,
    write_allies: WriteUnits,
}

impl RowWriter<'_> {
    /// Writes a row, and anything beyond it.
    fn write(&self, agent: usize, row: &mut [f32]) {
        let View { arena, faction, available, .. } = self.view;
        let (allies, enemies) = (self.view.own(), self.view.others());
        let ids = arena.ids(*faction);
        let available = available.first_bits(agent);
        if available == 1 << action::NO_OP {
            // It is dead, or an enemy that a script plays.
            row[..self.row_len].fill(0.0);
            return;
        }
        row[..MOVES].copy_from_slice(&move_features(available));
        let position = allies.position(agent);
        let observer = Observer { position, sight: self.sight };
        let all = 0..arena.ids(faction.opponent()).len();
        let blocks = &mut row[MOVES..];
        if arena.stats(ids[agent]).is_healer {
            (self.write_enemies)(enemies, all, observer, SIGHT_SQUARED, blocks);
            mark_healable(self.view, position, agent, blocks);
        } else {
            (self.write_enemies)(enemies, all, observer, TARGETING_SQUARED, blocks);
        }
        // A unit has no block in its own row.
        let (before, after) = (0..agent, agent + 1..ids.len());
        let own_block = self.allies + agent * (HEAD + allies.body_size);
        (self.write_allies)(allies, before, observer, SIGHT_SQUARED, &mut row[self.allies..]);
        (self.write_allies)(allies, after, observer, SIGHT_SQUARED, &mut row[own_block..]);
        let end = arena.sizes_of(*faction).obs_size;
        write_body(allies.body(agent), &mut row[end - allies.body_size..]);
        if self.row_len > end {
            row[end..self.row_len].fill(0.0);
        }
    }
}

/// Whether each of the moves is available, as 0 or 1.
fn move_features(available: u64) -> [f32; MOVES] {
    std::array::from_fn(|i| (available >> (action::NORTH + i) & 1) as f32)
}

/// The mark of an enemy says whether the target action of its number is available. A healer's target
/// actions mean allies, so beside enemy i it says whether ally i is within targeting range. It does so for
/// healers too, which the available actions exclude.
fn mark_healable(view: &View, healer: Vec2, agent: usize, blocks: &mut [f32]) {
    let (allies, enemies) = (view.own(), view.others());
    let mut in_range = 0;
    let blocks = blocks.chunks_exact_mut(HEAD + enemies.body_size);
    for (enemy, block) in blocks.take(view.arena.ids(view.faction.opponent()).len()).enumerate() {
        if enemy % UNITS_PER_WORD == 0 {
            in_range = within_targeting_range(healer, allies, enemy);
        }
        // It is 1 as yet if the enemy is seen.
        if in_range >> (enemy % UNITS_PER_WORD) & 1 == 0 || enemy == agent {
            block[0] = 0.0;
        }
    }
}

/// A unit that sees others.
#[derive(Clone, Copy)]
struct Observer {
    position: Vec2,
    /// What offsets are divided by: the sight range, negative if they are reflected.
    sight: f32,
}

/// Writes the blocks of a range of units for an observer: a mark, which is 1 for units that are seen and
/// whose squared distance is at most the fourth argument, distance, dx, dy, and the body.
type WriteUnits = fn(&UnitTable, Range<usize>, Observer, f64, &mut [f32]);

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
///
/// Four units per turn. Their heads are computed as columns and transposed to rows; bodies are copied in
/// whole registers. A register may end behind its body: units are written in ascending order, so the next
/// block overwrites what is too much, and only the last of four must stop in time.
fn write_units<const BODY: usize>(
    units: &UnitTable,
    range: Range<usize>,
    observer: Observer,
    marked_within: f64,
    out: &mut [f32],
) {
    let body_len = if BODY == 0 { units.body_size } else { BODY };
    let (four, block_len) = (units.four, HEAD + body_len);
    for FourUnits { xs, ys, bodies, blocks } in fours_of(units, range, body_len, out) {
        let squared = distances_squared(four, observer.position, xs, ys);
        let seen = at_most(squared, SIGHT_SQUARED);
        if !seen.any() {
            blocks.fill(0.0);
            continue;
        }
        let heads = heads(observer, [xs, ys], squared, at_most(squared, marked_within), seen);
        for (i, head) in heads.iter().enumerate() {
            let block = &mut blocks[i * block_len..];
            block[..HEAD].copy_from_slice(head);
            copy_body(bodies, i, body_len, seen, &mut block[HEAD..]);
        }
    }
}

/// Four units and their blocks.
struct FourUnits<'a> {
    xs: &'a [f32; WIDTH],
    ys: &'a [f32; WIDTH],
    bodies: &'a [f32],
    blocks: &'a mut [f32],
}

/// The units of a range by fours; the last may be padding, which is out of sight.
#[inline(always)]
fn fours_of<'a>(
    units: &'a UnitTable,
    range: Range<usize>,
    body_len: usize,
    out: &'a mut [f32],
) -> impl Iterator<Item = FourUnits<'a>> {
    let (block_len, stride) = (HEAD + body_len, stride(body_len));
    let n_units = range.len().next_multiple_of(WIDTH);
    let (begin, end) = (range.start, range.start + n_units);
    let positions = fours(&units.xs[begin..end]).zip(fours(&units.ys[begin..end]));
    let bodies = units.bodies[begin * stride..end * stride].chunks_exact(WIDTH * stride);
    let blocks = out[..n_units * block_len].chunks_exact_mut(WIDTH * block_len);
    positions.zip(bodies.zip(blocks)).map(
        #[inline(always)]
        |((xs, ys), (bodies, blocks))| FourUnits { xs, ys, bodies, blocks },
    )
}

/// Mark, distance, dx and dy of four units; zeros for those that are not seen.
#[inline(always)]
fn heads(
    observer: Observer,
    [xs, ys]: [&[f32; WIDTH]; 2],
    squared: F64x4,
    marked: Mask4,
    seen: Mask4,
) -> [[f32; HEAD]; WIDTH] {
    let four = squared.four();
    // The distance is computed in f64 and rounded once; dx and dy are f32 throughout, as in the published
    // environment.
    let distance = squared.sqrt().div(F64x4::splat(four, SIGHT_RANGE)).rounded();
    let offset = Vec2x4 { x: F32x4::new(four, *xs), y: F32x4::new(four, *ys) }
        - Vec2x4::splat(four, observer.position);
    let sight = F32x4::splat(four, observer.sight);
    let mark = marked.keep(F32x4::splat(four, 1.0));
    F32x4::transpose(
        [mark, distance, offset.x.div(sight), offset.y.div(sight)].map(|column| seen.keep(column)),
    )
}

/// Copies the body of one of four units, or zeros if it is not seen, and all but for the last unit perhaps
/// some zeros more.
#[inline(always)]
fn copy_body(bodies: &[f32], unit: usize, body_len: usize, seen: Mask4, out: &mut [f32]) {
    let stride = stride(body_len);
    if stride == 1 {
        out[0] = seen.keep(register(seen.simd(), bodies, 0)).to_array()[unit];
        return;
    }
    let is_seen = seen.splat_entry(unit);
    for begin in (0..stride).step_by(WIDTH) {
        let floats = is_seen.keep(register(seen.simd(), bodies, unit * stride + begin)).to_array();
        let n = if unit + 1 < WIDTH { WIDTH } else { WIDTH.min(body_len - begin) };
        out[begin..begin + n].copy_from_slice(&floats[..n]);
    }
}

/// Four floats from this one on.
#[inline(always)]
fn register(four: Four, floats: &[f32], begin: usize) -> F32x4 {
    F32x4::new(four, std::array::from_fn(|i| floats[begin + i]))
}
