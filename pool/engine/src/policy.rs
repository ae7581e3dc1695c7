//! Simple players for benches, demos and tests. They see the whole battle, which agents do not.

use crate::Battle;
use crate::command::{DIRECTIONS, action};
use crate::units::distance_squared;
use rand::Rng;

/// Writes an action for every agent: walk to and attack the nearest enemy; a healer heals the most hurt of the allies it
/// can target and walks with the nearest ally otherwise; nobody left to go to means stop. `actions` is `[n_agents]`.
pub fn nearest(battle: &Battle, actions: &mut [i32]) {
    for (agent, slot) in actions.iter_mut().enumerate() {
        *slot = nearest_action(battle, agent) as i32;
    }
}

fn nearest_action(battle: &Battle, agent: usize) -> usize {
    let (arena, units) = (battle.arena(), battle.units());
    let own = arena.agents[agent];
    if !units.alive[own as usize] {
        return action::NO_OP;
    }
    let heals = arena.kind(own).is_healer;
    let others = if heals { &arena.agents } else { &arena.enemies };
    let far = |id: u32| distance_squared(units.pos[own as usize], units.pos[id as usize]);
    let targets = (0..others.len()).filter(|i| battle.is_available(agent, action::FIRST_TARGET + i));
    let worth = |i: &usize| if heals { units.hp[others[*i] as usize] } else { far(others[*i]) };
    if let Some(target) = targets.min_by(|a, b| worth(a).total_cmp(&worth(b))) {
        return action::FIRST_TARGET + target;
    }
    let living = others.iter().copied().filter(|id| *id != own && units.alive[*id as usize]);
    let Some(goal) = living.min_by(|a, b| far(*a).total_cmp(&far(*b))) else { return action::STOP };
    let [dx, dy] = (units.pos[goal as usize] - units.pos[own as usize]).to_array().map(f64::from);
    let gain = |direction: usize| DIRECTIONS[direction][0] * dx + DIRECTIONS[direction][1] * dy;
    let moves = (0..4).filter(|d| battle.is_available(agent, action::NORTH + d));
    moves.max_by(|a, b| gain(*a).total_cmp(&gain(*b))).map_or(action::STOP, |d| action::NORTH + d)
}

/// Writes a uniformly random legal action for every agent. `actions` is `[n_agents]`.
pub fn random(battle: &Battle, generator: &mut impl Rng, actions: &mut [i32]) {
    for (agent, slot) in actions.iter_mut().enumerate() {
        let legal = || (0..battle.arena().sizes().n_actions).filter(|a| battle.is_available(agent, *a));
        let draw = u64::from(generator.next_u32()) * legal().count() as u64;
        let nth = (draw >> 32) as usize; // equally likely to 2^-32
        *slot = legal().nth(nth).unwrap_or(action::NO_OP) as i32;
    }
}
