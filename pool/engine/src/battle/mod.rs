//! A battle: the units of an arena in one episode after another, stepped by joint actions.
//!
//! Here are steps: the execution order, and victory, defeat and the time limit. How an episode begins is in
//! `begin`, commands are in `commands`, rewards in `rewards`, what a battle shows is in `outputs`. The rules
//! of a tick are in `tick`, what agents observe is in `encode`, the check of snapshots is in `snapshot`.

mod begin;
mod commands;
mod outputs;
mod perceiver;
mod rewards;

pub(crate) use commands::begin_march;

use std::sync::Arc;

use crate::arena::Arena;
use crate::buffers::refill;
use crate::command::{IllegalAction, action};
use crate::encode::{Available, UnitTables};
use crate::neighbour_order::NeighbourOrder;
use crate::opponents::Opponent;
use crate::random::{Generator, StreamPosition};
use crate::rewards::End;
use crate::rules::Rules;
use crate::scratch::Scratch;
use crate::sides::Actor;
use crate::smacv2::Outcome;
use crate::step::{ExecutionOrder, Step, Tick};
use crate::tick::{self, Earned, TickScratch, World};
use crate::units::{AliveIds, Units};
use perceiver::Perceiver;

use crate::TICKS_PER_STEP;
use smaclite_scenarios::{DrawnTeams, Faction};

/// One battle. A clone continues independently, with the same bits.
#[derive(Clone, Debug)]
pub struct Battle {
    arena: Arc<Arena>,
    units: Units,
    alive_ids: AliveIds,
    neighbour_order: NeighbourOrder,
    /// Of the agents and of the enemies; those of enemies are `None` if joint actions do not play them.
    last_actions: Vec<Option<u32>>,
    tables: UnitTables,
    available: Available,
    /// Of the enemies, for whom joint actions play both sides; and where a scripted policy plays them, while
    /// it chooses.
    enemy_available: Available,
    opponent: Opponent,
    generator: Generator,
    /// Where the generator was when the units of this episode were drawn.
    start: StreamPosition,
    /// The units that were drawn, in memory that is kept.
    drawn: DrawnTeams,
    /// What agents perceive, where the scenario has SMACv2's interface.
    perceiver: Option<Box<Perceiver>>,
    /// How the episode began, or the state that was restored since.
    level: Vec<f32>,
    /// Working memory: the types of a level's units.
    types: Vec<u32>,
    episode_length: u32,
    episode_return: f64,
    /// The shares of all units in the rewards of the last step, by battle-wide id, if someone wants them.
    shares: Option<Vec<f64>>,
}

impl Battle {
    /// A battle at the start of its first episode. Its execution orders are those of the published
    /// environment with that seed.
    pub fn new(arena: Arc<Arena>, seed: u64) -> Battle {
        let mut battle = Battle {
            tables: UnitTables::new(&arena),
            available: Available::new(&arena, Faction::Ally),
            enemy_available: Available::new(&arena, Faction::Enemy),
            opponent: Opponent::default(),
            perceiver: arena.interface().map(|_| Box::default()),
            arena,
            units: Units::default(),
            alive_ids: AliveIds::default(),
            neighbour_order: NeighbourOrder::default(),
            last_actions: Vec::new(),
            generator: Generator::new(seed),
            start: StreamPosition::default(),
            drawn: DrawnTeams::default(),
            level: Vec::new(),
            types: Vec::new(),
            episode_length: 0,
            episode_return: 0.0,
            shares: None,
        };
        battle.reset();
        battle
    }

    /// The arena.
    pub fn arena(&self) -> &Arc<Arena> {
        &self.arena
    }

    /// Seeds the generator again; the episode continues.
    pub fn reseed(&mut self, seed: u64) {
        self.generator = Generator::new(seed);
    }

    /// Forgets what earlier episodes leave to later ones, which only the published fault of SMACv2's
    /// interface does: the greatest return. A reset should follow.
    pub fn forget_episodes(&mut self) {
        self.perceiver = self.perceiver.take().map(|_| Box::default());
    }

    /// The generator of execution orders.
    pub fn generator(&self) -> &Generator {
        &self.generator
    }

    /// Sets the generator of execution orders; the episode continues.
    pub fn set_generator(&mut self, generator: Generator) {
        self.generator = generator;
    }

    /// Computes what follows from the units: which are alive, and what the encoders read.
    fn refresh_derived(&mut self) {
        self.alive_ids.refresh(&self.arena, &self.units);
        self.refresh_encoded();
    }

    /// Computes what the encoders read: the tables of units, and the available actions.
    fn refresh_encoded(&mut self) {
        self.tables.update(&self.arena, &self.units);
        match (&self.perceiver, self.arena.interface()) {
            (Some(perceiver), Some(interface)) => {
                perceiver.write_available(interface, self.available.all_mut())
            }
            _ => self.available.update(&self.arena, &self.units, &self.tables),
        }
        if self.arena.sides().are_both() {
            self.refresh_enemy_available();
        }
    }

    /// Enemies that a script plays look dead to those who give joint actions.
    fn refresh_enemy_available(&mut self) {
        if self.opponent != Opponent::Learner {
            return self.enemy_available.withdraw();
        }
        self.enemy_available.update(&self.arena, &self.units, &self.tables);
        if self.arena.sides().are_mirrored() {
            self.enemy_available.mirror();
        }
    }

    /// Whether [`step`](Self::step) accepts this joint action: one number per agent, and if joint actions
    /// play [both sides](Arena::sides) then also one per enemy.
    ///
    /// # Errors
    /// The first illegal action, or a wrong count of actions.
    pub fn check(&self, actions: &[i32]) -> Result<(), IllegalAction> {
        let (given, expected) = (actions.len(), self.arena.sizes().n_actors());
        if given != expected {
            let units = if self.arena.sides().are_both() { "agent and enemy" } else { "agent" };
            return Err(IllegalAction::WrongCount { given, expected, units });
        }
        let (agents, enemies) = actions.split_at(self.arena.agents.len());
        self.available.check(agents, Actor::Agent)?;
        self.enemy_available.check(enemies, Actor::Enemy)
    }

    /// Plays one step of eight ticks; all are played even if a faction has no units left before the last.
    ///
    /// An episode that is over can be stepped further with legal actions; the caller decides when to reset.
    ///
    /// # Errors
    /// As [`check`](Self::check); then the battle is unchanged.
    pub fn step(&mut self, actions: &[i32], scratch: &mut Scratch) -> Result<Step, IllegalAction> {
        self.check(actions)?;
        Ok(self.step_checked(actions.iter().copied(), scratch))
    }

    /// As [`step`](Self::step) without the check, for callers that have [checked](Self::check) these actions
    /// against the battle as it is now.
    ///
    /// Actions that `check` refuses are a mistake of the caller; builds with debug assertions panic. Other
    /// builds give them a defined effect, and the battle stays valid:
    /// - A number that is no action, or a missing one, counts as no-op. Surplus numbers are ignored.
    /// - A living agent's no-op is a stop. The actions of dead agents have no effect.
    /// - Any other action is carried out although it is not available: a unit walks to a target out of range,
    ///   stops at a wall, or leaves the map; to target a unit that does not exist is a stop.
    pub fn step_checked(
        &mut self,
        actions: impl Iterator<Item = i32> + Clone,
        scratch: &mut Scratch,
    ) -> Step {
        debug_assert_eq!(self.check(&actions.clone().collect::<Vec<_>>()), Ok(()), "unchecked actions");
        self.set_last_actions(actions);
        self.play(ExecutionOrder::Drawn, scratch, |_| {})
    }

    /// As [`step`](Self::step), with these execution orders, such as those of a recording; `observe` is
    /// called with the battle after each tick.
    ///
    /// # Errors
    /// As [`check`](Self::check); then the battle is unchanged.
    pub fn step_observed(
        &mut self,
        actions: &[i32],
        order: ExecutionOrder<'_>,
        scratch: &mut Scratch,
        observe: impl FnMut(Tick<'_>),
    ) -> Result<Step, IllegalAction> {
        self.check(actions)?;
        self.set_last_actions(actions.iter().copied());
        Ok(self.play(order, scratch, observe))
    }

    /// Plays one step with the last actions.
    fn play(
        &mut self,
        order: ExecutionOrder<'_>,
        scratch: &mut Scratch,
        mut observe: impl FnMut(Tick<'_>),
    ) -> Step {
        self.give_commands(scratch);
        self.prepare_rewards(&mut scratch.tick);
        let mut earned = Earned::default();
        for tick in 0..TICKS_PER_STEP {
            self.kill_below_levels(tick, scratch);
            if self.arena.rules != Rules::Starcraft {
                self.set_execution_order(order, tick, scratch);
            }
            let world = &mut World {
                arena: &self.arena,
                units: &mut self.units,
                alive_ids: &mut self.alive_ids,
                neighbour_order: &mut self.neighbour_order,
                scratch: &mut scratch.tick,
            };
            // Summed over ticks before it is scaled: scaling each would round differently.
            let earned_now = match self.arena.rules {
                Rules::Starcraft => tick::starcraft::run(world, &mut self.generator),
                _ => tick::run(world),
            };
            earned.allies += earned_now.allies;
            earned.enemies += earned_now.enemies;
            observe(Tick {
                index: tick,
                order: &scratch.tick.order,
                units: &self.units,
                preferred: &scratch.tick.preferred[..self.units.pos.len()],
                earned: earned_now.allies,
            });
        }
        self.kill_below_levels(TICKS_PER_STEP, scratch);
        self.finish_step(earned, &scratch.tick)
    }

    /// Removes the agents whose health is below their level, so many ticks before the end of a step as the
    /// options of SMACv2's interface say.
    fn kill_below_levels(&mut self, tick: usize, scratch: &mut Scratch) {
        let (Some(perceiver), Some(interface)) = (&mut self.perceiver, self.arena.interface()) else {
            return;
        };
        let ticks_left = interface.options().kill_unit_step_mul as usize;
        if !perceiver.has_levels() || tick + ticks_left != TICKS_PER_STEP {
            return;
        }
        perceiver.kill_below_levels(interface, &self.arena, &mut self.units);
        tick::remove_all_dead(&mut World {
            arena: &self.arena,
            units: &mut self.units,
            alive_ids: &mut self.alive_ids,
            neighbour_order: &mut self.neighbour_order,
            scratch: &mut scratch.tick,
        });
    }

    /// Stores the actions. Only [`step_checked`](Self::step_checked) may come here with numbers that are no
    /// actions or with a wrong count of actions.
    fn set_last_actions(&mut self, mut actions: impl Iterator<Item = i32>) {
        let arena = &*self.arena;
        let mut set = |last: &mut [Option<u32>], n_actions: usize| {
            let no_op = Some(action::NO_OP as u32);
            for last in last {
                let action = actions.next().map(|action| action as u32);
                *last = action.filter(|&action| (action as usize) < n_actions).or(no_op);
            }
        };
        let (agents, enemies) = self.last_actions.split_at_mut(arena.agents.len());
        set(agents, arena.n_actions(Faction::Ally));
        if arena.sides().are_both() && self.opponent == Opponent::Learner {
            set(enemies, arena.n_actions(Faction::Enemy));
        }
    }

    /// Sets the execution order of a tick: which unit moves and acts first in phase 4.
    #[inline(never)]
    fn set_execution_order(&mut self, order: ExecutionOrder<'_>, tick: usize, scratch: &mut Scratch) {
        let n_units = self.units.pos.len();
        let into = &mut scratch.tick.order;
        match order {
            // Each tick shuffles the ascending ids of the living units; the order of the last tick has no
            // effect.
            ExecutionOrder::Drawn => {
                into.clear();
                into.extend_from_slice(&self.alive_ids.all);
                self.generator.shuffle(into);
            }
            ExecutionOrder::Given(orders) => {
                refill(into, orders[tick].iter().copied().filter(|&id| (id as usize) < n_units));
            }
        }
    }

    fn finish_step(&mut self, earned: Earned, scratch: &TickScratch) -> Step {
        if let (Some(perceiver), Some(interface)) = (&mut self.perceiver, self.arena.interface()) {
            let outcome = perceiver.settle(interface, &self.arena, &self.units, &mut self.generator);
            let greatest = perceiver.perception().max_reward;
            self.share_out(Faction::Ally, outcome.reward, greatest, scratch);
            let enemy_reward = self.reward_of(Faction::Enemy, earned.enemies, scratch);
            return self.finish_as(outcome, enemy_reward);
        }
        self.refresh_encoded();
        // A win is that no enemy is alive, also if the last agent died in the same tick. At the time limit
        // only this counts, not the health that is left: a truncated episode is not won.
        let battle_won = self.is_won_by(Faction::Ally);
        let [reward, enemy_reward] = self.rewards(earned, scratch);
        self.count_step();
        self.episode_return += reward;
        let terminated = self.is_terminated();
        let truncated = !terminated && self.is_at_limit();
        Step { reward, enemy_reward, terminated, truncated, battle_won }
    }

    /// Counts a step, up to the greatest number that batches and snapshots can have.
    fn count_step(&mut self) {
        self.episode_length = u32::min(self.episode_length + 1, i32::MAX as u32);
    }

    /// Finishes a step by SMACv2's rewards and ends.
    fn finish_as(&mut self, outcome: Outcome, enemy_reward: f64) -> Step {
        self.refresh_encoded();
        self.count_step();
        self.episode_return += outcome.reward;
        let Outcome { reward, terminated, at_limit, battle_won } = outcome;
        Step { reward, enemy_reward, terminated, truncated: at_limit && !terminated, battle_won }
    }

    /// Whether all units that a side fights are dead. It is true of both sides if the last ones died in the
    /// same tick. With SMACv2's interface, whether the side has won by its rules.
    pub fn is_won_by(&self, side: Faction) -> bool {
        if let (Some(perceiver), Some(interface)) = (&self.perceiver, self.arena.interface()) {
            let won = if side == Faction::Ally { End::Won } else { End::Lost };
            return interface.end_of(perceiver.frame()) == Some(won);
        }
        match side {
            Faction::Ally => self.alive_ids.enemies.is_empty(),
            Faction::Enemy => self.alive_ids.allies.is_empty(),
        }
    }

    fn is_terminated(&self) -> bool {
        if let (Some(perceiver), Some(interface)) = (&self.perceiver, self.arena.interface()) {
            return interface.end_of(perceiver.frame()).is_some()
                || interface.options().published && self.is_at_limit();
        }
        self.alive_ids.enemies.is_empty() || self.alive_ids.allies.is_empty()
    }

    fn is_at_limit(&self) -> bool {
        self.arena.episode_limit().is_some_and(|limit| self.episode_length >= limit)
    }

    /// Whether the episode is over: terminated or truncated. With SMACv2's interface, one that draws healers
    /// alone ends in its first step, not before.
    pub fn is_over(&self) -> bool {
        let begins = self.episode_length == 0 && self.perceiver.is_some();
        !begins && (self.is_terminated() || self.is_at_limit())
    }
}
