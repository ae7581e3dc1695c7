//! A battle: an arena's units in one episode after another, stepped by joint actions.
//!
//! What happens in a tick is in `tick`, what agents see is in `encode`, saving and restoring in `snapshot`.

use std::sync::Arc;

use crate::arena::Arena;
use crate::command::{Command, IllegalAction};
use crate::encode::{self, Available};
use crate::neighbour_order::NeighbourOrder;
use crate::random::Generator;
use crate::scratch::Scratch;
use crate::snapshot::{Snapshot, SnapshotError};
use crate::tick::{self, World};
use crate::units::{AliveIds, Units, refill};
use crate::{TICKS_PER_STEP, WIN_REWARD};

/// One battle. A clone goes on independently, to the same bits.
#[derive(Clone, Debug)]
pub struct Battle {
    arena: Arc<Arena>,
    units: Units,
    living: AliveIds,
    neighbour_order: NeighbourOrder,
    last_actions: Vec<Option<u32>>,
    available: Available,
    generator: Generator,
    episode_length: u32,
    episode_return: f64,
}

/// What came of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The agents' common reward, scaled so that a win without enemy regeneration gives a return of 20.
    pub reward: f64,
    /// A side has nobody left.
    pub terminated: bool,
    /// The episode limit is reached, and neither side is gone.
    pub truncated: bool,
    /// No enemy lives.
    pub battle_won: bool,
}

/// Who acts when in phase 4 of each tick.
#[derive(Clone, Copy, Debug)]
pub enum ExecutionOrder<'a> {
    /// Drawn from the battle's own generator.
    Drawn,
    /// Battle-wide ids in order, tick by tick, as recorded. Who is not in the list does not act; ids of dead
    /// units, or of none, are passed over. The generator is not touched.
    Given(&'a [&'a [u32]; TICKS_PER_STEP]),
}

/// A look at a battle after a tick, for those who compare it with a recording.
#[derive(Clone, Copy, Debug)]
pub struct Tick<'a> {
    /// Which tick of the step, from 0.
    pub index: usize,
    /// Battle-wide ids in the order of phase 4.
    pub order: &'a [u32],
    /// The units after the tick.
    pub units: &'a Units,
    /// The preferred velocity of each unit that was alive when the tick began, by battle-wide id.
    pub preferred: &'a [glam::Vec2],
    /// The reward of the tick, unscaled and without that for winning.
    pub earned: f64,
}

impl Battle {
    /// A battle at the start of its first episode. Its execution orders are those of the published
    /// environment with that seed.
    pub fn new(arena: Arc<Arena>, seed: u64) -> Battle {
        let mut battle = Battle {
            available: Available::new(&arena.sizes()),
            arena,
            units: Units::default(),
            living: AliveIds::default(),
            neighbour_order: NeighbourOrder::default(),
            last_actions: Vec::new(),
            generator: Generator::new(seed),
            episode_length: 0,
            episode_return: 0.0,
        };
        battle.reset();
        battle
    }

    /// The arena it is fought in.
    pub fn arena(&self) -> &Arc<Arena> {
        &self.arena
    }

    /// Seeds the generator anew; the episode goes on as it is.
    pub fn reseed(&mut self, seed: u64) {
        self.generator = Generator::new(seed);
    }

    /// Begins a new episode. The generator goes on where it was.
    pub fn reset(&mut self) {
        self.units.reset(&self.arena);
        self.neighbour_order.reset(&self.arena, &self.units);
        refill(&mut self.last_actions, self.arena.agents.iter().map(|_| None));
        self.episode_length = 0;
        self.episode_return = 0.0;
        self.refresh_derived();
    }

    /// Works out what follows from the units: who lives, and what agents can do.
    fn refresh_derived(&mut self) {
        self.living.gather(&self.arena, &self.units);
        self.available.update(&self.arena, &self.units, &self.living);
    }

    /// Whether [`step`](Self::step) would accept this joint action, one number for each agent.
    ///
    /// # Errors
    /// The first action, by agent, that would be refused.
    pub fn check(&self, actions: &[i32]) -> Result<(), IllegalAction> {
        let sizes = self.arena.sizes();
        if actions.len() != sizes.n_agents {
            return Err(IllegalAction::WrongCount { given: actions.len(), n_agents: sizes.n_agents });
        }
        for (agent, &action) in actions.iter().enumerate() {
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

    /// Plays one step of eight ticks; all are played even if one side is gone before the last.
    ///
    /// An episode that is over can be stepped further as long as its actions are legal; whoever drives the
    /// battle decides when to reset.
    ///
    /// # Errors
    /// As [`check`](Self::check); then nothing was stepped.
    pub fn step(&mut self, actions: &[i32], scratch: &mut Scratch) -> Result<Step, IllegalAction> {
        self.step_observed(actions, ExecutionOrder::Drawn, scratch, |_| {})
    }

    /// As [`step`](Self::step), with the execution orders of a recording.
    ///
    /// # Errors
    /// As [`check`](Self::check); then nothing was stepped.
    pub fn step_in_order(
        &mut self,
        actions: &[i32],
        order: ExecutionOrder<'_>,
        scratch: &mut Scratch,
    ) -> Result<Step, IllegalAction> {
        self.step_observed(actions, order, scratch, |_| {})
    }

    /// As [`step_in_order`](Self::step_in_order), with a look at the battle after each tick.
    ///
    /// # Errors
    /// As [`check`](Self::check); then nothing was stepped.
    pub fn step_observed(
        &mut self,
        actions: &[i32],
        order: ExecutionOrder<'_>,
        scratch: &mut Scratch,
        mut observe: impl FnMut(Tick<'_>),
    ) -> Result<Step, IllegalAction> {
        self.check(actions)?;
        self.give_commands(actions, scratch);
        let mut earned = 0.0;
        for tick in 0..TICKS_PER_STEP {
            self.set_order(order, tick, scratch);
            let world = &mut World {
                arena: &self.arena,
                units: &mut self.units,
                living: &mut self.living,
                neighbour_order: &mut self.neighbour_order,
                plan: &mut scratch.plan,
            };
            let earned_now = tick::run(world);
            earned += earned_now;
            observe(Tick {
                index: tick,
                order: &scratch.plan.order,
                units: &self.units,
                preferred: &scratch.plan.preferred[..self.units.pos.len()],
                earned: earned_now,
            });
        }
        Ok(self.conclude(actions, earned))
    }

    /// Fixes what everyone does for the whole step: the destination of a move is set here, once.
    fn give_commands(&self, actions: &[i32], scratch: &mut Scratch) {
        let arena = &*self.arena;
        let plan = &mut scratch.plan;
        plan.fit(arena);
        refill(&mut plan.commands, arena.unit_ids().map(|_| Command::AttackMove));
        for (&id, &action) in arena.agents.iter().zip(actions) {
            let targets = if arena.stats(id).is_healer { &arena.agents } else { &arena.enemies };
            let position = self.units.pos[id as usize];
            plan.commands[id as usize] = Command::from_action(action as usize, position, targets);
        }
    }

    #[inline(never)] // so that profiles show it
    fn set_order(&mut self, order: ExecutionOrder<'_>, tick: usize, scratch: &mut Scratch) {
        let n_units = self.units.pos.len();
        let into = &mut scratch.plan.order;
        match order {
            ExecutionOrder::Drawn => {
                refill(into, self.living.all.iter().copied());
                self.generator.shuffle(into);
            }
            ExecutionOrder::Given(orders) => {
                refill(into, orders[tick].iter().copied().filter(|&id| (id as usize) < n_units));
            }
        }
    }

    fn conclude(&mut self, actions: &[i32], earned: f64) -> Step {
        self.available.update(&self.arena, &self.units, &self.living);
        refill(&mut self.last_actions, actions.iter().map(|&action| Some(action as u32)));
        let battle_won = self.living.enemies.is_empty();
        let reward = self.arena.scale_reward(if battle_won { earned + WIN_REWARD } else { earned });
        self.episode_length = self.episode_length.saturating_add(1);
        self.episode_return += reward;
        let terminated = self.is_terminated();
        Step { reward, terminated, truncated: !terminated && self.is_at_limit(), battle_won }
    }

    fn is_terminated(&self) -> bool {
        self.living.enemies.is_empty() || self.living.allies.is_empty()
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

    /// Whether an action is available to an agent; false for numbers that are none.
    pub fn is_available(&self, agent: usize, action: usize) -> bool {
        agent < self.arena.agents.len() && self.available.has(agent, action)
    }

    /// Writes what the agents observe: f32 `[n_agents, obs_size]`, all zeros for the dead.
    ///
    /// A row has, with distances divided by the sight range 9 (a unit is seen if nearer) and health and
    /// shield by their maximum: whether the moves north, south, east, west are available; for each enemy:
    /// whether target action of its number is available, distance, dx, dy, health, \[shield\], \[type\]; for
    /// each other ally: 1, distance, dx, dy, health, \[shield\], \[type\]; own health, \[shield\], \[type\].
    /// Unseen blocks are zero.
    ///
    /// # Panics
    /// If `out` has another size.
    pub fn write_obs(&self, out: &mut [f32], scratch: &mut Scratch) {
        encode::write_obs(&self.view(), out, &mut scratch.sights);
    }

    /// Writes the state: f32 `[state_size]`.
    ///
    /// It has for each agent: health, cooldown (energy for healers), x, y from the centre of the map in
    /// shares of its sides, \[shield\], \[type\]; for each enemy the same without cooldown; and for each
    /// agent a one-hot of its last action, all zeros after a reset. Blocks of the dead are zero, but for the
    /// last action.
    ///
    /// # Panics
    /// If `out` has another size.
    pub fn write_state(&self, out: &mut [f32]) {
        encode::write_state(&self.view(), &self.last_actions, out);
    }

    /// Writes which actions are available: 0 or 1, `[n_agents, n_actions]`.
    ///
    /// # Panics
    /// If `out` has another size.
    pub fn write_avail_actions(&self, out: &mut [u8]) {
        self.available.write(out);
    }

    /// Writes which agents live: 0 or 1, `[n_agents]`.
    ///
    /// # Panics
    /// If `out` has another size.
    pub fn write_alive(&self, out: &mut [u8]) {
        assert_eq!(out.len(), self.arena.agents.len(), "one byte an agent");
        for (out, &id) in out.iter_mut().zip(&self.arena.agents) {
            *out = u8::from(self.units.alive[id as usize]);
        }
    }

    fn view(&self) -> encode::View<'_> {
        encode::View { arena: &self.arena, units: &self.units, available: &self.available }
    }

    /// The units as they are now.
    pub fn units(&self) -> &Units {
        &self.units
    }

    /// Agents that died in this episode.
    pub fn dead_allies(&self) -> usize {
        self.arena.agents.len() - self.living.allies.len()
    }

    /// Enemies that died in this episode.
    pub fn dead_enemies(&self) -> usize {
        self.arena.enemies.len() - self.living.enemies.len()
    }

    /// The sum of the rewards of this episode.
    pub fn episode_return(&self) -> f64 {
        self.episode_return
    }

    /// The steps of this episode.
    pub fn episode_length(&self) -> u32 {
        self.episode_length
    }

    /// All that is needed to go on from here, bit for bit.
    pub fn save(&self) -> Snapshot {
        Snapshot {
            units: self.units.clone(),
            neighbour_order: self.neighbour_order.clone(),
            last_actions: self.last_actions.clone(),
            generator: self.generator.clone(),
            episode_length: self.episode_length,
            episode_return: self.episode_return,
        }
    }

    /// Puts the battle where a snapshot of the same arena was taken.
    ///
    /// # Errors
    /// What in the snapshot cannot be of this arena; then nothing was changed.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), SnapshotError> {
        snapshot.check(&self.arena)?;
        self.units.clone_from(&snapshot.units);
        self.neighbour_order.clone_from(&snapshot.neighbour_order);
        self.last_actions.clone_from(&snapshot.last_actions);
        self.generator = snapshot.generator.clone();
        self.episode_length = snapshot.episode_length;
        self.episode_return = snapshot.episode_return;
        self.refresh_derived();
        Ok(())
    }
}
