//! The available actions.

use super::{FIRST_LOOK, Frame, Interface, Kind, Perception};
use crate::action;
use crate::command::DIRECTIONS;

impl Interface {
    /// Writes which actions are available: bit `a % 64` of word `a / 64` of an agent's row is action `a`,
    /// `[n_agents, n_actions.div_ceil(64)]`.
    ///
    /// # Panics
    /// If `out` has another size.
    #[inline(never)]
    pub fn write_available(&self, frame: &Frame, perception: &Perception, out: &mut [u64]) {
        let words = self.n_actions.div_ceil(u64::BITS as usize);
        assert_eq!(out.len(), self.n_agents * words, "one row per agent");
        for (agent, row) in out.chunks_exact_mut(words).enumerate() {
            // Cones, and whom healers heal.
            let needs_more = self.n_looks > 0 || self.can_heal;
            row.fill(0);
            if !frame.is_alive(agent) {
                row[0] = 1 << action::NO_OP;
                continue;
            }
            row[0] = 1 << action::STOP | u64::from(self.moves(frame, agent)) << action::NORTH;
            for action in FIRST_LOOK..self.first_target() {
                row[action / 64] |= 1 << (action % 64);
            }
            // What `is_available` says of each target, without looking the agent up each time.
            let &Kind { is_healer, reach, .. } = self.kind(frame, agent);
            let (distances, first) = match is_healer {
                true => (frame.distances_to_allies(agent), 0),
                false => (frame.distances_to_enemies(agent), self.n_agents),
            };
            let targets = distances.iter().zip(&frame.health[first..]).enumerate();
            for (target, (distance, health)) in targets {
                let is_near = *distance <= reach || !self.options.action_mask;
                if is_near
                    && *health > 0.0
                    && (!needs_more || self.is_available(frame, perception, agent, target))
                {
                    let action = self.first_target() + target;
                    row[action / 64] |= 1 << (action % 64);
                }
            }
        }
    }

    /// The units that the target actions of an agent mean, by number in their faction.
    pub(super) fn n_targets(&self, frame: &Frame, agent: usize) -> usize {
        if self.kind(frame, agent).is_healer { self.n_agents } else { self.n_enemies }
    }

    /// The unit that a target action of an agent means.
    pub(super) fn target(&self, frame: &Frame, agent: usize, target: usize) -> usize {
        if self.kind(frame, agent).is_healer { target } else { self.n_agents + target }
    }

    /// Whether a target action of an agent means a living unit that it can heal or attack.
    fn is_target(&self, frame: &Frame, agent: usize, target: usize) -> bool {
        let unit = self.target(frame, agent, target);
        let heals = self.kind(frame, agent).is_healer;
        target < self.n_targets(frame, agent)
            && frame.is_alive(unit)
            && !(heals && self.kind(frame, unit).is_healer)
    }

    /// Whether a target action of a living agent is available.
    pub(super) fn is_available(
        &self,
        frame: &Frame,
        perception: &Perception,
        agent: usize,
        target: usize,
    ) -> bool {
        !self.options.action_mask && self.is_target(frame, agent, target)
            || self.is_targetable(frame, perception, agent, target)
    }

    /// Whether a target action of an agent means a unit in range, whatever the mask of actions says.
    pub(super) fn is_targetable(
        &self,
        frame: &Frame,
        perception: &Perception,
        agent: usize,
        target: usize,
    ) -> bool {
        self.is_target(frame, agent, target)
            && self.reaches(frame, perception, agent, self.target(frame, agent, target))
    }

    /// Writes which actions would be available with the mask of actions: u8 0 or 1, `[n_agents, n_actions]`.
    ///
    /// # Panics
    /// If `out` has another size.
    pub fn write_truly_available(&self, frame: &Frame, perception: &Perception, out: &mut [u8]) {
        let words = self.n_actions.div_ceil(u64::BITS as usize);
        let mut bits = vec![0; self.n_agents * words];
        self.write_available(frame, perception, &mut bits);
        for (agent, row) in out.chunks_exact_mut(self.n_actions).enumerate() {
            for (action, out) in row.iter_mut().enumerate() {
                let target = action.checked_sub(self.first_target());
                *out = match target.filter(|_| frame.is_alive(agent)) {
                    Some(target) => self.is_targetable(frame, perception, agent, target).into(),
                    None => (bits[agent * words + action / 64] >> (action % 64) & 1) as u8,
                };
            }
        }
    }

    /// The available moves, north first, from the lowest bit on: half a move away must be walkable. Fractions
    /// of coordinates are cut off towards zero, so the points up to one square west and south of the map
    /// count as its outer squares.
    pub(super) fn moves(&self, frame: &Frame, agent: usize) -> u8 {
        let half = self.options.move_amount / 2.0;
        let (x, y) = (f64::from(frame.x[agent]), f64::from(frame.y[agent]));
        DIRECTIONS.iter().enumerate().fold(0, |moves, (i, [dx, dy])| {
            let square = [(x + dx * half) as i64, (y + dy * half) as i64];
            moves | u8::from(self.terrain.is_walkable(square[0], square[1])) << i
        })
    }
}
