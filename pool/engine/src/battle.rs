//! A battle: the units of an arena in one episode after another, stepped by joint actions.
//!
//! Here are steps and episodes: commands, the execution order, and victory, defeat and the time limit. The
//! rules of a tick are in `tick`, what agents observe is in `encode`, the check of snapshots is in
//! `snapshot`.

use std::sync::Arc;

use crate::arena::{Arena, Sizes};
use crate::buffers::refill;
use crate::command::{Command, IllegalAction, action};
use crate::distance::{distance_squared, square_within};
use crate::encode::{self, Available, UnitFeatures, UnitTables};
use crate::neighbour_order::NeighbourOrder;
use crate::opponents::Opponent;
use crate::policy::{EnemySituation, Tactic};
use crate::random::Generator;
use crate::scratch::{EnemyScratch, Scratch};
use crate::snapshot::{Snapshot, SnapshotError};
use crate::step::{ExecutionOrder, Step, Tick};
use crate::tick::{self, World};
use crate::units::{AliveIds, Units};
use crate::{SIGHT_RANGE, TICKS_PER_STEP, WIN_REWARD};
use smaclite_scenarios::Faction;

/// One battle. A clone continues independently, with the same bits.
#[derive(Clone, Debug)]
pub struct Battle {
    arena: Arc<Arena>,
    units: Units,
    alive_ids: AliveIds,
    neighbour_order: NeighbourOrder,
    last_actions: Vec<Option<u32>>,
    tables: UnitTables,
    available: Available,
    /// Of the enemies; computed where a scripted policy plays them, before it chooses.
    enemy_available: Available,
    opponent: Opponent,
    generator: Generator,
    episode_length: u32,
    episode_return: f64,
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
            arena,
            units: Units::default(),
            alive_ids: AliveIds::default(),
            neighbour_order: NeighbourOrder::default(),
            last_actions: Vec::new(),
            generator: Generator::new(seed),
            episode_length: 0,
            episode_return: 0.0,
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

    /// Begins a new episode against this opponent; nothing is drawn.
    pub fn reset_against(&mut self, opponent: Opponent) {
        self.opponent = opponent;
        self.units.reset(&self.arena);
        self.neighbour_order.reset(&self.arena, &self.units);
        refill(&mut self.last_actions, self.arena.agents.iter().map(|_| None));
        self.episode_length = 0;
        self.episode_return = 0.0;
        self.refresh_derived();
    }

    /// Computes what follows from the units: which are alive, and what the encoders read.
    fn refresh_derived(&mut self) {
        self.alive_ids.refresh(&self.arena, &self.units);
        self.refresh_encoded();
    }

    /// Computes what the encoders read: the tables of units, and the available actions.
    fn refresh_encoded(&mut self) {
        self.tables.update(&self.arena, &self.units);
        self.available.update(&self.arena, &self.units, &self.tables);
    }

    /// Whether [`step`](Self::step) accepts this joint action, one number per agent.
    ///
    /// # Errors
    /// The illegal action of the agent with the lowest number, or a wrong count of actions.
    pub fn check(&self, actions: &[i32]) -> Result<(), IllegalAction> {
        let sizes = self.arena.sizes();
        if actions.len() != sizes.n_agents {
            return Err(IllegalAction::WrongCount { given: actions.len(), n_agents: sizes.n_agents });
        }
        for (agent, &action) in actions.iter().enumerate() {
            // One look at a bit for a legal action; only for an illegal one is the reason determined.
            match usize::try_from(action) {
                Ok(number) if self.is_available(agent, number) => {}
                Ok(number) if number < sizes.n_actions => {
                    let available = (0..sizes.n_actions).filter(|&a| self.is_available(agent, a)).collect();
                    return Err(IllegalAction::Unavailable { agent, action, available });
                }
                _ => return Err(IllegalAction::OutOfRange { agent, action, n_actions: sizes.n_actions }),
            }
        }
        Ok(())
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
        let mut earned = 0.0;
        for tick in 0..TICKS_PER_STEP {
            self.set_execution_order(order, tick, scratch);
            let world = &mut World {
                arena: &self.arena,
                units: &mut self.units,
                alive_ids: &mut self.alive_ids,
                neighbour_order: &mut self.neighbour_order,
                scratch: &mut scratch.tick,
            };
            // Summed over ticks before it is scaled: scaling each would round differently.
            let earned_now = tick::run(world);
            earned += earned_now;
            observe(Tick {
                index: tick,
                order: &scratch.tick.order,
                units: &self.units,
                preferred: &scratch.tick.preferred[..self.units.pos.len()],
                earned: earned_now,
            });
        }
        self.finish_step(earned)
    }

    /// Stores the action of every agent. Only [`step_checked`](Self::step_checked) may come here with numbers
    /// that are no actions or with a wrong count of actions.
    fn set_last_actions(&mut self, actions: impl Iterator<Item = i32>) {
        let Sizes { n_agents, n_actions, .. } = self.arena.sizes();
        let known = |action: i32| Some(action as u32).filter(|&action| (action as usize) < n_actions);
        let no_op = Some(action::NO_OP as u32);
        let all = actions.map(|action| known(action).or(no_op)).chain(std::iter::repeat(no_op));
        refill(&mut self.last_actions, all.take(n_agents));
    }

    /// Sets the commands of all units for the whole step: the destination of a move is fixed here, once.
    fn give_commands(&mut self, scratch: &mut Scratch) {
        let arena = &*self.arena;
        scratch.tick.prepare(arena);
        for (&id, action) in arena.agents.iter().zip(&self.last_actions) {
            if !self.units.alive[id as usize] {
                continue;
            }
            let action = action.map_or(action::NO_OP, |action| action as usize);
            let position = self.units.pos[id as usize];
            scratch.tick.command(id, Command::from_action(action, position, arena.targets_of(id)));
        }
        match self.opponent {
            Opponent::AttackMove => self.march(scratch, |_| arena.attack_point),
            Opponent::AttackNearest => self.march(scratch, |id| self.nearest_agent(id)),
            Opponent::Scripted(tactic) => self.play_tactic(tactic, scratch),
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

    fn finish_step(&mut self, earned: f64) -> Step {
        self.refresh_encoded();
        // A win is that no enemy is alive, also if the last agent died in the same tick. At the time limit
        // only this counts, not the health that is left: a truncated episode is not won.
        let battle_won = self.alive_ids.enemies.is_empty();
        let reward = self.arena.scale_reward(if battle_won { earned + WIN_REWARD } else { earned });
        self.episode_length = self.episode_length.saturating_add(1);
        self.episode_return += reward;
        let terminated = self.is_terminated();
        Step { reward, terminated, truncated: !terminated && self.is_at_limit(), battle_won }
    }

    fn is_terminated(&self) -> bool {
        self.alive_ids.enemies.is_empty() || self.alive_ids.allies.is_empty()
    }

    fn is_at_limit(&self) -> bool {
        self.arena.episode_limit().is_some_and(|limit| self.episode_length >= limit)
    }

    /// Whether the episode is over: terminated or truncated.
    pub fn is_over(&self) -> bool {
        self.is_terminated() || self.is_at_limit()
    }

    /// The actions available to an agent: bit `a % 64` of word `a / 64` for action `a`.
    ///
    /// # Panics
    /// If there is no such agent.
    pub fn available(&self, agent: usize) -> &[u64] {
        self.available.of(agent)
    }

    /// The actions available to all agents: [`available`](Self::available), agent by agent.
    pub fn available_bits(&self) -> &[u64] {
        self.available.all()
    }

    pub(crate) fn agents_available(&self) -> &Available {
        &self.available
    }

    /// What plays the enemies in this episode.
    pub fn opponent(&self) -> Opponent {
        self.opponent
    }

    /// Whether an action is available to an agent; false if there is no such agent or action.
    pub fn is_available(&self, agent: usize, action: usize) -> bool {
        agent < self.arena.agents.len() && self.available.has(agent, action)
    }

    /// Writes the observations of all agents: f32 `[n_agents, obs_size]`, all zeros for dead agents.
    ///
    /// A row consists of
    /// - whether the moves north, south, east and west are available: 0 or 1;
    /// - for each enemy: whether the target action of its number is available, distance, dx, dy, health,
    ///   \[shield\], \[type\];
    /// - for each other ally: 1, distance, dx, dy, health, \[shield\], \[type\];
    /// - own health, \[shield\], \[type\].
    ///
    /// Distances are divided by the sight range of 9 squares, health and shield by their maximum. Blocks of
    /// units that are dead or not nearer than the sight range are zero.
    ///
    /// `out` may have longer rows, `[n_agents, more than obs_size]`: the rest of each row becomes 0.
    ///
    /// # Panics
    /// If `out` has another size.
    pub fn write_obs(&self, out: &mut [f32], scratch: &mut Scratch) {
        encode::write_obs(&self.view(), out, &mut scratch.obs);
    }

    /// Writes the state: f32 `[state_size]`.
    ///
    /// It consists of
    /// - for each agent: health, cooldown (energy for healers), x, y, \[shield\], \[type\];
    /// - for each enemy: health, x, y, \[shield\], \[type\];
    /// - for each agent: a one-hot of its last action, all zeros after a reset.
    ///
    /// x and y are relative to the centre of the map and divided by its sides, the other values by their
    /// maximum. Blocks of dead units are zero, except for the last action.
    ///
    /// # Panics
    /// If `out` has another size.
    pub fn write_state(&self, out: &mut [f32]) {
        encode::write_state(&self.view(), &self.last_actions, out);
    }

    /// Writes which actions are available: u8 0 or 1, `[n_agents, n_actions]`.
    ///
    /// # Panics
    /// If `out` has another size.
    pub fn write_avail_actions(&self, out: &mut [u8]) {
        self.available.write(out);
    }

    /// Writes which agents are alive: u8 0 or 1, `[n_agents]`.
    ///
    /// # Panics
    /// If `out` has another size.
    pub fn write_alive(&self, out: &mut [u8]) {
        assert_eq!(out.len(), self.arena.agents.len(), "one byte per agent");
        for (out, &id) in out.iter_mut().zip(&self.arena.agents) {
            *out = u8::from(self.units.alive[id as usize]);
        }
    }

    /// The features of a unit as a side sees it, by battle-wide id: those in [the state](Self::write_state),
    /// if that is the side of the agents.
    ///
    /// # Panics
    /// If there is no such unit.
    pub fn unit_features(&self, id: u32, side: Faction) -> UnitFeatures {
        UnitFeatures::of(&self.view(), id, self.arena.is_enemy(id) == (side == Faction::Enemy))
    }

    fn view(&self) -> encode::View<'_> {
        encode::View {
            arena: &self.arena,
            units: &self.units,
            tables: &self.tables,
            available: &self.available,
        }
    }

    /// The current state of all units.
    pub fn units(&self) -> &Units {
        &self.units
    }

    /// Number of agents that died in this episode.
    pub fn dead_allies(&self) -> usize {
        self.arena.agents.len() - self.alive_ids.allies.len()
    }

    /// Number of enemies that died in this episode.
    pub fn dead_enemies(&self) -> usize {
        self.arena.enemies.len() - self.alive_ids.enemies.len()
    }

    /// The sum of the rewards of this episode.
    pub fn episode_return(&self) -> f64 {
        self.episode_return
    }

    /// Number of steps of this episode.
    pub fn episode_length(&self) -> u32 {
        self.episode_length
    }

    pub(crate) fn neighbour_order(&self) -> &NeighbourOrder {
        &self.neighbour_order
    }

    /// The last action of each agent; `None` after a reset.
    pub(crate) fn last_actions(&self) -> &[Option<u32>] {
        &self.last_actions
    }

    /// The state of the battle, from which it continues with the same bits.
    pub fn save(&self) -> Snapshot {
        let mut snapshot = Snapshot::default();
        self.save_into(&mut snapshot);
        snapshot
    }

    /// As [`save`](Self::save), into the memory of another snapshot.
    pub fn save_into(&self, snapshot: &mut Snapshot) {
        snapshot.units.copy_from(&self.units);
        snapshot.neighbour_order.copy_from(&self.neighbour_order);
        snapshot.last_actions.clone_from(&self.last_actions);
        snapshot.opponent = self.opponent;
        snapshot.generator.clone_from(&self.generator);
        snapshot.episode_length = self.episode_length;
        snapshot.episode_return = self.episode_return;
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
        self.units.copy_from(&snapshot.units);
        self.neighbour_order.copy_from(&snapshot.neighbour_order);
        self.last_actions.clone_from(&snapshot.last_actions);
        self.opponent = snapshot.opponent;
        self.generator = snapshot.generator.clone();
        self.episode_length = snapshot.episode_length;
        self.episode_return = snapshot.episode_return;
        self.refresh_derived();
    }
}
