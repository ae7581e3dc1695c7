//! The visible state of a battle after a tick.

use glam::Vec2;
use smaclite_engine::{Battle, Rules, Units};
use smaclite_scenarios::{Faction, Scenario};
use smaclite_units::{Conduct, Targeter, UnitType};

/// A battle after a tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moment {
    /// Ticks since the start of the episode; 0 is the start.
    pub tick: u32,
    /// Every unit, by battle-wide id; dead units keep their last values.
    pub units: Vec<UnitMoment>,
    /// The attacks and heals of this tick, by attacker.
    pub attacks: Vec<Attack>,
}

/// A unit after a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitMoment {
    /// Its type, as an index into the types of the scenario.
    pub unit_type: usize,
    /// Position in squares; x grows east, y north.
    pub pos: Vec2,
    /// Direction in which the unit faces, in radians counterclockwise from east.
    pub facing: f32,
    /// Health.
    pub hp: f32,
    /// Shield.
    pub shield: f32,
    /// Energy.
    pub energy: f32,
    /// Seconds until the unit can act again.
    pub cooldown: f32,
    /// Whether the unit is in the battle.
    pub alive: bool,
    /// The unit's target, a battle-wide id.
    pub target: Option<u32>,
}

/// An attack or heal, in the tick in which it happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attack {
    /// The attacker or healer.
    pub by: u32,
    /// The unit that it aimed at.
    pub on: u32,
    /// What it was.
    pub kind: AttackKind,
}

/// How an attack looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AttackKind {
    /// A hit on the target.
    Shot {
        /// Ticks until it arrives; 0 if it hits at once.
        flight: u16,
    },
    /// A beam: a rectangle centred on the target, `width` across the line of fire and `height` along it, in
    /// squares.
    Beam {
        /// Across the line of fire.
        width: f32,
        /// Along the line of fire.
        height: f32,
    },
    /// The attacker exploded.
    Explosion {
        /// Radius in squares.
        radius: f32,
    },
    /// The target was healed.
    Heal,
}

const TICKS_PER_SECOND: f64 = 16.0;

/// A unit that moves no faster does not turn, in squares per second.
const SLOW: f32 = 0.25;

/// Makes moments of a battle's ticks. Attacks and facing follow from the change since the tick before.
#[derive(Clone, Debug)]
pub struct Observer {
    attackers: Vec<Attacker>,
    last: Moment,
}

/// What an observer knows of a unit's attack.
#[derive(Clone, Debug)]
struct Attacker {
    targeter: Targeter,
    /// Whether its cooldown is over when its next turn comes, so that the cooldown does not show its attacks.
    acts_every_tick: bool,
    /// The largest distance of centres at which it attacks a point.
    reach: f32,
    radius: f32,
    conduct: Conduct,
    /// The newest target. A unit that is commanded to target a dead one goes on acting on its place, with no
    /// target.
    target: Option<u32>,
    /// Whether an attack had begun before this tick, and not come to its damage point.
    is_winding_up: bool,
}

impl Attacker {
    fn new(unit_type: &UnitType) -> Attacker {
        Attacker {
            targeter: unit_type.targeter,
            acts_every_tick: unit_type.cooldown <= 1.0 / TICKS_PER_SECOND,
            reach: (unit_type.radius() + unit_type.attack_range) as f32,
            radius: unit_type.radius() as f32,
            conduct: unit_type.conduct,
            target: None,
            is_winding_up: false,
        }
    }
}

impl Observer {
    /// Begins with a battle as it is, at the start of an episode.
    ///
    /// # Panics
    /// If the battle is of a scenario with other units.
    pub fn new(scenario: &Scenario, battle: &Battle) -> Observer {
        Observer::with_types(scenario, battle.units(), battle.types().collect())
    }

    /// Begins with these units, of the types that the scenario gives them.
    pub fn of_units(scenario: &Scenario, units: &Units) -> Observer {
        Observer::with_types(scenario, units, scenario.units.iter().map(|unit| unit.unit_type).collect())
    }

    fn with_types(scenario: &Scenario, units: &Units, types: Vec<usize>) -> Observer {
        // Only under `starcraft` have attacks phases.
        let rules = if units.phases.is_empty() { Rules::default() } else { Rules::Starcraft };
        let all = &rules.figures(scenario).unit_types;
        let attackers = types.iter().map(|&unit_type| Attacker::new(&all[unit_type])).collect();
        let opponents = Opponents::new(scenario, units);
        let facing = |id: usize| opponents.seen_from(scenario, units.pos[id], id);
        let start = |(id, &unit_type)| state(units, id, unit_type, facing(id));
        let units = types.iter().enumerate().map(start).collect();
        let last = Moment { tick: 0, units, attacks: Vec::new() };
        Observer { attackers, last }
    }

    /// The newest moment.
    pub fn moment(&self) -> &Moment {
        &self.last
    }

    /// Takes in the units after the next tick.
    pub fn observe(&mut self, units: &Units) -> &Moment {
        for (attacker, target) in self.attackers.iter_mut().zip(&units.target) {
            attacker.target = target.or(attacker.target);
        }
        let attacks = (0..units.pos.len()).filter_map(|id| self.attack(units, id)).collect::<Vec<_>>();
        let mut states: Vec<UnitMoment> = Vec::with_capacity(units.pos.len());
        for (id, last) in self.last.units.iter().enumerate() {
            // A unit faces what it attacks, else where it moves. A unit that stands, or that its neighbours
            // only push about, keeps its direction.
            let aim = attacks.iter().find(|attack| attack.by as usize == id);
            let aim = aim.map(|attack| units.pos[attack.on as usize] - units.pos[id]);
            let moves = Some(units.vel[id]).filter(|vel| vel.length_squared() > SLOW * SLOW);
            let direction = aim.or(moves).filter(|direction| *direction != Vec2::ZERO);
            let facing = direction.map_or(last.facing, Vec2::to_angle);
            states.push(state(units, id, last.unit_type, facing));
        }
        for (attacker, phase) in self.attackers.iter_mut().zip(&units.phases) {
            attacker.is_winding_up = phase.windup > 0.0;
        }
        self.last = Moment { tick: self.last.tick + 1, units: states, attacks };
        &self.last
    }

    /// The attack of a unit in this tick, if it made one: its cooldown began, it came to its damage point, it
    /// spent energy on healing, or it exploded.
    fn attack(&self, units: &Units, id: usize) -> Option<Attack> {
        let (before, attacker) = (&self.last.units[id], &self.attackers[id]);
        let phase = units.phases.get(id);
        // Killed by others, it has perhaps no target.
        let explodes = phase.is_some() && !units.alive[id] && attacker.conduct.explodes_when_killed;
        let on = attacker.target.or(explodes.then_some(id as u32))?;
        let is_reloading = units.cooldown[id] as f32 > before.cooldown;
        let began = match phase {
            // It took effect: an attack that is broken off costs no time.
            Some(phase) => {
                phase.windup == 0.0 && (is_reloading || attacker.is_winding_up && units.cooldown[id] > 0.0)
            }
            None => is_reloading,
        };
        let began = began || attacker.acts_every_tick && self.hits(units, id, on as usize);
        let kind = match attacker.targeter {
            _ if !before.alive => return None,
            Targeter::Standard if began => {
                let fired = phase.filter(|phase| phase.hits > 0 && attacker.conduct.projectile_speed > 0.0);
                let ticks = |seconds: f64| (seconds * TICKS_PER_SECOND).ceil() as u16;
                AttackKind::Shot { flight: fired.map_or(0, |phase| ticks(phase.hit_time)) }
            }
            Targeter::LaserBeam { width, height } if began => {
                AttackKind::Beam { width: width as f32, height: height as f32 }
            }
            // Health that rises for another reason is no heal of a unit without a target.
            Targeter::Heal
                if units.target[id].or(before.target).is_some()
                    && units.hp[on as usize] as f32 > self.last.units[on as usize].hp =>
            {
                AttackKind::Heal
            }
            // A unit that was killed by others has not exploded.
            Targeter::Kamikaze { radius }
                if began || explodes || attacker.acts_every_tick && !units.alive[id] =>
            {
                AttackKind::Explosion { radius: radius as f32 }
            }
            _ => return None,
        };
        Some(Attack { by: id as u32, on, kind })
    }
}

impl Observer {
    /// Whether a unit without a cooldown seems to have hit its target: it could, and the target lost
    /// something.
    fn hits(&self, units: &Units, id: usize, on: usize) -> bool {
        let lost = (units.hp[on] as f32) < self.last.units[on].hp
            || (units.shield[on] as f32) < self.last.units[on].shield;
        // Both have moved since the attack was declared, each by no more than its speed.
        let moved = (units.vel[id].length() + units.vel[on].length()) / TICKS_PER_SECOND as f32;
        let reach = self.attackers[id].reach + self.attackers[on].radius + moved;
        lost && units.pos[id].distance(units.pos[on]) <= reach
    }
}

/// The centres of the factions at the start, where units look for their opponents.
struct Opponents {
    allies: Vec2,
    enemies: Vec2,
}

impl Opponents {
    fn new(scenario: &Scenario, units: &Units) -> Opponents {
        let centre = |faction| {
            let members = scenario.units.iter().zip(&units.pos).filter(|(unit, _)| unit.faction == faction);
            let (sum, count) = members.fold((Vec2::ZERO, 0.0), |(sum, n), (_, pos)| (sum + *pos, n + 1.0));
            sum / f32::max(count, 1.0)
        };
        Opponents { allies: centre(Faction::Ally), enemies: centre(Faction::Enemy) }
    }

    /// The direction from a unit to the centre of the other faction.
    fn seen_from(&self, scenario: &Scenario, pos: Vec2, id: usize) -> f32 {
        match scenario.units[id].faction {
            Faction::Ally => (self.enemies - pos).to_angle(),
            Faction::Enemy => (self.allies - pos).to_angle(),
        }
    }
}

fn state(units: &Units, id: usize, unit_type: usize, facing: f32) -> UnitMoment {
    UnitMoment {
        unit_type,
        pos: units.pos[id],
        facing,
        hp: units.hp[id] as f32,
        shield: units.shield[id] as f32,
        energy: units.energy[id] as f32,
        cooldown: units.cooldown[id] as f32,
        alive: units.alive[id],
        target: units.target[id],
    }
}
