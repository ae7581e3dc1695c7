//! The decision of one unit: what it targets, and where it goes.

use std::cmp::Ordering;

use glam::Vec2;
use smaclite_scenarios::Faction;

use super::Situation;
use crate::arena::Arena;
use crate::command::{DIRECTIONS, MOVE, action};
use crate::distance::distance_squared;

/// The order of two ranks; the smaller one comes first.
pub(super) fn by_rank(a: (f64, f64), b: (f64, f64)) -> Ordering {
    a.partial_cmp(&b).unwrap_or(Ordering::Equal)
}

/// The living units of a side, by battle-wide id.
pub(super) fn living<S: Situation>(situation: &S, faction: Faction) -> impl Iterator<Item = u32> {
    situation.arena().ids(faction).iter().copied().filter(|&id| situation.is_alive(id))
}

/// The middle of units; `None` if there is none.
pub(super) fn middle<S: Situation>(situation: &S, ids: impl Iterator<Item = u32>) -> Option<Vec2> {
    let (sum, count) =
        ids.fold((Vec2::ZERO, 0), |(sum, count), id| (sum + situation.position(id), count + 1));
    (count > 0).then(|| sum / count as f32)
}

/// What one unit of the own side knows and can do.
pub(super) struct Choice<'a, S> {
    pub situation: &'a S,
    pub agent: usize,
    pub id: u32,
    pub is_healer: bool,
    /// The units that its target actions name, in their order.
    others: &'a [u32],
}

impl<'a, S: Situation> Choice<'a, S> {
    pub fn new(situation: &'a S, agent: usize) -> Self {
        let arena = situation.arena();
        let id = arena.ids(situation.faction())[agent];
        Choice { situation, agent, id, is_healer: arena.stats(id).is_healer, others: arena.targets_of(id) }
    }

    fn arena(&self) -> &'a Arena {
        self.situation.arena()
    }

    pub fn is_available(&self, action: usize) -> bool {
        self.situation.is_available(self.agent, action)
    }

    pub fn is_dead(&self) -> bool {
        self.is_available(action::NO_OP)
    }

    pub fn position(&self) -> Vec2 {
        self.situation.position(self.id)
    }

    pub fn distance_squared(&self, other: u32) -> f64 {
        distance_squared(self.position(), self.situation.position(other))
    }

    /// Targets the nearest available target, otherwise goes to the nearest [goal](Self::goal).
    pub fn nearest(&self) -> usize {
        if self.is_dead() {
            return action::NO_OP;
        }
        self.target(|_| true).unwrap_or_else(|| self.advance())
    }

    /// Goes to the nearest [goal](Self::goal), or to the attack point if the side sees no opponent.
    pub fn advance(&self) -> usize {
        let to = self.goal().map(|goal| self.situation.position(goal)).or(self.situation.attack_point());
        to.map_or(action::STOP, |point| self.approach(point))
    }

    /// Whether a unit is within attack range.
    pub fn is_in_reach(&self, other: u32) -> bool {
        self.distance_squared(other) <= self.arena().matchup(self.id, other).reach_squared
    }

    /// Whether the unit can attack another, or heal it.
    pub fn can_target(&self, other: u32) -> bool {
        self.arena().can_attack(self.id, other)
    }

    /// The action on the unit of this index among the others.
    pub fn target_action(&self, target: usize) -> usize {
        self.arena().first_target(self.situation.faction()) + target
    }

    /// The available targets: index among the others, and battle-wide id.
    pub fn targets(&self) -> impl Iterator<Item = (usize, u32)> {
        let targets = self.others.iter().copied().enumerate();
        targets.filter(|&(i, _)| self.is_available(self.target_action(i)))
    }

    /// The available target that comes first: for healers the one with the smallest share of health, then the
    /// nearest.
    pub fn target(&self, is_candidate: impl Fn(u32) -> bool) -> Option<usize> {
        // The first of equal ranks wins, so decisions do not depend on the order of a search.
        let rank = |other: u32| {
            let share = if self.is_healer { self.situation.health_share(other) } else { 0.0 };
            (share, self.distance_squared(other))
        };
        let candidates = self.targets().filter(|&(_, other)| is_candidate(other));
        let best = candidates.min_by(|a, b| by_rank(rank(a.1), rank(b.1)));
        best.map(|(i, _)| self.target_action(i))
    }

    /// The unit to walk to: the nearest living opponent that is seen; for healers the nearest unit of their
    /// side that is not a healer.
    pub fn goal(&self) -> Option<u32> {
        // Healers cannot heal each other. If they followed each other, they would stay behind the team.
        let is_goal = |other: u32| {
            let is_known = self.is_healer || self.situation.is_seen(other);
            self.situation.is_alive(other)
                && is_known
                && other != self.id
                && !(self.is_healer && self.arena().stats(other).is_healer)
        };
        self.nearest_of(self.others.iter().copied().filter(|&other| is_goal(other)))
    }

    /// The nearest of some units.
    pub fn nearest_of(&self, ids: impl Iterator<Item = u32>) -> Option<u32> {
        ids.min_by(|&a, &b| self.distance_squared(a).total_cmp(&self.distance_squared(b)))
    }

    /// The nearest living opponent that is seen.
    pub fn opponent(&self) -> Option<u32> {
        let opponents = living(self.situation, self.situation.faction().opponent());
        self.nearest_of(opponents.filter(|&id| self.situation.is_seen(id)))
    }

    /// The available move that leads nearest to a point; stop if none leads nearer.
    pub fn approach(&self, point: Vec2) -> usize {
        let here = distance_squared(self.position(), point);
        // Only the direction matters here, so a step of one square does for the comparison.
        let steps = self.moves(1.0).map(|(action, end)| (action, distance_squared(end, point)));
        let nearer = steps.filter(|step| step.1 < here);
        nearer.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(action::STOP, |step| step.0)
    }

    /// The available move that leads farthest from a point; `None` if none leads farther.
    pub fn leave(&self, point: Vec2) -> Option<usize> {
        let here = distance_squared(self.position(), point);
        let steps = self.moves(MOVE as f32).map(|(action, end)| (action, distance_squared(end, point)));
        let farther = steps.filter(|step| step.1 > here);
        farther.max_by(|a, b| a.1.total_cmp(&b.1)).map(|step| step.0)
    }

    /// The available moves, each with the position after it.
    fn moves(&self, length: f32) -> impl Iterator<Item = (usize, Vec2)> + '_ {
        let position = self.position();
        let all = (action::NORTH..).zip(DIRECTIONS);
        all.filter(|&(action, _)| self.is_available(action))
            .map(move |(action, step)| (action, position + Vec2::from(step.map(|d| d as f32)) * length))
    }
}
