//! One battle of a person: orders become actions, actions become steps, and all of them a replay. A trained
//! team may play the enemies.

use crate::web::protocol::{PlayedSteps, ReplayFile};
use crate::web::simulation::{Simulation, SimulationError};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use smaclite_engine::{Arena, Battle, BattleSetup, IllegalAction};
use smaclite_learn::{TrainedTeam, UnfitTeam};
use smaclite_scenarios::{Faction, Problems, Scenario};
use smaclite_view::{AgentOrder, OrderError, Orders, Recorder, ReplayError, SUFFIX};
use std::sync::Arc;

/// What all battles of the command have in common.
pub(super) struct Game {
    pub(super) setup: BattleSetup,
    pub(super) scenario: Scenario,
    pub(super) arena: Arc<Arena>,
    /// Plays the enemies, if no script does.
    team: Option<TrainedTeam>,
}

/// A battle.
pub(super) struct Played<'a> {
    game: &'a Game,
    seed: u64,
    simulation: Simulation,
    orders: Orders,
    /// The joint actions of all steps, also of one that is to be played.
    actions: Vec<u16>,
}

/// Why nothing can be played.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StartError {
    #[error(transparent)]
    Scenario(#[from] Problems),
    #[error(transparent)]
    Team(#[from] UnfitTeam),
}

/// Why a request is refused.
#[derive(Debug, thiserror::Error)]
pub(super) enum GameError {
    #[error(transparent)]
    Order(#[from] OrderError),
    #[error(transparent)]
    Action(#[from] IllegalAction),
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    #[error("actions must be {n_agents} per step, got {given} in all")]
    ActionCount { n_agents: usize, given: usize },
    #[error("the battle is over")]
    Over,
    #[error("the battle has no step yet")]
    NoStep,
    #[error("the replay cannot be written: {0}")]
    Replay(#[from] ReplayError),
}

impl Game {
    pub(super) fn new(setup: BattleSetup, team: Option<TrainedTeam>) -> Result<Game, StartError> {
        let (scenario, arena) = setup.arena()?;
        if let Some(team) = &team {
            team.check(&arena, Faction::Enemy)?;
        }
        Ok(Game { setup, scenario, arena: Arc::new(arena), team })
    }

    /// The battle of a seed, after these actions of the agents.
    pub(super) fn begin(&self, seed: u64, actions: &[u16]) -> Result<(Played<'_>, PlayedSteps), GameError> {
        let (n_agents, given) = (self.arena.sizes().n_agents, actions.len());
        if !given.is_multiple_of(n_agents) {
            return Err(GameError::ActionCount { n_agents, given });
        }
        let mut log = Vec::new();
        let mut rehearsal = self.start(seed)?;
        for (step, agents) in actions.chunks_exact(n_agents).enumerate() {
            self.log_step(rehearsal.battle(), agents.iter().copied(), seed, &mut log);
            rehearsal.play_to(step + 1, &log)?;
        }
        let (simulation, orders) = (self.start(seed)?, Orders::new(&self.scenario));
        let mut played = Played { game: self, seed, simulation, orders, actions: log };
        let steps = played.encode(given / n_agents)?;
        Ok((played, steps))
    }

    fn start(&self, seed: u64) -> Result<Simulation, SimulationError> {
        let start = Battle::new(Arc::clone(&self.arena), seed).save();
        Simulation::new(&self.scenario, &self.arena, &start)
    }

    /// Appends a joint action: those of the agents, and those that the team chooses for the enemies.
    fn log_step(&self, battle: &Battle, agents: impl Iterator<Item = u16>, seed: u64, log: &mut Vec<u16>) {
        let sizes = self.arena.sizes();
        let (n_agents, n_actors) = (sizes.n_agents, sizes.n_actors());
        let step = log.len() / n_actors;
        let enemies = self.team.as_ref().map(|team| {
            let past = log.chunks_exact(n_actors).rev().map(|joint| &joint[n_agents..]);
            team.act(battle, Faction::Enemy, past, seed, step as u64)
        });
        log.extend(agents);
        // Legal actions are below the 6 + 360 + 1000 actions of the largest scenario.
        log.extend(enemies.into_iter().flatten().map(|action| action as u16));
    }
}

impl Played<'_> {
    /// Gives orders, all of them or none.
    pub(super) fn give(&mut self, orders: &[AgentOrder]) -> Result<(), OrderError> {
        self.orders.give(&self.game.scenario, self.simulation.battle(), orders)
    }

    pub(super) fn orders(&self) -> &Orders {
        &self.orders
    }

    /// Plays one step by the orders.
    pub(super) fn step(&mut self) -> Result<PlayedSteps, GameError> {
        if self.simulation.battle().is_over() {
            return Err(GameError::Over);
        }
        let battle = self.simulation.battle();
        let actions = self.orders.actions(&self.game.scenario, battle);
        self.game.log_step(battle, actions.into_iter(), self.seed, &mut self.actions);
        self.encode(1)
    }

    /// Plays up to `n_steps` of the actions that are not played.
    fn encode(&mut self, n_steps: usize) -> Result<PlayedSteps, GameError> {
        let mut steps = self.simulation.encode(n_steps, &self.actions)?;
        steps.is_over = self.simulation.battle().is_over();
        Ok(PlayedSteps { steps, orders: self.orders.current() })
    }

    /// All steps so far, as the file of a replay.
    pub(super) fn replay(&self) -> Result<ReplayFile, GameError> {
        if self.actions.is_empty() {
            return Err(GameError::NoStep);
        }
        let mut recorder = Recorder::new(self.game.setup.clone(), self.seed)?;
        for actions in self.actions.chunks_exact(self.game.arena.sizes().n_actors()) {
            let actions: Vec<i32> = actions.iter().map(|&action| action.into()).collect();
            recorder.step(&actions)?;
        }
        let replay = STANDARD.encode(recorder.finish().to_bytes()?);
        let name = format!("{}-seed{}.{SUFFIX}", self.game.scenario.name, self.seed);
        Ok(ReplayFile { name, replay })
    }
}
