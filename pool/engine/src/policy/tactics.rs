//! The policies in which every unit decides for itself, or only shares what it attacks.

use super::Situation;
use super::choice::{Choice, by_rank};
use crate::TICK;
use crate::arena::Arena;
use crate::buffers::refill;
use crate::command::{MOVE, action};

/// Targets the nearest opponent that is available as a target, otherwise moves towards the nearest living
/// opponent. Healers without a patient move towards the nearest unit of their side that is not a healer.
///
/// # Panics
/// If `actions` is longer than there are agents.
pub fn nearest(situation: &impl Situation, actions: &mut [i32]) {
    for (agent, action) in actions.iter_mut().enumerate() {
        *action = Choice::new(situation, agent).nearest() as i32;
    }
}

pub(super) fn focus_fire(situation: &impl Situation, actions: &mut [i32], remaining: &mut Vec<f64>) {
    let mut fire = Fire::begin(situation, remaining);
    for (agent, action) in actions.iter_mut().enumerate() {
        *action = Choice::new(situation, agent).focus(&mut fire) as i32;
    }
}

pub(super) fn kite(situation: &impl Situation, actions: &mut [i32], remaining: &mut Vec<f64>) {
    let mut fire = Fire::begin(situation, remaining);
    for (agent, action) in actions.iter_mut().enumerate() {
        let choice = Choice::new(situation, agent);
        *action = choice.retreat().unwrap_or_else(|| choice.focus(&mut fire)) as i32;
    }
}

pub(super) fn hold(situation: &impl Situation, actions: &mut [i32]) {
    for (agent, action) in actions.iter_mut().enumerate() {
        *action = Choice::new(situation, agent).hold() as i32;
    }
}

/// For how many seconds of a step of 0.5 s attackers are counted on to fire. Attacks that all agents aim at a
/// dying opponent are lost, and so are those of agents that count on others which shoot too late. Of the
/// values from 0.25 to 0.6 this one wins most often on the standard maps.
const FIRING_TIME: f64 = 0.4;

/// What will be left of the opponents after the attacks that were chosen so far in this step.
struct Fire<'a> {
    /// Health and shield by in-faction id.
    remaining: &'a mut [f64],
}

impl Fire<'_> {
    fn begin<'a>(situation: &impl Situation, remaining: &'a mut Vec<f64>) -> Fire<'a> {
        let opponents = situation.arena().ids(situation.faction().opponent());
        refill(remaining, opponents.iter().map(|&id| situation.hit_points(id)));
        Fire { remaining }
    }

    fn will_survive(&self, opponent: usize) -> bool {
        self.remaining[opponent] > 0.0
    }

    /// Takes in that a unit attacks an opponent. Armor is ignored: it matters less than the firing time does.
    fn add_attack(&mut self, arena: &Arena, id: u32, opponent: usize) {
        let stats = arena.stats(id);
        let victim = arena.targets_of(id)[opponent];
        let damage = arena.matchup(id, victim).damage * f64::from(stats.attacks);
        self.remaining[opponent] -= damage * FIRING_TIME / stats.cooldown.max(TICK);
    }
}

impl<S: Situation> Choice<'_, S> {
    fn focus(&self, fire: &mut Fire<'_>) -> usize {
        if self.is_healer || self.is_dead() {
            return self.nearest();
        }
        let targets = self.targets().filter(|&(i, opponent)| {
            fire.will_survive(i) && self.can_target(opponent) && self.is_in_reach(opponent)
        });
        let rank = |(i, opponent): (usize, u32)| (fire.remaining[i], self.distance_squared(opponent));
        let weakest = targets.min_by(|&a, &b| by_rank(rank(a), rank(b))).map(|(i, _)| i);
        weakest.map_or_else(
            || self.nearest(),
            |opponent| {
                fire.add_attack(self.situation.arena(), self.id, opponent);
                self.target_action(opponent)
            },
        )
    }

    fn hold(&self) -> usize {
        if self.is_dead() {
            return action::NO_OP;
        }
        // A target action makes a unit walk to a target beyond its attack range, so a unit that holds its
        // position must not choose one.
        self.target(|other| self.is_in_reach(other)).unwrap_or(action::STOP)
    }

    /// The move that leads farthest from the nearest opponent, if it is time to step back.
    fn retreat(&self) -> Option<usize> {
        if self.is_healer || self.is_dead() || self.situation.cooldown(self.id) <= 0.0 {
            return None;
        }
        let (arena, opponent) = (self.situation.arena(), self.goal()?);
        // Stepping back pays only for a unit that outranges its pursuer: it shoots again before it can be
        // hit. The opponent moves too, so the threat begins one step beyond its reach.
        let own_reach = arena.matchup(self.id, opponent).reach_squared;
        let opponent_reach = arena.matchup(opponent, self.id).reach_squared;
        let is_threat = self.distance_squared(opponent).sqrt() <= opponent_reach.sqrt() + MOVE;
        if own_reach <= opponent_reach || !is_threat {
            return None;
        }
        self.leave(self.situation.position(opponent))
    }
}
