//! What a person tells agents, as actions of SMAC: step after step, each agent takes one of its available
//! actions that carries its order out. So a joint action made here is one that a learner could send.

use glam::Vec2;
use serde::{Deserialize, Serialize};
use smaclite_engine::{Battle, TICKS_PER_STEP, action, agent_ranges};
use smaclite_scenarios::{Faction, Scenario};
use std::borrow::Cow;
#[cfg(test)]
use ts_rs::TS;

/// What an agent is told. It holds until it is carried out or another one replaces it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub enum Order {
    /// Nothing: it stands, and attacks the nearest enemy within targeting range; a healer heals.
    #[default]
    None,
    /// Stand, and attack nothing.
    Stop,
    /// Go to a point, in squares.
    Move {
        /// From the west side of the map.
        x: f32,
        /// From its south side.
        y: f32,
    },
    /// Attack or heal a unit; an agent that can do neither goes to where the unit is.
    Target {
        /// Its battle-wide id.
        unit: usize,
    },
}

/// An order for an agent.
#[derive(Clone, Copy, Debug, Deserialize)]
#[cfg_attr(test, derive(TS))]
pub struct AgentOrder {
    /// Its number.
    pub agent: usize,
    /// What it is told.
    pub order: Order,
}

/// Length of a move, in squares.
const MOVE: f32 = 2.0;
const SECONDS_PER_STEP: f32 = TICKS_PER_STEP as f32 / 16.0;

/// Where the four moves lead, in the order of their actions.
const DIRECTIONS: [Vec2; 4] = [Vec2::Y, Vec2::NEG_Y, Vec2::X, Vec2::NEG_X];

/// A unit that came nearer by less than this, in squares, is stopped by others or a wall.
const PROGRESS: f32 = 0.1;
/// Steps without progress after which a unit has arrived as far as it can.
const PATIENCE: u32 = 3;

/// The orders of all agents.
#[derive(Clone, Debug)]
pub struct Orders {
    held: Vec<Held>,
    /// The agents' battle-wide ids, by in-faction id.
    agents: Vec<usize>,
    /// The enemies' likewise.
    enemies: Vec<usize>,
}

/// The order of one agent, and how far it is carried out.
#[derive(Clone, Copy, Debug, Default)]
struct Held {
    order: Order,
    /// Where its target was seen last.
    seen_at: Vec2,
    /// The least distance to the destination so far.
    nearest: Option<f32>,
    /// Steps since then.
    waited: u32,
}

/// Why an order is refused.
#[derive(Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum OrderError {
    #[error("agent must be below {n_agents}, got {agent}")]
    NoSuchAgent { agent: usize, n_agents: usize },
    #[error("unit must be below {n_units}, got {unit}")]
    NoSuchUnit { unit: usize, n_units: usize },
    #[error("a destination must be finite numbers, got {x}, {y}")]
    Destination { x: f32, y: f32 },
}

impl Orders {
    /// No order for any agent of a scenario.
    pub fn new(scenario: &Scenario) -> Orders {
        let ids = |faction| {
            let units = scenario.units.iter().enumerate();
            units.filter(|(_, unit)| unit.faction == faction).map(|(id, _)| id).collect::<Vec<_>>()
        };
        let (agents, enemies) = (ids(Faction::Ally), ids(Faction::Enemy));
        Orders { held: vec![Held::default(); agents.len()], agents, enemies }
    }

    /// The orders that hold, by agent.
    pub fn current(&self) -> Vec<Order> {
        self.held.iter().map(|held| held.order).collect()
    }

    /// Gives agents orders instead of those that they had: all of them or none. The battle is one of the
    /// scenario, before a step.
    ///
    /// # Errors
    /// The first order that cannot be given: there is no such agent or unit, or the destination is no point.
    pub fn give(
        &mut self,
        scenario: &Scenario,
        battle: &Battle,
        orders: &[AgentOrder],
    ) -> Result<(), OrderError> {
        let mut held = self.held.clone();
        let (n_agents, field) = (held.len(), Field::new(scenario, battle, &self.agents, &self.enemies));
        for &AgentOrder { agent, order } in orders {
            let held = held.get_mut(agent).ok_or(OrderError::NoSuchAgent { agent, n_agents })?;
            *held = Held::new(&field, agent, order)?;
        }
        self.held = held;
        Ok(())
    }

    /// The actions of the next step of a battle of the scenario, one per agent. Orders that are carried out
    /// end.
    pub fn actions(&mut self, scenario: &Scenario, battle: &Battle) -> Vec<u16> {
        let field = Field::new(scenario, battle, &self.agents, &self.enemies);
        let actions = self.held.iter_mut().enumerate().map(|(agent, held)| {
            if !field.is_alive(field.agents[agent]) {
                *held = Held::default();
                return action::NO_OP;
            }
            held.action(&field, agent).unwrap_or_else(|| {
                *held = Held::default();
                field.free_action(agent)
            })
        });
        // Legal actions are below the 6 + 360 + 1000 actions of the largest scenario.
        actions.map(|action| action as u16).collect()
    }
}

impl Held {
    /// An order for an agent that nothing is carried out of yet.
    fn new(field: &Field, agent: usize, order: Order) -> Result<Held, OrderError> {
        let (mut order, mut seen_at) = (order, Vec2::ZERO);
        match order {
            Order::Move { x, y } if !(x.is_finite() && y.is_finite()) => {
                return Err(OrderError::Destination { x, y });
            }
            Order::Target { unit } => {
                let positions = &field.battle.units().pos;
                let missing = OrderError::NoSuchUnit { unit, n_units: positions.len() };
                seen_at = *positions.get(unit).ok_or(missing)?;
                if field.target_action(agent, unit).is_none() {
                    order = Order::Move { x: seen_at.x, y: seen_at.y };
                }
            }
            Order::None | Order::Stop | Order::Move { .. } => {}
        }
        Ok(Held { order, seen_at, ..Held::default() })
    }

    /// The action that carries the order out; none if there is nothing left of it.
    fn action(&mut self, field: &Field, agent: usize) -> Option<usize> {
        match self.order {
            Order::None => None,
            Order::Stop => Some(action::STOP),
            Order::Move { x, y } => self.go_on(field, agent, Vec2::new(x, y)),
            Order::Target { unit } => self.pursue(field, agent, unit),
        }
    }

    /// A move towards a point; none if no move brings the agent nearer, or moves have not for some steps.
    fn go_on(&mut self, field: &Field, agent: usize, to: Vec2) -> Option<usize> {
        let distance = field.position(agent).distance(to);
        if self.nearest.is_none_or(|nearest| distance < nearest - PROGRESS) {
            (self.nearest, self.waited) = (Some(distance), 0);
        } else {
            self.waited += 1;
        }
        if self.waited >= PATIENCE { None } else { field.towards(agent, to, self.waited) }
    }

    /// The target action of a unit, or a move towards where it is, or where it was seen last.
    fn pursue(&mut self, field: &Field, agent: usize, unit: usize) -> Option<usize> {
        if !field.is_alive(unit) {
            return None;
        }
        let target = field.target_action(agent, unit)?;
        if field.battle.is_available(agent, target) {
            return Some(target);
        }
        if field.is_seen(unit) {
            let before = std::mem::replace(&mut self.seen_at, field.battle.units().pos[unit]);
            if before.distance(self.seen_at) > PROGRESS {
                self.nearest = None; // of a target that moves away, an agent in full pursuit gets no nearer
            }
            // Before a wall the agent waits until the target moves.
            let action = self.go_on(field, agent, self.seen_at).unwrap_or(action::STOP);
            self.waited %= PATIENCE;
            return Some(action);
        }
        self.go_on(field, agent, self.seen_at)
    }
}

/// A battle before a step.
struct Field<'a> {
    /// With the figures of the battle's rules.
    scenario: Cow<'a, Scenario>,
    battle: &'a Battle,
    /// The type of every unit. An episode of a generated scenario has drawn them.
    types: Vec<usize>,
    agents: &'a [usize],
    enemies: &'a [usize],
}

impl<'a> Field<'a> {
    fn new(
        scenario: &'a Scenario,
        battle: &'a Battle,
        agents: &'a [usize],
        enemies: &'a [usize],
    ) -> Field<'a> {
        let scenario = battle.arena().rules().figures(scenario);
        Field { scenario, battle, types: battle.types().collect(), agents, enemies }
    }

    fn is_alive(&self, unit: usize) -> bool {
        self.battle.units().alive[unit]
    }

    fn position(&self, agent: usize) -> Vec2 {
        self.battle.units().pos[self.agents[agent]]
    }

    fn unit_type(&self, unit: usize) -> &smaclite_units::UnitType {
        &self.scenario.unit_types[self.types[unit]]
    }

    /// The number of the action by which an agent attacks or heals a unit, if it can.
    fn target_action(&self, agent: usize, unit: usize) -> Option<usize> {
        let (own, other) = (self.unit_type(self.agents[agent]), self.unit_type(unit));
        let is_ally = self.scenario.units[unit].faction == Faction::Ally;
        let fits = is_ally == own.is_healer() && !(is_ally && other.is_healer());
        let fits = fits && own.can_attack(other.plane);
        fits.then(|| {
            self.battle.arena().first_target(Faction::Ally) + self.scenario.units[unit].id_in_faction
        })
    }

    /// Whether an agent sees the unit, which is alive.
    fn is_seen(&self, unit: usize) -> bool {
        let at = self.battle.units().pos[unit];
        let mut living = self.agents.iter().filter(|&&id| self.is_alive(id));
        living.any(|&id| {
            let [sight, _] = agent_ranges(self.scenario.smacv2.as_ref(), self.unit_type(id));
            f64::from(self.battle.units().pos[id].distance(at)) < sight
        })
    }

    /// The available move that brings an agent nearest to a point; or, where others stand in its way, the
    /// next one. None if no move brings it nearer. A slow unit goes less than the length of a move in a step.
    fn towards(&self, agent: usize, to: Vec2, waited: u32) -> Option<usize> {
        let at = self.position(agent);
        let speed = self.unit_type(self.agents[agent]).speed as f32;
        let reach = MOVE.min(speed * SECONDS_PER_STEP);
        let moves = DIRECTIONS.iter().enumerate().map(|(i, way)| (action::NORTH + i, at + *way * reach));
        let available = moves.filter(|(number, _)| self.battle.is_available(agent, *number));
        let ends = available.map(|(number, end)| (number, end.distance(to)));
        let mut nearer: Vec<_> = ends.filter(|(_, distance)| *distance < at.distance(to)).collect();
        nearer.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (number, _) = nearer.get(waited as usize).or(nearer.first())?;
        Some(*number)
    }

    /// What an agent without an order does: it attacks the nearest enemy, a healer heals the ally with the
    /// least share of its health.
    fn free_action(&self, agent: usize) -> usize {
        let heals = self.unit_type(self.agents[agent]).is_healer();
        let (at, units) = (self.position(agent), self.battle.units());
        let health = |unit: usize| units.hp[unit] / self.unit_type(unit).hp;
        let urgency = |unit: usize| if heals { health(unit) } else { units.pos[unit].distance(at).into() };
        let others = if heals { self.agents } else { self.enemies };
        let targets = others.iter().filter(|&&unit| !heals || health(unit) < 1.0);
        let actions = targets.filter_map(|&unit| Some((self.target_action(agent, unit)?, urgency(unit))));
        let available = actions.filter(|(number, _)| self.battle.is_available(agent, *number));
        let chosen = available.min_by(|a, b| a.1.total_cmp(&b.1));
        chosen.map_or(action::STOP, |(number, _)| number)
    }
}

#[cfg(test)]
mod tests;
