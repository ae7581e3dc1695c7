//! What the interface knows: the units at one time, and what a battle has seen so far.

use super::{Interface, ratio};
use crate::buffers::refill;

/// The units at one time, agents first; all columns have equal lengths.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// The type of each unit, as an index into the types of the scenario.
    pub types: Vec<u32>,
    /// Position in squares.
    pub x: Vec<f32>,
    /// Position in squares.
    pub y: Vec<f32>,
    /// Health; 0 of the dead.
    pub health: Vec<f64>,
    /// Shield; 0 of the dead.
    pub shield: Vec<f64>,
    /// The cooldown, or the energy of a healer.
    pub readiness: Vec<f64>,
    /// By living agent and unit: the distance, set by [`Interface::measure`].
    pub distances: Vec<f64>,
    /// By unit: health and shield as shares of their maximum, set by [`Interface::measure`].
    pub shares: Vec<[f32; 2]>,
}

impl Frame {
    /// Whether a unit is alive.
    pub fn is_alive(&self, unit: usize) -> bool {
        self.health[unit] > 0.0
    }

    /// The distances from an agent to the enemies.
    pub(super) fn distances_to_enemies(&self, agent: usize) -> &[f64] {
        let n_units = self.x.len();
        let n_agents = self.distances.len() / n_units;
        &self.distances[agent * n_units..][n_agents..n_units]
    }

    /// The distances from an agent to the agents.
    pub(super) fn distances_to_allies(&self, agent: usize) -> &[f64] {
        let n_units = self.x.len();
        let n_agents = self.distances.len() / n_units;
        &self.distances[agent * n_units..][..n_agents]
    }

    /// The distance from an agent to a unit.
    pub(super) fn distance(&self, agent: usize, unit: usize) -> f64 {
        self.distances[agent * self.x.len() + unit]
    }

    /// The offset from a unit to another.
    pub(super) fn offset(&self, from: usize, to: usize) -> [f64; 2] {
        [f64::from(self.x[to]) - f64::from(self.x[from]), f64::from(self.y[to]) - f64::from(self.y[from])]
    }
}

/// What a battle has seen so far in its episode. A clone is independent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Perception {
    /// By enemy: the agent that saw it first.
    pub first_seer: Vec<Option<u16>>,
    /// By enemy and agent: whether the agent may see the enemy.
    pub flags: Vec<bool>,
    /// By agent: where it looks, a unit vector.
    pub looks: Vec<[f64; 2]>,
    /// By agent: the probability that its attacks succeed.
    pub attack: Vec<f64>,
    /// By agent: the share of its health below which it dies.
    pub health: Vec<f64>,
    /// By agent and enemy: whether health, shield and type are hidden.
    pub mask: Vec<bool>,
    /// By agent and enemy: whether the present observation shows the enemy.
    pub shown: Vec<bool>,
    /// By unit: whether its death was counted.
    pub dead: Vec<bool>,
    /// By unit: health and shield at the start of the step.
    pub before: Vec<f64>,
    /// The unscaled return that is scaled to the greatest return.
    pub max_reward: f64,
    /// An episode of the process has ended.
    pub has_ended: bool,
    /// Steps of the episode.
    pub steps: u32,
}

/// The greatest number below 1. Agents are shown their health as a share of what is above their level, and
/// above a level of 1 there is nothing; a sum of bounds near 1 can round to it.
pub(crate) const GREATEST_LEVEL: f64 = 1.0 - f64::EPSILON / 2.0;

/// What is random.
pub trait Chance {
    /// A uniform number from 0 to less than 1: a capability or a bit of a mask.
    fn share(&mut self) -> f64;
    /// The number that decides whether the attack of an agent succeeds.
    fn attack(&mut self, agent: usize) -> f64;
    /// The number that decides whether an agent may see an enemy that another one has seen first.
    fn flag(&mut self, first_seer: usize, enemy: usize, agent: usize) -> f64;
    /// Shuffles the agents into the order in which they observe.
    fn order(&mut self, agents: &mut [u16]);
}

impl Interface {
    /// Computes what follows from the columns of a frame and is read often. Called after every change of
    /// them.
    pub fn measure(&self, frame: &mut Frame) {
        let Frame { types, x, y, health, shield, distances, shares, .. } = frame;
        let n_units = x.len();
        distances.resize(self.n_agents * n_units, 0.0);
        let agents = health.iter().zip(x.iter().zip(&*y));
        for (row, (health, (from_x, from_y))) in distances.chunks_exact_mut(n_units).zip(agents) {
            // The dead see nothing.
            if *health <= 0.0 {
                continue;
            }
            let (from_x, from_y) = (f64::from(*from_x), f64::from(*from_y));
            // The squares of differences of f32 are exact or nearly so: the root is that of the exact sum, to
            // less than what the rounding to f32 or a comparison with a range can show.
            for (distance, (to_x, to_y)) in row.iter_mut().zip(x.iter().zip(&*y)) {
                let (dx, dy) = (f64::from(*to_x) - from_x, f64::from(*to_y) - from_y);
                *distance = (dx * dx + dy * dy).sqrt();
            }
        }
        let of_unit = types.iter().zip(health.iter().zip(&*shield));
        refill(
            shares,
            of_unit.map(|(unit_type, (health, shield))| {
                let kind = &self.kinds[*unit_type as usize];
                [ratio(*health, kind.health) as f32, ratio(*shield, kind.shield) as f32]
            }),
        );
    }

    /// Begins an episode with these units: draws capabilities, and forgets what was seen.
    pub fn reset(&self, frame: &Frame, perception: &mut Perception, chance: &mut impl Chance) {
        let (n_agents, n_enemies) = (self.n_agents, self.n_enemies);
        let Perception { attack, health, mask, .. } = perception;
        let within = |low: f64, high: f64, share: f64| low + (high - low) * share;
        attack.clear();
        health.clear();
        mask.clear();
        if let Some(bounds) = self.options.attack {
            attack.extend(
                (0..n_agents).map(|_| within(bounds.lower_bound, bounds.upper_bound, chance.share())),
            );
        }
        if let Some(bounds) = self.options.health {
            let level = |_| within(bounds.lower_bound, bounds.upper_bound, chance.share());
            health.extend((0..n_agents).map(level).map(|level| level.min(GREATEST_LEVEL)));
        }
        if let Some(options) = self.options.enemy_mask {
            mask.extend((0..n_agents * n_enemies).map(|_| chance.share() >= options.mask_probability));
        }
        self.forget(frame, perception);
        let worth = |unit: usize| self.kind(frame, unit).health + self.kind(frame, unit).shield;
        let worth = (n_agents..n_agents + n_enemies).map(worth).sum();
        self.add_max_reward(worth, perception);
    }

    /// Begins an episode with the capabilities as they are.
    pub fn forget(&self, frame: &Frame, perception: &mut Perception) {
        let (n_agents, n_enemies) = (self.n_agents, self.n_enemies);
        refill(&mut perception.first_seer, (0..n_enemies).map(|_| None));
        refill(&mut perception.flags, (0..n_enemies * n_agents).map(|_| false));
        refill(&mut perception.shown, (0..n_enemies * n_agents).map(|_| false));
        refill(&mut perception.looks, (0..n_agents).map(|_| [1.0, 0.0]));
        // Who is not in the battle has died before it.
        refill(&mut perception.dead, (0..n_agents + n_enemies).map(|unit| !frame.is_alive(unit)));
        perception.steps = 0;
        self.begin_step(frame, perception);
    }

    /// Adds what the enemies of a reset are worth to the greatest return.
    pub fn add_max_reward(&self, worth: f64, perception: &mut Perception) {
        let o = &self.options;
        if !o.published {
            perception.max_reward = 0.0;
        }
        if perception.max_reward == 0.0 {
            perception.max_reward = o.rewards.greatest_return(self.n_enemies, 0.0);
        }
        if !perception.has_ended || !o.published {
            perception.max_reward += worth;
        }
    }

    /// Notes health and shields at the start of a step.
    pub fn begin_step(&self, frame: &Frame, perception: &mut Perception) {
        refill(&mut perception.before, frame.health.iter().zip(&frame.shield).map(|(h, s)| h + s));
    }

    /// Finds out what the agents see: once for each observation. The published code looks in an order that it
    /// shuffles each time; who sees an enemy first matters only where not all agents may see it.
    #[inline(never)]
    pub fn perceive(&self, frame: &Frame, perception: &mut Perception, chance: &mut impl Chance) {
        let o = &self.options;
        let mut order = [0; smaclite_scenarios::MAX_UNITS as usize];
        let order = &mut order[..self.n_agents];
        order.iter_mut().zip(0..).for_each(|(place, agent)| *place = agent);
        // Else whoever sees an enemy may see it.
        let draws = o.published || o.prob_obs_enemy < 1.0;
        if draws {
            chance.order(order);
        }
        perception.shown.fill(false);
        if !o.obs_starcraft {
            return;
        }
        if !draws {
            return self.show_all_seen(frame, perception);
        }
        for &agent in order.iter().filter(|agent| frame.is_alive(usize::from(**agent))) {
            (0..self.n_enemies).for_each(|enemy| self.look_at(agent, enemy, frame, perception, chance));
        }
    }

    fn show_all_seen(&self, frame: &Frame, perception: &mut Perception) {
        let Perception { shown, looks, .. } = perception;
        let health = &frame.health[self.n_agents..];
        for (agent, row) in shown.chunks_exact_mut(self.n_enemies).enumerate() {
            if !frame.is_alive(agent) {
                continue;
            }
            let (sight, distances) = (self.kind(frame, agent).sight, frame.distances_to_enemies(agent));
            let seen = distances.iter().zip(health);
            match self.n_looks {
                0 => row.iter_mut().zip(seen).for_each(|(shown, (distance, health))| {
                    *shown = (*distance < sight || self.options.fully_observable) && *health > 0.0;
                }),
                _ => row.iter_mut().zip(seen).enumerate().for_each(|(enemy, (shown, (distance, health)))| {
                    let is_near = *distance <= sight
                        && self.is_in_cone(frame, looks[agent], agent, self.n_agents + enemy);
                    *shown = (is_near || self.options.fully_observable) && *health > 0.0;
                }),
            }
        }
    }

    fn look_at(
        &self,
        agent: u16,
        enemy: usize,
        frame: &Frame,
        perception: &mut Perception,
        chance: &mut impl Chance,
    ) {
        let (o, unit, n_agents) = (&self.options, self.n_agents + enemy, self.n_agents);
        if !o.published && !frame.is_alive(unit) {
            return;
        }
        let seen = self.sees(frame, perception, agent.into(), unit);
        let Perception { first_seer, flags, shown, .. } = perception;
        let flags = &mut flags[enemy * n_agents..][..n_agents];
        if seen && first_seer[enemy].is_none() {
            first_seer[enemy] = Some(agent);
            for (other, flag) in flags.iter_mut().enumerate() {
                let is_seer = other == usize::from(agent);
                *flag |= is_seer || chance.flag(agent.into(), enemy, other) < o.prob_obs_enemy;
            }
        }
        let flag = flags[usize::from(agent)];
        let row = &mut shown[usize::from(agent) * self.n_enemies..][..self.n_enemies];
        row[enemy] = frame.is_alive(unit) && (seen && flag || o.fully_observable);
        if o.published && !flag {
            row[..=enemy].fill(false);
        }
    }

    /// Forgets who saw units that have died. Called at the end of a step.
    pub(super) fn forget_dead(&self, frame: &Frame, perception: &mut Perception) {
        let n_agents = self.n_agents;
        let Perception { first_seer, flags, .. } = perception;
        for agent in (0..n_agents).filter(|agent| !frame.is_alive(*agent)) {
            for enemy in 0..self.n_enemies {
                if first_seer[enemy] == Some(agent as u16) {
                    first_seer[enemy] = None;
                    flags[enemy * n_agents..][..n_agents].fill(false);
                    flags.iter_mut().skip(agent).step_by(n_agents).for_each(|flag| *flag = false);
                }
            }
        }
        for enemy in (0..self.n_enemies).filter(|enemy| !frame.is_alive(n_agents + enemy)) {
            first_seer[enemy] = None;
            flags[enemy * n_agents..][..n_agents].fill(false);
        }
    }
}
