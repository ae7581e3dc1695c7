//! The policies that follow fixed tactics. All of them let healers heal the available ally with the smallest
//! share of its health, and differ in how the other agents move and choose their targets.

use std::cmp::Ordering;

use glam::Vec2;

use super::Situation;
use crate::TICK;
use crate::arena::Arena;
use crate::command::{DIRECTIONS, MOVE, action};
use crate::distance::distance_squared;

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

/// Kills one enemy after the other: an agent targets the enemy within its attack range that will have the
/// least health and shield left after the attacks of the agents before it, and at equality the nearest one.
/// Enemies that those attacks will kill are left out. Agents without such a target play [`nearest`].
///
/// # Panics
/// If `actions` is longer than there are agents.
pub fn focus_fire(situation: &impl Situation, actions: &mut [i32]) {
    let mut fire = Fire::new(situation);
    for (agent, action) in actions.iter_mut().enumerate() {
        *action = Choice::new(situation, agent).focus(&mut fire) as i32;
    }
}

/// Plays [`focus_fire`], but an agent with a longer attack range than its nearest enemy steps away from that
/// enemy while its own cooldown lasts and the enemy could attack it after its next step.
///
/// # Panics
/// If `actions` is longer than there are agents.
pub fn kite(situation: &impl Situation, actions: &mut [i32]) {
    let mut fire = Fire::new(situation);
    for (agent, action) in actions.iter_mut().enumerate() {
        let choice = Choice::new(situation, agent);
        *action = choice.retreat().unwrap_or_else(|| choice.focus(&mut fire)) as i32;
    }
}

/// Waits for the enemies: targets the nearest enemy within attack range, otherwise stops. Healers heal
/// allies in reach and do not move either.
///
/// # Panics
/// If `actions` is longer than there are agents.
pub fn hold(situation: &impl Situation, actions: &mut [i32]) {
    for (agent, action) in actions.iter_mut().enumerate() {
        *action = Choice::new(situation, agent).hold() as i32;
    }
}

/// For how many seconds of a step of 0.5 s attackers are counted on to fire. Attacks that all agents aim at a
/// dying enemy are lost, and so are those of agents that count on others which shoot too late. Of the values
/// from 0.25 to 0.6 this one wins most often on the standard maps.
const FIRING_TIME: f64 = 0.4;

/// What will be left of the enemies after the attacks that were chosen so far in this step.
struct Fire {
    /// Health and shield by in-faction id.
    remaining: Vec<f64>,
}

impl Fire {
    fn new(situation: &impl Situation) -> Fire {
        let enemies = situation.arena().enemies.iter();
        Fire { remaining: enemies.map(|&id| situation.hit_points(id)).collect() }
    }

    fn will_survive(&self, enemy: usize) -> bool {
        self.remaining[enemy] > 0.0
    }

    /// Takes in that an agent attacks an enemy. Armor is ignored: it matters less than the firing time does.
    fn add_attack(&mut self, arena: &Arena, id: u32, enemy: usize) {
        let stats = arena.stats(id);
        let damage = arena.matchup(id, arena.enemies[enemy]).damage * f64::from(stats.attacks);
        self.remaining[enemy] -= damage * FIRING_TIME / stats.cooldown.max(TICK);
    }
}

/// The order of two ranks; the smaller one comes first.
fn by_rank(a: (f64, f64), b: (f64, f64)) -> Ordering {
    a.partial_cmp(&b).unwrap_or(Ordering::Equal)
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

    fn focus(&self, fire: &mut Fire) -> usize {
        if self.is_healer || self.is_available(action::NO_OP) {
            return self.nearest();
        }
        let arena = self.situation.arena();
        let targets = self.targets().filter(|&(i, enemy)| {
            fire.will_survive(i) && arena.can_attack(self.id, enemy) && self.is_in_reach(enemy)
        });
        let rank = |(i, enemy): (usize, u32)| (fire.remaining[i], self.distance_squared(enemy));
        let weakest = targets.min_by(|&a, &b| by_rank(rank(a), rank(b))).map(|(i, _)| i);
        weakest.map_or_else(
            || self.nearest(),
            |enemy| {
                fire.add_attack(arena, self.id, enemy);
                action::FIRST_TARGET + enemy
            },
        )
    }

    fn hold(&self) -> usize {
        if self.is_available(action::NO_OP) {
            return action::NO_OP;
        }
        // A target action makes a unit walk to a target beyond its attack range, so a unit that holds its
        // position must not choose one.
        self.target(|other| self.is_in_reach(other)).unwrap_or(action::STOP)
    }

    /// Whether a unit is within attack range.
    fn is_in_reach(&self, other: u32) -> bool {
        self.distance_squared(other) <= self.situation.arena().matchup(self.id, other).reach_squared
    }

    /// The available targets: index among the others, and battle-wide id.
    fn targets(&self) -> impl Iterator<Item = (usize, u32)> {
        let targets = self.others.iter().copied().enumerate();
        targets.filter(|&(i, _)| self.is_available(action::FIRST_TARGET + i))
    }

    /// The available target that comes first: for healers the one with the smallest share of health, then the
    /// nearest.
    fn target(&self, is_candidate: impl Fn(u32) -> bool) -> Option<usize> {
        // The first of equal ranks wins, so decisions do not depend on the order of a search.
        let rank = |other: u32| {
            let share = if self.is_healer { self.situation.health_share(other) } else { 0.0 };
            (share, self.distance_squared(other))
        };
        let candidates = self.targets().filter(|&(_, other)| is_candidate(other));
        let best = candidates.min_by(|a, b| by_rank(rank(a.1), rank(b.1)));
        best.map(|(i, _)| action::FIRST_TARGET + i)
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
        if self.is_healer || self.is_available(action::NO_OP) || self.situation.cooldown(self.id) <= 0.0 {
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
