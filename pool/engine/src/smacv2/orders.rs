//! The orders that actions become, and the kills by health levels.

use std::f64::consts::TAU;

use super::{Chance, FIRST_LOOK, Frame, Interface, Perception, ratio};
use crate::action;
use crate::command::DIRECTIONS;

/// What an action of an agent asks of its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// No order: the unit goes on with what it was ordered before.
    None,
    /// Stand still.
    Stop,
    /// Go to a point.
    MoveTo([f64; 2]),
    /// Attack or heal a unit: agents first, then enemies.
    Target(usize),
}

impl Interface {
    /// The order of an agent's action, which must be available; a look turns the agent at once.
    pub fn order(
        &self,
        frame: &Frame,
        perception: &mut Perception,
        agent: usize,
        action: usize,
        chance: &mut impl Chance,
    ) -> Order {
        match action {
            action::STOP => Order::Stop,
            action::NORTH..FIRST_LOOK => self.move_to(frame, agent, action - action::NORTH),
            action if action < FIRST_LOOK => Order::None,
            action if action < self.first_target() => {
                let angle = TAU * ((action - FIRST_LOOK) as f64 / self.n_looks as f64);
                // With the same bits on all systems.
                perception.looks[agent] = [libm::cos(angle), libm::sin(angle)];
                Order::None
            }
            _ => {
                let target = action - self.first_target();
                // The number is drawn before the range is looked at.
                if let Some(probability) = perception.attack.get(agent)
                    && chance.attack(agent) > *probability
                {
                    return Order::None;
                }
                if target >= self.n_targets(frame, agent) {
                    return Order::None;
                }
                let unit = self.target(frame, agent, target);
                match self.reaches(frame, perception, agent, unit) {
                    true => Order::Target(unit),
                    false => Order::None,
                }
            }
        }
    }

    /// The order to move in a direction, north first.
    pub(super) fn move_to(&self, frame: &Frame, agent: usize, direction: usize) -> Order {
        let ([dx, dy], amount) = (DIRECTIONS[direction], self.options.move_amount);
        let (x, y) = (f64::from(frame.x[agent]), f64::from(frame.y[agent]));
        Order::MoveTo([x + dx * amount, y + dy * amount])
    }

    /// Whether an agent dies because its health is below its level.
    pub fn is_below_level(&self, frame: &Frame, perception: &Perception, agent: usize) -> bool {
        let share = ratio(frame.health[agent], self.kind(frame, agent).health);
        // With sparse rewards deaths are not counted, so the published code kills the dead again and again.
        let is_listed = !perception.dead[agent] || self.options.rewards.sparse && self.options.published;
        is_listed && perception.health.get(agent).is_some_and(|level| share < *level)
    }
}
