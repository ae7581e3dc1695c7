//! Simple policies: uniformly random actions, and attacking the nearest enemy.
//!
//! They are part of the public interface: users compare learners with them, and benches and tests play with
//! them. [`pick`] is also the sampler of a pool's clients, which draw available actions without a [`Battle`].

use rand::Rng;
use rand_pcg::Pcg64Mcg;

use crate::battle::Battle;
use crate::command::{DIRECTIONS, action};
use crate::units::distance_squared;

/// Plays uniformly random available actions. Equal seeds play equally in equal battles.
#[derive(Clone, Debug)]
pub struct Random {
    generator: Pcg64Mcg,
}

impl Random {
    /// A policy with a separate random stream.
    pub fn new(seed: u64) -> Random {
        use rand::SeedableRng;
        Random { generator: Pcg64Mcg::seed_from_u64(seed) }
    }

    /// Writes an action for each agent.
    ///
    /// # Panics
    /// If `actions` is longer than there are agents.
    pub fn act(&mut self, battle: &Battle, actions: &mut [i32]) {
        for (agent, action) in actions.iter_mut().enumerate() {
            *action = pick(battle.available(agent), self.generator.next_u64()) as i32;
        }
    }
}

/// The position of a random set bit, uniform if the random `word` is; 0 if no bit is set.
///
/// `bits` are those of [`Battle::available`]: bit `i % 64` of element `i / 64` is at position `i`.
pub fn pick(bits: &[u64], word: u64) -> usize {
    let count: u32 = bits.iter().map(|bits| bits.count_ones()).sum();
    // The high bits of word * count are uniform in 0..count, to within count / 2^64.
    let mut skip = ((u128::from(word) * u128::from(count)) >> 64) as u32;
    for (i, &bits) in bits.iter().enumerate() {
        if skip < bits.count_ones() {
            // Clears the lowest bit `skip` times.
            let rest = (0..skip).fold(bits, |bits, _| bits & (bits - 1));
            return i * 64 + rest.trailing_zeros() as usize;
        }
        skip -= bits.count_ones();
    }
    0
}

/// Writes an action for each agent: target the nearest enemy that is available as a target, otherwise move
/// towards the nearest living enemy. Healers target the available ally with the smallest share of its health,
/// otherwise move towards the nearest ally that is not a healer.
///
/// # Panics
/// If `actions` is longer than there are agents.
pub fn nearest(battle: &Battle, actions: &mut [i32]) {
    for (agent, action) in actions.iter_mut().enumerate() {
        *action = choose_nearest(battle, agent) as i32;
    }
}

fn choose_nearest(battle: &Battle, agent: usize) -> usize {
    if battle.is_available(agent, action::NO_OP) {
        return action::NO_OP;
    }
    let arena = battle.arena();
    let id = arena.agents[agent];
    let is_healer = arena.stats(id).is_healer;
    let others = if is_healer { &arena.agents } else { &arena.enemies };
    let units = battle.units();
    let away = |other: u32| distance_squared(units.pos[id as usize], units.pos[other as usize]);
    // The smallest rank is targeted: for healers the smallest share of health, then the nearest.
    let rank = |other: u32| {
        let share = if is_healer { units.hp[other as usize] / arena.stats(other).hp } else { 0.0 };
        (share, away(other))
    };
    let by_rank = |&a: &(usize, u32), &b: &(usize, u32)| {
        rank(a.1).partial_cmp(&rank(b.1)).unwrap_or(std::cmp::Ordering::Equal)
    };
    let candidates = || others.iter().copied().enumerate();
    let targetable = candidates().filter(|&(i, _)| battle.is_available(agent, action::FIRST_TARGET + i));
    if let Some((target, _)) = targetable.min_by(by_rank) {
        return action::FIRST_TARGET + target;
    }
    let is_goal = |other: u32| {
        units.alive[other as usize] && other != id && !(is_healer && arena.stats(other).is_healer)
    };
    match candidates()
        .filter(|&(_, other)| is_goal(other))
        .map(|(_, other)| other)
        .min_by(|&a, &b| away(a).total_cmp(&away(b)))
    {
        Some(goal) => approach(battle, agent, goal),
        None => action::STOP,
    }
}

/// The available move that leads nearest to a unit; stop if none leads nearer.
fn approach(battle: &Battle, agent: usize, goal: u32) -> usize {
    let units = battle.units();
    let position = units.pos[battle.arena().agents[agent] as usize];
    let goal = units.pos[goal as usize];
    let mut best = (action::STOP, distance_squared(position, goal));
    for (direction, action) in DIRECTIONS.into_iter().zip(action::NORTH..) {
        let step = glam::Vec2::from(direction.map(|d| d as f32));
        let away = distance_squared(position + step, goal);
        if away < best.1 && battle.is_available(agent, action) {
            best = (action, away);
        }
    }
    best.0
}
