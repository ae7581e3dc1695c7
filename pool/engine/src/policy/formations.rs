//! The policies in which units keep places in their team.

use glam::Vec2;

use super::Situation;
use super::choice::{Choice, by_rank, living, middle};
use crate::buffers::refill;
use crate::command::action;

/// How far ahead of the last unit of a line, in squares, others wait.
const LINE_DEPTH: f32 = 1.5;

/// How far beside the opponents a flank goes, in squares, and from which distance on it attacks.
const FLANK_OFFSET: f32 = 6.0;
const FLANK_DISTANCE: f32 = 7.0;

/// How far behind the front, in squares, escorted units stay.
const ESCORT_DISTANCE: f64 = 1.0;

/// Advances in a line that lies across the way to the opponents.
pub(super) fn line(situation: &impl Situation, actions: &mut [i32]) {
    let side = Team::new(situation);
    let progress = |id: u32| (situation.position(id) - side.middle).dot(side.ahead);
    let fighters = living(situation, situation.faction()).filter(|&id| !is_healer(situation, id));
    let rear = fighters.map(progress).fold(f32::INFINITY, f32::min);
    for (agent, action) in actions.iter_mut().enumerate() {
        let choice = Choice::new(situation, agent);
        let from_middle = |other: u32| f64::from(situation.position(other).distance_squared(side.middle));
        let in_reach = choice.targets().filter(|&(_, other)| choice.is_in_reach(other));
        let common = in_reach.min_by(|a, b| from_middle(a.1).total_cmp(&from_middle(b.1)));
        *action = match common {
            _ if choice.is_healer || choice.is_dead() => choice.nearest(),
            Some((target, _)) => choice.target_action(target),
            None if progress(choice.id) > rear + LINE_DEPTH => action::STOP,
            None => choice.advance(),
        } as i32;
    }
}

/// Goes around the opponents in two groups, of the units with even and with odd numbers.
pub(super) fn flank(situation: &impl Situation, actions: &mut [i32]) {
    let side = Team::new(situation);
    for (agent, action) in actions.iter_mut().enumerate() {
        let choice = Choice::new(situation, agent);
        let offset = side.ahead.perp() * if agent % 2 == 0 { FLANK_OFFSET } else { -FLANK_OFFSET };
        *action = match choice.weaker_of_two() {
            _ if choice.is_healer || choice.is_dead() => choice.nearest(),
            Some(target) => target,
            None => match side.opponents {
                Some(there) if choice.position().distance(there) > FLANK_DISTANCE => {
                    // Where a wall is in the way, straight ahead.
                    match choice.approach(there + offset) {
                        action::STOP => choice.advance(),
                        step => step,
                    }
                }
                _ => choice.advance(),
            },
        } as i32;
    }
}

/// Lets the units with the most health and shield go ahead.
pub(super) fn escort(situation: &impl Situation, actions: &mut [i32]) {
    let own = || living(situation, situation.faction()).filter(|&id| !is_healer(situation, id));
    let strength = |id: u32| {
        let stats = situation.arena().stats(id);
        stats.hp + stats.shield
    };
    let most = own().map(strength).fold(0.0, f64::max);
    for (agent, action) in actions.iter_mut().enumerate() {
        let choice = Choice::new(situation, agent);
        let opponent = choice.opponent();
        let is_front = !choice.is_healer && strength(choice.id) >= most;
        // How much nearer to the opponents the front is.
        let lead = opponent.and_then(|opponent| {
            let there = situation.position(opponent);
            let to = |id: u32| f64::from(situation.position(id).distance(there));
            let front = own().filter(|&id| strength(id) >= most).map(to).reduce(f64::min)?;
            Some(to(choice.id) - front)
        });
        let in_place = choice.target(|other| choice.is_in_reach(other));
        *action = match (in_place, lead) {
            _ if choice.is_dead() => action::NO_OP,
            (Some(target), _) => target,
            (None, Some(lead)) if !is_front && lead < 0.0 => {
                let there = opponent.map(|id| situation.position(id));
                there.and_then(|there| choice.leave(there)).unwrap_or(action::STOP)
            }
            (None, Some(lead)) if !is_front && lead < ESCORT_DISTANCE => action::STOP,
            _ => choice.advance(),
        } as i32;
    }
}

/// One attacker per opponent, as far as there are enough opponents.
pub(super) fn spread(situation: &impl Situation, actions: &mut [i32], is_taken: &mut Vec<bool>) {
    let n_opponents = situation.arena().ids(situation.faction().opponent()).len();
    refill(is_taken, (0..n_opponents).map(|_| false));
    for (agent, action) in actions.iter_mut().enumerate() {
        let choice = Choice::new(situation, agent);
        if choice.is_healer || choice.is_dead() {
            *action = choice.nearest() as i32;
            continue;
        }
        let free = choice.targets().filter(|&(i, other)| !is_taken[i] && choice.can_target(other));
        let rank = |other: u32| choice.distance_squared(other);
        let own = free.min_by(|a, b| rank(a.1).total_cmp(&rank(b.1)));
        *action = match own {
            Some((target, _)) => {
                is_taken[target] = true;
                choice.target_action(target)
            }
            None => choice.nearest(),
        } as i32;
    }
}

/// Where the team and its opponents are.
struct Team {
    middle: Vec2,
    /// The middle of the opponents that are seen.
    opponents: Option<Vec2>,
    /// Towards them, or towards the attack point; of length 1, or 0 without either.
    ahead: Vec2,
}

impl Team {
    fn new(situation: &impl Situation) -> Team {
        let faction = situation.faction();
        let own = middle(situation, living(situation, faction)).unwrap_or_default();
        let seen = living(situation, faction.opponent()).filter(|&id| situation.is_seen(id));
        let opponents = middle(situation, seen);
        let to = opponents.or(situation.attack_point()).unwrap_or(own);
        Team { middle: own, opponents, ahead: (to - own).normalize_or_zero() }
    }
}

fn is_healer(situation: &impl Situation, id: u32) -> bool {
    situation.arena().stats(id).is_healer
}

impl<S: Situation> Choice<'_, S> {
    /// Targets the one with less health and shield of the two nearest targets that it can attack.
    fn weaker_of_two(&self) -> Option<usize> {
        let distance = |target: &(usize, u32)| self.distance_squared(target.1);
        let targets = || self.targets().filter(|&(_, other)| self.can_target(other));
        let first = targets().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        let others = targets().filter(|target| *target != first);
        let second = others.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let rank = |target: &(usize, u32)| (self.situation.hit_points(target.1), distance(target));
        let weaker = [Some(first), second].into_iter().flatten().min_by(|a, b| by_rank(rank(a), rank(b)));
        weaker.map(|(target, _)| self.target_action(target))
    }
}
