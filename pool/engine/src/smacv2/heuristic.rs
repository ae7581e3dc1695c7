//! The built-in player of agents: each one goes for the nearest enemy, a healer for the nearest hurt ally.

use super::{Frame, Interface, Order, Perception};
use crate::action;

/// What the built-in player does with an agent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The order, which needs no available action.
    pub order: Order,
    /// The action that stands for it; the no-op for no order.
    pub action: usize,
}

impl Interface {
    /// Chooses for an agent, dead or alive. `goal` is its target by number in the faction, kept from step to
    /// step while it lives and, for a healer, is hurt. With `rests_on_actions` agents whose target action is
    /// not available move towards the target by the longer axis, otherwise they are sent after it at once.
    pub fn heuristic(
        &self,
        frame: &Frame,
        perception: &Perception,
        agent: usize,
        goal: &mut Option<usize>,
        rests_on_actions: bool,
    ) -> Choice {
        let heals = self.kind(frame, agent).is_healer;
        let is_whole = |unit: usize| heals && frame.health[unit] == self.kind(frame, unit).health;
        let is_over = |target: usize| {
            let unit = self.target(frame, agent, target);
            !frame.is_alive(unit) || is_whole(unit)
        };
        if goal.is_none_or(is_over) {
            *goal = self.nearest_goal(frame, agent, is_over);
        }
        let Some(target) = *goal else { return Choice { order: Order::None, action: action::NO_OP } };
        let unit = self.target(frame, agent, target);
        let is_in_reach = frame.is_alive(agent) && self.is_available(frame, perception, agent, target);
        if !rests_on_actions || is_in_reach {
            return Choice { order: Order::Target(unit), action: self.first_target() + target };
        }
        let [dx, dy] = frame.offset(agent, unit);
        let direction = match dx.abs() > dy.abs() {
            true => 2 + usize::from(dx <= 0.0),
            false => usize::from(dy <= 0.0),
        };
        Choice { order: self.move_to(frame, agent, direction), action: action::NORTH + direction }
    }

    /// The nearest unit that an agent can attack or heal, nearer than the diagonal of the map; of equals the
    /// one with the lower number.
    fn nearest_goal(&self, frame: &Frame, agent: usize, is_over: impl Fn(usize) -> bool) -> Option<usize> {
        let heals = self.kind(frame, agent).is_healer;
        let mut nearest = self.width.hypot(self.height);
        let mut goal = None;
        for target in 0..self.n_targets(frame, agent) {
            let unit = self.target(frame, agent, target);
            let [dx, dy] = frame.offset(agent, unit);
            let distance = (dx * dx + dy * dy).sqrt(); // of the dead, too
            let is_no_goal = is_over(target) || heals && self.kind(frame, unit).is_healer;
            if !is_no_goal && distance < nearest {
                (nearest, goal) = (distance, Some(target));
            }
        }
        goal
    }
}
