//! Rewards and ends.

use super::{Frame, Interface, Perception};
use crate::rewards::{End, Points};

/// The outcome of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// The common reward of all agents.
    pub reward: f64,
    /// The battle is over; in the published code also by the time limit.
    pub terminated: bool,
    /// The episode limit is reached, and the battle is not over.
    pub at_limit: bool,
    /// The agents have won.
    pub battle_won: bool,
}

impl Interface {
    /// Ends a step with the units as they are now: rewards, ends, and forgetting of the dead.
    pub fn settle(&self, frame: &Frame, perception: &mut Perception) -> Outcome {
        let o = &self.options;
        perception.steps = perception.steps.saturating_add(1);
        let end = self.end_of(frame);
        let reward = self.points(frame, perception).reward(&o.rewards, end, perception.max_reward);
        let is_late = self.episode_limit.is_some_and(|limit| perception.steps >= limit);
        let at_limit = end.is_none() && is_late;
        let terminated = end.is_some() || at_limit && o.published;
        perception.has_ended |= end.is_some() || at_limit;
        self.forget_dead(frame, perception);
        self.begin_step(frame, perception);
        Outcome { reward, terminated, at_limit, battle_won: end == Some(End::Won) }
    }

    /// A faction without a living unit, or with healers alone where units can be healers, has lost. The loss
    /// of the agents is looked at first; without a living unit on either side it is a draw.
    pub(crate) fn end(&self, types: &[u32], is_alive: impl Fn(usize) -> bool) -> Option<End> {
        let units = [0..self.n_agents, self.n_agents..self.n_agents + self.n_enemies];
        let living = |side: usize| units[side].clone().filter(|unit| is_alive(*unit));
        let fights = |side| living(side).any(|unit| !self.kinds[types[unit] as usize].is_healer);
        let (allies, enemies) = (living(0).next().is_some(), living(1).next().is_some());
        if !allies && enemies || self.can_heal && !fights(0) {
            Some(End::Lost)
        } else if allies && !enemies || self.can_heal && !fights(1) {
            Some(End::Won)
        } else {
            (!allies && !enemies).then_some(End::Draw)
        }
    }

    /// Whether nobody has won, lost or drawn.
    pub fn is_undecided(&self, frame: &Frame) -> bool {
        self.end_of(frame).is_none()
    }

    pub(crate) fn end_of(&self, frame: &Frame) -> Option<End> {
        self.end(&frame.types, |unit| frame.is_alive(unit))
    }

    /// What the step was worth, and whose deaths were counted.
    fn points(&self, frame: &Frame, perception: &mut Perception) -> Points {
        let o = &self.options.rewards;
        let mut points = Points::default();
        for unit in 0..self.n_agents + self.n_enemies {
            if perception.dead[unit] {
                continue;
            }
            let before = perception.before[unit];
            let is_dead = !frame.is_alive(unit);
            perception.dead[unit] = is_dead;
            let change = if is_dead { before } else { before - frame.health[unit] - frame.shield[unit] };
            if unit < self.n_agents {
                if is_dead {
                    points.deaths -= if o.only_positive { 0.0 } else { o.death_value * o.negative_scale };
                }
                points.lost += change * o.negative_scale;
            } else {
                if is_dead {
                    points.deaths += o.death_value;
                }
                points.damage += change;
            }
        }
        points
    }
}
