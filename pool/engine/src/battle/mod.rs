//! A battle: the units of an arena in one episode after another, stepped by joint actions.
//!
//! Here are steps and episodes: the execution order, and victory, defeat and the time limit. Commands are in
//! `commands`, rewards in `rewards`, what a battle shows is in `outputs`. The rules of a tick are in `tick`,
//! what agents observe is in `encode`, the check of snapshots is in `snapshot`.

mod commands;
mod outputs;
mod perceiver;
mod rewards;

use std::sync::Arc;

use crate::arena::Arena;
use crate::buffers::refill;
use crate::command::{IllegalAction, action};
use crate::encode::{Available, UnitTables};
use crate::level::{self, LevelError};
use crate::neighbour_order::NeighbourOrder;
use crate::opponents::Opponent;
use crate::random::{Generator, StreamPosition};
use crate::rewards::End;
use crate::rules::Rules;
use crate::scratch::Scratch;
use crate::sides::Actor;
use crate::smacv2::Outcome;
use crate::snapshot::{Snapshot, SnapshotError};
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

    /// Begins a new episode, with an opponent that is drawn if there are several. The generator is not reset.
    pub fn reset(&mut self) {
        let opponent = self.arena.opponents().draw(&mut self.generator);
        self.reset_against(opponent);
    }

    /// Begins a new episode against this opponent. Only the units are drawn, if the scenario is generated.
    pub fn reset_against(&mut self, opponent: Opponent) {
        self.start = self.generator.position();
        self.draw_units();
        self.units.reset(&self.arena);
        level::describe(&self.arena, &self.units, &mut self.level);
        self.begin_episode(opponent);
    }

    /// Begins a new episode with a level, see [`LEVEL_COLUMNS`](crate::LEVEL_COLUMNS). An opponent is drawn
    /// if there are several; no units are.
    ///
    /// # Errors
    /// As [`Arena::check_level`]; then the battle is unchanged.
    pub fn reset_to(&mut self, level: &[f32]) -> Result<(), LevelError> {
        self.arena.check_level(level)?;
        self.reset_to_checked(level);
        Ok(())
    }

    /// As [`reset_to`](Self::reset_to) of a level that was [checked](Arena::check_level).
    pub fn reset_to_checked(&mut self, level: &[f32]) {
        debug_assert_eq!(self.arena.check_level(level), Ok(()));
        let opponent = self.arena.opponents().draw(&mut self.generator);
        let mut types = std::mem::take(&mut self.types);
        self.arena.level_types(level, &mut types);
        self.set_types(&types);
        self.types = types;
        self.units.reset(&self.arena);
        self.units.set_level(&self.arena, level);
        refill(&mut self.level, level.iter().copied());
        self.begin_episode(opponent);
    }

    /// Begins an episode with the units as they are.
    fn begin_episode(&mut self, opponent: Opponent) {
        self.opponent = opponent;
        self.neighbour_order.reset(&self.arena, self.arena.type_indices(), &self.units);
        refill(&mut self.last_actions, self.arena.unit_ids().map(|_| None));
        self.episode_length = 0;
        self.episode_return = 0.0;
        self.clear_shares();
        if let (Some(perceiver), Some(interface)) = (&mut self.perceiver, self.arena.interface()) {
            perceiver.begin(interface, &self.arena, &self.units, &mut self.generator);
        }
        self.refresh_derived();
    }

    /// Lets the agents look again, without a step. Only with SMACv2's interface, where not all agents may see
    /// an enemy or with the faults of the published code, it changes what they see.
    pub fn perceive_again(&mut self) {
        if let (Some(perceiver), Some(interface)) = (&mut self.perceiver, self.arena.interface()) {
            perceiver.perceive(interface, &mut self.generator);
        }
    }

    /// Where the generator was when the units of this episode were drawn: with it and the same opponent the
    /// episode begins again. Battles of fixed scenarios draw none, so the generator is there after a reset.
    pub fn start(&self) -> StreamPosition {
        self.start
    }

    /// Draws the units of a generated scenario.
    fn draw_units(&mut self) {
        let Some(drawer) = self.arena.drawer() else { return };
        drawer.draw(&mut || self.generator.next_f64(), &mut self.drawn);
        drawer.place(&mut self.drawn);
        // Memory is taken at the first reset alone, when the arena is still shared with other battles.
        let arena = Arc::make_mut(&mut self.arena);
        arena.set_drawn(self.drawn.allies.iter().chain(&self.drawn.enemies).copied());
        self.tables.set_types(arena);
    }

    /// Lets the units have the types of a snapshot or of a level.
    fn set_types(&mut self, types: &[u32]) {
        if !self.arena.type_indices().eq(types.iter().copied()) {
            let arena = Arc::make_mut(&mut self.arena);
            arena.set_types(types.iter().copied());
            self.tables.set_types(arena);
        }
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
        if self.arena.sides().mirror() {
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

    /// As [`step`](Self::step), with the execution orders of a recording.
    ///
    /// # Errors
    /// As [`check`](Self::check); then the battle is unchanged.
    pub fn step_in_order(
        &mut self,
        actions: &[i32],
        order: ExecutionOrder<'_>,
        scratch: &mut Scratch,
    ) -> Result<Step, IllegalAction> {
        self.step_observed(actions, order, scratch, |_| {})
    }

    /// As [`step_in_order`](Self::step_in_order); `observe` is called with the battle after each tick.
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
        if arena.sides().are_both() {
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
        self.episode_length = self.episode_length.saturating_add(1);
        self.episode_return += reward;
        let terminated = self.is_terminated();
        let truncated = !terminated && self.is_at_limit();
        Step { reward, enemy_reward, terminated, truncated, battle_won }
    }

    /// Finishes a step by SMACv2's rewards and ends.
    fn finish_as(&mut self, outcome: Outcome, enemy_reward: f64) -> Step {
        self.refresh_encoded();
        self.episode_length = self.episode_length.saturating_add(1);
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

    /// Whether the episode is over: terminated or truncated.
    pub fn is_over(&self) -> bool {
        self.is_terminated() || self.is_at_limit()
    }

    /// The state of the battle, from which it continues with the same bits.
    pub fn save(&self) -> Snapshot {
        let mut snapshot = Snapshot::default();
        self.save_into(&mut snapshot);
        snapshot
    }

    /// As [`save`](Self::save), into the memory of another snapshot.
    pub fn save_into(&self, snapshot: &mut Snapshot) {
        refill(&mut snapshot.types, self.arena.type_indices());
        snapshot.units.copy_from(&self.units);
        snapshot.neighbour_order.copy_from(&self.neighbour_order);
        snapshot.last_actions.clone_from(&self.last_actions);
        snapshot.opponent = self.opponent;
        snapshot.generator.clone_from(&self.generator);
        snapshot.episode_length = self.episode_length;
        snapshot.episode_return = self.episode_return;
        refill(&mut snapshot.perception, self.perception_words());
    }

    /// What the agents perceived, as the column of a snapshot; nothing without SMACv2's interface.
    pub(crate) fn perception_words(&self) -> impl Iterator<Item = u64> {
        self.perceiver.iter().flat_map(|perceiver| perceiver.words())
    }

    /// Sets the battle to the state of a snapshot of the same arena.
    ///
    /// # Errors
    /// The first value of the snapshot that this arena does not allow; then the battle is unchanged.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), SnapshotError> {
        snapshot.check(&self.arena)?;
        self.restore_checked(snapshot);
        Ok(())
    }

    /// As [`restore`](Self::restore) of a snapshot that was checked for this arena, as
    /// [`Snapshot::read_record`] does, or is of a battle in it.
    pub fn restore_checked(&mut self, snapshot: &Snapshot) {
        debug_assert_eq!(snapshot.check(&self.arena), Ok(()));
        self.set_types(&snapshot.types);
        self.units.copy_from(&snapshot.units);
        self.neighbour_order.copy_from(&snapshot.neighbour_order);
        self.last_actions.clone_from(&snapshot.last_actions);
        self.opponent = snapshot.opponent;
        self.generator = snapshot.generator.clone();
        self.episode_length = snapshot.episode_length;
        self.episode_return = snapshot.episode_return;
        self.clear_shares();
        level::describe(&self.arena, &self.units, &mut self.level);
        if let (Some(perceiver), Some(interface)) = (&mut self.perceiver, self.arena.interface()) {
            perceiver.load(
                interface,
                &self.arena,
                &self.units,
                &snapshot.perception,
                snapshot.episode_length,
            );
        }
        self.refresh_derived();
    }
}
