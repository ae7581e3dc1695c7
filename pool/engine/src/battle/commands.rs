//! The commands of all units for a step: those of joint actions, of scripts, and of scripted policies.

use glam::DVec2;
use smaclite_scenarios::{Destination, Faction};

use super::Battle;
use crate::SIGHT_RANGE;
use crate::arena::Arena;
use crate::buffers::refill;
use crate::command::{Command, action};
use crate::distance::{distance_squared, square_within};
use crate::opponents::Opponent;
use crate::policy::{EnemySituation, Tactic};
use crate::random::Generator;
use crate::rules::Rules;
use crate::scratch::{EnemyScratch, Scratch};
use crate::tick::starcraft;
use crate::units::Units;

impl Battle {
    /// Sets the commands of all units for the whole step: the destination of a move is fixed here, once.
    pub(super) fn give_commands(&mut self, scratch: &mut Scratch) {
        scratch.tick.prepare(&self.arena);
        if self.perceiver.is_some() {
            self.play_orders(scratch);
        } else {
            self.play_actions(Faction::Ally, false, scratch);
        }
        if self.arena.rules == Rules::Starcraft && self.opponent.marches() && self.episode_length == 0 {
            begin_march(&self.arena, &mut self.units, &mut self.generator);
        }
        let arena = &*self.arena;
        match self.opponent {
            Opponent::AttackMove if arena.march_to == Some(Destination::Agents) => {
                self.march(scratch, |id| self.nearest_agent(id));
            }
            Opponent::AttackMove if arena.rules == Rules::Starcraft => {
                self.march(scratch, |id| self.units.phases[id as usize].goal.as_dvec2().into());
            }
            Opponent::AttackMove => self.march(scratch, |_| arena.attack_point),
            Opponent::AttackNearest => self.march(scratch, |id| self.nearest_agent(id)),
            Opponent::Scripted(tactic) => self.play_tactic(tactic, scratch),
            Opponent::Learner => {
                self.play_actions(Faction::Enemy, arena.sides().are_mirrored(), scratch);
            }
        }
    }

    /// Lets the units of a faction carry the last actions out.
    #[inline(always)]
    fn play_actions(&self, faction: Faction, mirror: bool, scratch: &mut Scratch) {
        let arena = &*self.arena;
        for (&id, action) in arena.ids(faction).iter().zip(self.last_actions_of(faction)) {
            if !self.units.alive[id as usize] {
                continue;
            }
            let action = action.map_or(action::NO_OP, |action| action as usize);
            let action = if mirror { action::mirrored(action) } else { action };
            let position = self.units.pos[id as usize];
            scratch.tick.command(id, Command::from_action(action, position, arena.targets_of(id)));
        }
    }

    /// Lets the agents carry the last actions out as SMACv2's interface understands them.
    fn play_orders(&mut self, scratch: &mut Scratch) {
        let (arena, generator) = (&*self.arena, &mut self.generator);
        let (Some(perceiver), Some(interface)) = (&mut self.perceiver, arena.interface()) else { return };
        for (agent, &id) in arena.agents.iter().enumerate() {
            if self.units.alive[id as usize] {
                let action = self.last_actions[agent].map_or(action::NO_OP, |action| action as usize);
                scratch.tick.command(id, perceiver.command(interface, arena, agent, action, generator));
            }
        }
    }

    /// Lets all enemies attack-move.
    fn march(&self, scratch: &mut Scratch, destination: impl Fn(u32) -> [f64; 2]) {
        for &id in self.alive_ids.all.iter().filter(|&&id| self.arena.is_enemy(id)) {
            scratch.tick.command(id, Command::AttackMove(destination(id)));
        }
    }

    /// The position of the living agent that is nearest to a unit; of equally near ones that with the lowest
    /// id.
    fn nearest_agent(&self, id: u32) -> [f64; 2] {
        let pos = |id: u32| self.units.pos[id as usize];
        let distance = |agent: &u32| distance_squared(pos(id), pos(*agent));
        let agents = self.alive_ids.allies.iter();
        let nearest = agents.min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)));
        nearest.map_or(self.arena.attack_point, |&agent| pos(agent).as_dvec2().into())
    }

    /// Lets a scripted policy choose the actions of the enemies.
    #[inline(never)]
    fn play_tactic(&mut self, tactic: Tactic, scratch: &mut Scratch) {
        self.enemy_available.update(&self.arena, &self.units, &self.tables);
        let arena = &*self.arena;
        let EnemyScratch { actions, seen, policy } = &mut scratch.enemies;
        let within = square_within(SIGHT_RANGE.next_down());
        let pos = |id: u32| self.units.pos[id as usize];
        let is_seen = |&agent: &u32| {
            let mut eyes = self.alive_ids.enemies.iter();
            eyes.any(|&id| distance_squared(pos(id), pos(agent)) <= within)
        };
        refill(seen, arena.agents.iter().map(is_seen));
        refill(actions, arena.enemies.iter().map(|_| 0));
        let mut generator = self.generator.clone();
        let situation = EnemySituation { battle: self, available: &self.enemy_available, seen };
        tactic.act(&situation, actions, policy, || u64::from(generator.next_word()) << 32);
        for (&id, &action) in arena.enemies.iter().zip(&*actions) {
            if self.units.alive[id as usize] {
                let command = Command::from_action(action as usize, pos(id), arena.targets_of(id));
                scratch.tick.command(id, command);
            }
        }
        self.generator = generator;
    }
}

/// Sets where the enemies march to, in the formation in which they stand: as far from the attack point as
/// they are from the middle of the living ones; and when each of them first looks for targets.
pub(crate) fn begin_march(arena: &Arena, units: &mut Units, generator: &mut Generator) {
    let living = || arena.enemies.iter().map(|&id| id as usize).filter(|&i| units.alive[i]);
    let middle = living().map(|i| units.pos[i].as_dvec2()).sum::<DVec2>() / living().count().max(1) as f64;
    let point = match arena.march_to {
        Some(Destination::Line(ends)) => {
            let [from, to] = ends.map(DVec2::from);
            from.lerp(to, generator.next_share())
        }
        _ => DVec2::from(arena.attack_point),
    };
    let to_point = point - middle;
    for &id in &arena.enemies {
        let goal = (units.pos[id as usize].as_dvec2() + to_point).as_vec2();
        let phase = &mut units.phases[id as usize];
        phase.goal = arena.extent.nearest(goal);
        phase.look = starcraft::first_look(generator);
    }
}
