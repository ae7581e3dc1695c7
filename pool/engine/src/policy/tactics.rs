//! The policies that follow fixed tactics. All of them let healers heal the available ally with the smallest
//! share of its health, and differ in how the other agents move and choose their targets.

use std::cmp::Ordering;

use glam::Vec2;

use super::Situation;
use crate::command::{DIRECTIONS, MOVE, action};
use crate::units::distance_squared;

/// Targets the nearest enemy that is available as a target, otherwise moves towards the nearest living enemy.
/// Healers without a patient move towards the nearest ally that is not a healer.
///
/// # Panics
/// If `actions` is longer than there are agents.
pub fn nearest(situation: &impl Situation, actions: &mut [i32]) {
    for (agent, action) in actions.iter_mut().enumerate() {
        *action = Choice::new(situation, agent).nearest() as i32;
    }
}

/// All agents that can target the weakest enemy target it: of the enemies that any agent can target, the one
/// with the least health and shield. The others play [`nearest`].
///
/// # Panics
/// If `actions` is longer than there are agents.
pub fn focus_fire(situation: &impl Situation, actions: &mut [i32]) {
    let weakest = weakest_target(situation, actions.len());
    for (agent, action) in actions.iter_mut().enumerate() {
        *action = Choice::new(situation, agent).focus(weakest) as i32;
    }
}

/// Plays [`focus_fire`], but an agent with a longer attack range than its nearest enemy steps away from that
/// enemy while its own cooldown lasts and the enemy could attack it after its next step.
///
/// # Panics
/// If `actions` is longer than there are agents.
pub fn kite(situation: &impl Situation, actions: &mut [i32]) {
    let weakest = weakest_target(situation, actions.len());
    for (agent, action) in actions.iter_mut().enumerate() {
        let choice = Choice::new(situation, agent);
        *action = choice.retreat().unwrap_or_else(|| choice.focus(weakest)) as i32;
    }
}

/// Waits for the enemies: targets the nearest enemy within attack range, otherwise stops. Healers heal whom
/// they can reach and do not move either.
///
/// # Panics
/// If `actions` is longer than there are agents.
pub fn hold(situation: &impl Situation, actions: &mut [i32]) {
    for (agent, action) in actions.iter_mut().enumerate() {
        *action = Choice::new(situation, agent).hold() as i32;
    }
}

/// Index among the enemies of the weakest one that any agent can target.
fn weakest_target(situation: &impl Situation, n_agents: usize) -> Option<usize> {
    let arena = situation.arena();
    // Healers have allies as targets, whose numbers must not count as enemies.
    let attackers = || (0..n_agents).filter(|&agent| !arena.stats(arena.agents[agent]).is_healer);
    let is_target =
        |i: usize| attackers().any(|agent| situation.is_available(agent, action::FIRST_TARGET + i));
    let enemies = arena.enemies.iter().enumerate().filter(|&(i, _)| is_target(i));
    let points = |id: u32| situation.hit_points(id);
    enemies.min_by(|a, b| points(*a.1).total_cmp(&points(*b.1))).map(|(i, _)| i)
}

/// The decision of one agent.
struct Choice<'a, S> {
    situation: &'a S,
    agent: usize,
    id: u32,
    is_healer: bool,
    /// The units that the agent's target actions name, in their order.
    others: &'a [u32],
}

impl<'a, S: Situation> Choice<'a, S> {
    fn new(situation: &'a S, agent: usize) -> Self {
        let arena = situation.arena();
        let id = arena.agents[agent];
        let is_healer = arena.stats(id).is_healer;
        let others = if is_healer { &arena.agents } else { &arena.enemies };
        Choice { situation, agent, id, is_healer, others }
    }

    fn is_available(&self, action: usize) -> bool {
        self.situation.is_available(self.agent, action)
    }

    fn distance_squared(&self, other: u32) -> f64 {
        distance_squared(self.situation.position(self.id), self.situation.position(other))
    }

    fn nearest(&self) -> usize {
        if self.is_available(action::NO_OP) {
            return action::NO_OP; // a dead agent
        }
        self.target(|_| true).or_else(|| self.goal().map(|goal| self.approach(goal))).unwrap_or(action::STOP)
    }

    fn focus(&self, weakest: Option<usize>) -> usize {
        let focus = weakest.map(|enemy| action::FIRST_TARGET + enemy);
        focus.filter(|&action| !self.is_healer && self.is_available(action)).unwrap_or_else(|| self.nearest())
    }

    fn hold(&self) -> usize {
        if self.is_available(action::NO_OP) {
            return action::NO_OP;
        }
        // A target action makes a unit walk to a target beyond its attack range, so a unit that holds its
        // position must not choose one.
        let in_reach = |other: u32| {
            let reach_squared = self.situation.arena().matchup(self.id, other).reach_squared;
            self.distance_squared(other) <= reach_squared
        };
        self.target(in_reach).unwrap_or(action::STOP)
    }

    /// The available target that comes first: for healers the one with the smallest share of health, then the
    /// nearest.
    fn target(&self, is_candidate: impl Fn(u32) -> bool) -> Option<usize> {
        // The first of equal ranks wins, so decisions do not depend on the order of a search.
        let rank = |other: u32| {
            let share = if self.is_healer { self.situation.health_share(other) } else { 0.0 };
            (share, self.distance_squared(other))
        };
        let by_rank = |&a: &(usize, u32), &b: &(usize, u32)| {
            rank(a.1).partial_cmp(&rank(b.1)).unwrap_or(Ordering::Equal)
        };
        let targets = self.others.iter().copied().enumerate();
        let available = targets.filter(|&(i, _)| self.is_available(action::FIRST_TARGET + i));
        let candidates = available.filter(|&(_, other)| is_candidate(other));
        candidates.min_by(by_rank).map(|(i, _)| action::FIRST_TARGET + i)
    }

    /// The unit to walk to: the nearest living enemy; for healers the nearest ally that is not a healer.
    fn goal(&self) -> Option<u32> {
        let arena = self.situation.arena();
        // Healers cannot heal each other. If they followed each other, they would stay behind the team.
        let is_goal = |other: u32| {
            self.situation.is_alive(other)
                && other != self.id
                && !(self.is_healer && arena.stats(other).is_healer)
        };
        let goals = self.others.iter().copied().filter(|&other| is_goal(other));
        goals.min_by(|&a, &b| self.distance_squared(a).total_cmp(&self.distance_squared(b)))
    }

    /// The available move that leads nearest to a unit; stop if none leads nearer.
    fn approach(&self, goal: u32) -> usize {
        let goal = self.situation.position(goal);
        let here = distance_squared(self.situation.position(self.id), goal);
        // Only the direction matters here, so a step of one square does for the comparison.
        let steps = self.moves(1.0).map(|(action, end)| (action, distance_squared(end, goal)));
        let nearer = steps.filter(|step| step.1 < here);
        nearer.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(action::STOP, |step| step.0)
    }

    /// The available move that leads farthest from the nearest enemy, if it is time to step back.
    fn retreat(&self) -> Option<usize> {
        let arena = self.situation.arena();
        if self.is_healer || self.is_available(action::NO_OP) || self.situation.is_ready(self.id) {
            return None;
        }
        let enemy = self.goal()?;
        // Stepping back pays only for a unit that outranges its pursuer: it shoots again before it can be
        // hit. The enemy moves too, so the threat begins one step beyond its reach.
        let own_reach = arena.matchup(self.id, enemy).reach_squared;
        let enemy_reach = arena.matchup(enemy, self.id).reach_squared;
        let is_threat = self.distance_squared(enemy).sqrt() <= enemy_reach.sqrt() + MOVE;
        if own_reach <= enemy_reach || !is_threat {
            return None;
        }
        let enemy = self.situation.position(enemy);
        let here = distance_squared(self.situation.position(self.id), enemy);
        let steps = self.moves(MOVE as f32).map(|(action, end)| (action, distance_squared(end, enemy)));
        let farther = steps.filter(|step| step.1 > here);
        farther.max_by(|a, b| a.1.total_cmp(&b.1)).map(|step| step.0)
    }

    /// The available moves, each with the position after it.
    fn moves(&self, length: f32) -> impl Iterator<Item = (usize, Vec2)> + '_ {
        let position = self.situation.position(self.id);
        let all = (action::NORTH..).zip(DIRECTIONS);
        all.filter(|&(action, _)| self.is_available(action))
            .map(move |(action, step)| (action, position + Vec2::from(step.map(|d| d as f32)) * length))
    }
}
