//! Observations: what each agent sees within its sight range.

use glam::Vec2;
use wide::f64x2;

use super::View;
use super::gathered::{
    Faction, Gathered, SIGHT_SQUARED, TARGETING_SQUARED, at_most, distances_squared, rounded, stride,
};
use crate::SIGHT_RANGE;
use crate::command::action;
use crate::simd::{F32x4, MASK_BITS, Vec2x4, WIDTH, mask};

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
/// A row is written from left to right in whole registers, and up to four units at a time. The last of a part
/// may end beyond it, where the next part, or the next row, is written later. So rows near the end of the output
/// are written elsewhere and copied.
#[inline(never)]
pub(crate) fn write_obs(view: &View, out: &mut [f32], scratch: &mut ObsScratch) {
    let sizes = view.arena.sizes();
    let row_len = out.len() / sizes.n_agents;
    assert!(row_len >= sizes.obs_size && out.len() == sizes.n_agents * row_len, "one row per agent");
    let ObsScratch { others, row } = scratch;
    let allies = &view.gathered.allies;
    others.copy_from(allies, 1, sizes.n_agents - 1);
    let layout = Layout::new(view);
    let extent = row_len.max(layout.extent);
    row.resize(extent, 0.0);
    for agent in 0..sizes.n_agents {
        if agent > 0 {
            // The others of this agent are those of the last one, with the last one in the place of this one.
            others.copy_unit(agent - 1, allies, agent - 1);
        }
        let begin = agent * row_len;
        if let Some(row) = out.get_mut(begin..begin + extent) {
            write_row(view, &layout, others, agent, row_len, row);
        } else {
            write_row(view, &layout, others, agent, row_len, row);
            out[begin..begin + row_len].copy_from_slice(&row[..row_len]);
        }
    }
}

/// Where the parts of a row begin, and how its blocks are written.
struct Layout {
    allies: usize,
    own: usize,
    end: usize,
    /// Floats from the start of a row that writing it may touch.
    extent: usize,
    write_enemies: WriteUnits,
    write_allies: WriteUnits,
}

impl Layout {
    fn new(view: &View) -> Layout {
        let (sizes, features) = (view.arena.sizes(), &view.arena.features);
        let (enemy, ally) = (features.enemy_body(), features.ally_body());
        let allies = 4 + sizes.n_enemies * (HEAD + enemy);
        let own = sizes.obs_size - ally;
        let end_of = |begin, n_units: usize, body| {
            begin + n_units.next_multiple_of(WIDTH) * (HEAD + body) + stride(body) - body
        };
        let ends = [
            end_of(4, sizes.n_enemies, enemy),
            end_of(allies, sizes.n_agents - 1, ally),
            own + ally.next_multiple_of(WIDTH),
        ];
        Layout {
            allies,
            own,
            end: sizes.obs_size,
            extent: ends.into_iter().fold(0, usize::max),
            write_enemies: writer(enemy),
            write_allies: writer(ally),
        }
    }
}

fn write_row(view: &View, layout: &Layout, others: &Faction, agent: usize, row_len: usize, row: &mut [f32]) {
    let (arena, gathered) = (view.arena, view.gathered);
    let id = arena.agents[agent];
    if !view.units.alive[id as usize] {
        row[..row_len].fill(0.0);
        return;
    }
    let position = view.units.pos[id as usize];
    let moves = view.available.of(agent)[0] >> action::NORTH;
    for (i, out) in row[..4].iter_mut().enumerate() {
        *out = (moves >> i & 1) as f32;
    }
    if arena.stats(id).is_healer {
        (layout.write_enemies)(&gathered.enemies, position, SIGHT_SQUARED, &mut row[4..]);
        mark_healable(view, position, agent, &mut row[4..]);
    } else {
        (layout.write_enemies)(&gathered.enemies, position, TARGETING_SQUARED, &mut row[4..]);
    }
    (layout.write_allies)(others, position, SIGHT_SQUARED, &mut row[layout.allies..]);
    gathered.allies.write_body(agent, &mut row[layout.own..]);
    if row_len > layout.end {
        row[layout.end..row_len].fill(0.0);
    }
}

/// The mark of an enemy says whether the target action of its number is available. A healer's target actions
/// mean allies, so beside enemy i it says whether ally i is within targeting range. It does so for healers too,
/// which the available actions exclude.
fn mark_healable(view: &View, healer: Vec2, agent: usize, blocks: &mut [f32]) {
    let Gathered { allies, enemies } = view.gathered;
    let block = HEAD + enemies.body_size;
    let is_within = |four: &Vec2x4| at_most(distances_squared(healer, four), TARGETING_SQUARED);
    let mut in_range = 0;
    for (enemy, block) in blocks.chunks_mut(block).take(view.arena.enemies.len()).enumerate() {
        if enemy % MASK_BITS == 0 {
            let fours = allies.positions.chunks(MASK_BITS / WIDTH).nth(enemy / MASK_BITS);
            in_range = mask(fours.unwrap_or_default(), is_within);
        }
        // It is 1 as yet if the enemy is seen.
        if in_range >> (enemy % MASK_BITS) & 1 == 0 || enemy == agent {
            block[0] = 0.0;
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
    let (observer, range) = (Vec2x4::splat(from), F32x4::splat(SIGHT_RANGE as f32));
    let mut rest = out;
    for (four, bodies) in units.positions.iter().zip(units.bodies.chunks_exact(stride)) {
        let blocks = &mut rest[..WIDTH * block + stride - body];
        let squared = distances_squared(from, four);
        let is_seen = at_most(squared, SIGHT_SQUARED);
        if is_seen.any() {
            // The distance is computed in f64 and rounded once; dx and dy are f32 throughout, as in the
            // published environment.
            let distance = squared.map(|squared| squared.sqrt() / f64x2::splat(SIGHT_RANGE));
            let offset = *four - observer;
            let mark = at_most(squared, marked_within) & F32x4::ONE;
            let heads = [mark, rounded(distance), offset.x / range, offset.y / range];
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
