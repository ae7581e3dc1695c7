//! The living units of a plane, packed for one tick.

mod search;

use std::hint::select_unpredictable;

use glam::Vec2;

use super::columns::{Columns, WORD};
use super::tree::Tree;
use crate::arena::{AvoidanceParams, EdgesByCell};
use crate::buffers::clear_and_reserve;
use crate::simd::{F32s, InstructionSet, MAX_WIDTH, Vec2s};

/// The living units of a plane, in the order of [`NeighbourOrder`](crate::NeighbourOrder); a unit's *index*
/// is its number in that order.
#[derive(Debug, Default)]
pub(super) struct PlaneUnits {
    /// The members; entries from `n` on are stale, here and below.
    members: Vec<Member>,
    n: usize,
    /// The indices of the units that move.
    movers: Vec<u32>,
    n_movers: usize,
    /// What is computed for several units at a time, by index. Padded to full registers; padding is at
    /// infinity, where no search finds it.
    position: Columns,
    preferred: Columns,
    max_speed: Vec<f32>,
    /// The preferred velocity within the speed limit.
    unconstrained: Columns,
    /// The cell in which each unit is.
    cell: Vec<f32>,
    /// The corners of the box around the units of each word, padded to [`MAX_WIDTH`] with boxes at infinity.
    /// Empty if there is one word only.
    low: Columns,
    high: Columns,
    /// Decides which of two equally near units comes first, if there are more units than fit in a leaf.
    tree: Tree,
    /// Memory for the results of the tree.
    visited: Vec<u32>,
}

/// All units of a battle, by battle-wide id, as they are packed.
pub(super) struct BattleUnits<'a> {
    pub positions: &'a [Vec2],
    /// The velocities that were planned in the last tick.
    pub velocities: &'a [Vec2],
    pub preferred: &'a [Vec2],
    pub stats: &'a [AvoidanceParams],
}

/// A unit as its neighbours see it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Member {
    pub position: Vec2,
    /// The velocity that it planned in the last tick, which its neighbours expect it to keep.
    pub velocity: Vec2,
    pub radius: f32,
    /// The share of the avoidance that neighbours take. Reciprocity: both units take one half each. A unit
    /// that stays takes none, so its neighbours take all.
    pub share: f32,
    /// Battle-wide id.
    pub id: u32,
}

impl PlaneUnits {
    /// Reserves memory for `n_units` units.
    pub fn reserve(&mut self, n_units: usize) {
        self.members.resize(n_units, Member::default());
        clear_and_reserve(&mut self.visited, n_units);
        let n_padded = n_units.next_multiple_of(MAX_WIDTH);
        let n_boxes = n_units.div_ceil(WORD).next_multiple_of(MAX_WIDTH);
        self.movers.resize(n_units, 0);
        for columns in [&mut self.preferred, &mut self.unconstrained] {
            columns.resize(n_padded);
        }
        // The tree loads registers from any unit on.
        self.position.resize(n_padded + MAX_WIDTH);
        self.max_speed.resize(n_padded, 0.0);
        self.cell.resize(n_padded, 0.0);
        self.low.resize(n_boxes);
        self.high.resize(n_boxes);
        self.tree.reserve(n_units);
    }

    /// Packs the units of a list, which is put in the order that equally near neighbours require.
    #[inline(always)]
    pub fn pack<S: InstructionSet>(&mut self, simd: S, ids: &mut [u32], battle: &BattleUnits) {
        let n = ids.len();
        // The last register of coordinates as a whole, in one store, before the units overwrite a part of it.
        let last = n.saturating_sub(1) / MAX_WIDTH * MAX_WIDTH;
        for column in [&mut self.position.x, &mut self.position.y] {
            column[last..][..MAX_WIDTH].copy_from_slice(&[f32::INFINITY; MAX_WIDTH]);
        }
        let has_tree = n > Tree::LEAF_SIZE;
        if has_tree {
            let Columns { x, y } = &mut self.position;
            for ((&id, x), y) in ids.iter().zip(x).zip(y) {
                (*x, *y) = battle.positions[id as usize].into();
            }
            self.tree.build(simd, ids, &mut self.position);
        }
        // Not twice: registers that were just written float by float are slow to load.
        self.fill(ids, battle, !has_tree);
        if n > WORD {
            self.find_boxes();
        }
    }

    /// Fills the rows of all units, and lists those that move.
    #[inline(always)]
    fn fill(&mut self, ids: &[u32], battle: &BattleUnits, fill_positions: bool) {
        // Slices of one known length: one check of an index serves them all.
        let n = ids.len();
        let (members, movers) = (&mut self.members[..n], &mut self.movers[..n]);
        let (x, y) = (&mut self.position.x[..n], &mut self.position.y[..n]);
        let (preferred_x, preferred_y) = (&mut self.preferred.x[..n], &mut self.preferred.y[..n]);
        let max_speed = &mut self.max_speed[..n];
        let n_units = battle.positions.len();
        let (velocities, preferred, stats) =
            (&battle.velocities[..n_units], &battle.preferred[..n_units], &battle.stats[..n_units]);
        let mut n_movers = 0;
        for (index, &id) in ids.iter().enumerate() {
            let i = id as usize;
            let (position, velocity, preferred) = (battle.positions[i], velocities[i], preferred[i]);
            // Whether both are 0 or -0, by their bits: comparisons of floats become branches.
            let stays = (preferred.x.to_bits() | preferred.y.to_bits()) << 1 == 0;
            let share = select_unpredictable(stays, 1.0, 0.5);
            members[index] = Member { position, velocity, radius: stats[i].radius, share, id };
            if fill_positions {
                (x[index], y[index]) = position.into();
            }
            (preferred_x[index], preferred_y[index]) = preferred.into();
            max_speed[index] = stats[i].max_speed;
            // Written before it is known whether it moves: no branch, which would be hard to predict.
            movers[n_movers] = index as u32;
            n_movers += usize::from(!stays);
        }
        (self.n, self.n_movers) = (n, n_movers);
    }

    /// Finds the boxes around the units of each word.
    fn find_boxes(&mut self) {
        let n = self.n;
        let columns = [
            (&self.position.x, &mut self.low.x, &mut self.high.x),
            (&self.position.y, &mut self.low.y, &mut self.high.y),
        ];
        for (column, low, high) in columns {
            low.fill(f32::INFINITY);
            high.fill(f32::INFINITY);
            for ((word, low), high) in column[..n].chunks(WORD).zip(low).zip(high) {
                *low = word.iter().copied().fold(f32::INFINITY, f32::min);
                *high = word.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            }
        }
    }

    /// The indices of the units that move, ascending.
    pub fn movers(&self) -> &[u32] {
        &self.movers[..self.n_movers]
    }

    /// All members.
    pub fn members(&self) -> &[Member] {
        &self.members[..self.n]
    }

    /// The cell in which a unit is.
    pub fn cell(&self, index: usize) -> f32 {
        self.cell[index]
    }

    /// The velocity that a unit prefers.
    pub fn preferred(&self, index: usize) -> Vec2 {
        self.preferred.get(index)
    }

    /// The velocities of all units without neighbours and obstacles, with their ids, after
    /// [`find_unconstrained`](Self::find_unconstrained).
    #[inline(always)]
    pub fn all_unconstrained(&self) -> impl Iterator<Item = (u32, Vec2)> {
        let (x, y) = (&self.unconstrained.x[..self.n], &self.unconstrained.y[..self.n]);
        self.members().iter().zip(x).zip(y).map(|((member, &x), &y)| (member.id, Vec2::new(x, y)))
    }

    /// The velocity of a unit without neighbours or obstacles, after
    /// [`find_unconstrained`](Self::find_unconstrained).
    pub fn unconstrained(&self, index: usize) -> Vec2 {
        self.unconstrained.get(index)
    }

    /// Finds the cells of all units, and their velocities without neighbours and obstacles: the preferred
    /// ones within the speed limit. Those that are no finite number are zero.
    #[inline(always)]
    pub fn find_unconstrained<S: InstructionSet>(&mut self, simd: S, edges: &EdgesByCell) {
        let n = self.n.next_multiple_of(MAX_WIDTH);
        let (x, y) = (&self.preferred.x[..n], &self.preferred.y[..n]);
        let (to_x, to_y) = (&mut self.unconstrained.x[..n], &mut self.unconstrained.y[..n]);
        let max_speed = F32s::all(simd, &self.max_speed[..n]);
        let preferred = Vec2s::all(simd, x, y);
        let to = to_x.chunks_exact_mut(S::WIDTH).zip(to_y.chunks_exact_mut(S::WIDTH));
        for ((max_speed, preferred), (to_x, to_y)) in max_speed.zip(preferred).zip(to) {
            let velocity = preferred.within(max_speed).finite_or_zero();
            velocity.x.to_slice(to_x);
            velocity.y.to_slice(to_y);
        }
        let positions = Vec2s::all(simd, &self.position.x[..n], &self.position.y[..n]);
        for (position, to) in positions.zip(self.cell[..n].chunks_exact_mut(S::WIDTH)) {
            edges.cells(position).to_slice(to);
        }
    }
}
