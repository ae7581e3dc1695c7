//! Trained teams, from the files that `smaclite-pool train` leaves in a folder.

use crate::game::Game;
use crate::layer::WeightsError;
use crate::network::{Network, NetworkKind};
use crate::protocol::TeamFiles;
use crate::source::{RunConfig, RunFile, source_of};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use safetensors::{SafeTensorError, SafeTensors};
use serde::de::Error;
use smaclite_engine::{
    Arena, Battle, MAX_LAST_ACTIONS, Scratch, Sides, Sizes, TargetLayout, UnitLayout, UniversalForm,
    UniversalRows, action,
};
use smaclite_scenarios::{Faction, Problems, Scenario};
use std::rc::Rc;

/// A trained team.
#[derive(Debug)]
pub struct Team {
    /// What the page calls it.
    name: String,
    /// The name of the scenario that it was trained in.
    scenario: String,
    /// That scenario as a request has it.
    source: String,
    /// What it is there.
    player: Rc<TeamOnScenario>,
    /// Where it plays every scenario: its configuration and the bytes of its weights.
    universal: Option<(RunConfig, Vec<u8>)>,
}

/// What a team is on a scenario.
#[derive(Debug)]
pub(crate) struct TeamOnScenario {
    /// The sizes of its side; `obs_size` includes the last actions.
    sizes: Sizes,
    last_actions: usize,
    network: Network,
}

/// Why files are no team, or the team cannot play.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum TeamError {
    #[error("run.json of the team `{name}` is not valid: {error}")]
    Run { name: String, error: serde_json::Error },
    #[error("the scenario in run.json of the team `{name}` is not valid: {error}")]
    Scenario { name: String, error: Problems },
    #[error("the weights of the team `{name}` cannot be used: {why}")]
    Weights { name: String, why: String },
    #[error("the team `{name}` was trained in {trained_in}: {expected}; the {given}")]
    Unfit { name: String, trained_in: String, expected: String, given: String },
    #[error("the team `{name}` cannot play this scenario: {why}")]
    Other { name: String, why: String },
}

impl TeamFiles {
    /// What a page needs of a team: of the weights those of the actor.
    ///
    /// # Errors
    /// As [`Team::read`].
    pub fn new(name: String, run: String, weights: &[u8]) -> Result<TeamFiles, TeamError> {
        Team::read(&name, &run, weights)?; // a page does not find out that a team is damaged
        let weights =
            actor(weights).map_err(|why| TeamError::Weights { name: name.clone(), why: why.to_string() })?;
        Ok(TeamFiles { name, run, weights: STANDARD.encode(weights) })
    }
}

fn actor(weights: &[u8]) -> Result<Vec<u8>, SafeTensorError> {
    let tensors = SafeTensors::deserialize(weights)?.tensors().into_iter();
    safetensors::serialize(tensors.filter(|(name, _)| name.starts_with("actor.")), None)
}

impl Team {
    /// Reads a team from the text of its `run.json` and the bytes of its weights.
    ///
    /// # Errors
    /// If one of them is damaged, or they do not belong together.
    pub fn read(name: &str, run: &str, weights: &[u8]) -> Result<Team, TeamError> {
        let name = name.to_owned();
        let run: RunFile = match serde_json::from_str(run) {
            Ok(run) => run,
            Err(error) => return Err(TeamError::Run { name, error }),
        };
        let Some(config) = run.config else {
            return Err(TeamError::Run { name, error: Error::missing_field("config") });
        };
        let plays_both = run.setup.sides.are_both(); // it plays the agents here
        let setup = if plays_both { run.setup.with_sides(Sides::Allies) } else { run.setup };
        let (scenario, arena) = match setup.arena() {
            Ok(pair) => pair,
            Err(error) => return Err(TeamError::Scenario { name, error }),
        };
        let source = source_of(&setup, &scenario);
        let player = match TeamOnScenario::read(&config, weights, &setup.rules.figures(&scenario), &arena) {
            Ok(player) => Rc::new(player),
            Err(why) => return Err(TeamError::Weights { name, why: why.to_string() }),
        };
        let universal = (config.network == NetworkKind::Universal).then(|| (config, weights.to_owned()));
        Ok(Team { name, scenario: scenario.name, source, player, universal })
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The scenario that it was trained in.
    pub fn scenario(&self) -> &str {
        &self.scenario
    }

    /// That scenario as a request of a page has it.
    pub(crate) fn source(&self) -> &str {
        &self.source
    }

    /// Whether it plays every scenario.
    pub(crate) fn is_universal(&self) -> bool {
        self.universal.is_some()
    }

    /// The sizes of its side where it was trained; `obs_size` includes the last actions.
    pub fn sizes(&self) -> Sizes {
        self.player.sizes
    }

    /// The outputs of its network where it was trained, f32 `[n_agents, n_actions]`, for observations
    /// `[n_agents, obs_size]`, which include the last actions.
    pub fn logits(&self, obs: &[f32]) -> Vec<f32> {
        self.player.logits(obs)
    }

    /// What plays a side of a game.
    ///
    /// # Errors
    /// If the team was trained for other units, or its networks cannot read these.
    pub(crate) fn on(&self, game: &Game, side: Faction) -> Result<Rc<TeamOnScenario>, TeamError> {
        let player = match &self.universal {
            None => Rc::clone(&self.player),
            Some((config, weights)) => {
                let scenario = game.setup.rules.figures(&game.scenario);
                let player = TeamOnScenario::read(config, weights, &scenario, &game.arena);
                let other =
                    |why: WeightsError| TeamError::Other { name: self.name.clone(), why: why.to_string() };
                Rc::new(player.map_err(other)?)
            }
        };
        self.check(&player, game, side)?;
        Ok(player)
    }

    fn check(&self, player: &TeamOnScenario, game: &Game, side: Faction) -> Result<(), TeamError> {
        let given = with_history(game.arena.sizes_of(side), player.last_actions);
        let shape = |sizes: Sizes| (sizes.n_agents, sizes.n_actions, sizes.obs_size);
        // A team of one map knows no types, only sizes. One that plays every map would see the enemies as if
        // they had the types of the agents.
        let sees_its_own =
            side == Faction::Ally || self.universal.is_none() || game.scenario.has_equal_sides();
        if shape(player.sizes) == shape(given) && sees_its_own {
            return Ok(());
        }
        let in_words = |Sizes { n_agents, n_actions, obs_size, .. }: Sizes| {
            format!("{n_agents} with {n_actions} actions and observations of {obs_size} numbers")
        };
        let (name, trained_in) = (self.name.clone(), self.scenario.clone());
        let expected = in_words(player.sizes);
        if self.universal.is_some() {
            let why =
                "its sides are not equal, and a team that plays the enemies sees them as its own".to_owned();
            return Err(TeamError::Other { name, why });
        }
        let given = match side {
            Faction::Ally => format!("agents of this scenario are {}", in_words(given)),
            Faction::Enemy => format!(
                "enemies of this scenario are {}; a team plays the enemies only of scenarios whose two \
                 sides have equal sizes",
                in_words(given)
            ),
        };
        Err(TeamError::Unfit { name, trained_in, expected, given })
    }
}

impl TeamOnScenario {
    /// From the bytes of weights and the scenario with the figures of its rules.
    fn read(
        config: &RunConfig,
        weights: &[u8],
        scenario: &Scenario,
        arena: &Arena,
    ) -> Result<TeamOnScenario, WeightsError> {
        let RunConfig { network, ref hidden, activation, last_actions } = *config;
        if last_actions > MAX_LAST_ACTIONS {
            return Err(WeightsError::LastActions(last_actions)); // before memory for so many is asked for
        }
        let sizes = with_history(arena.sizes(), last_actions);
        let over_units = |rows: Option<&UniversalRows>| {
            let layout = UnitLayout::of_obs(scenario, sizes.obs_size);
            let layouts = layout.zip(TargetLayout::new(scenario));
            Network::over_units(weights, layouts, hidden, activation, rows)
        };
        let network = match network {
            NetworkKind::Flat => {
                let widths: Vec<usize> = [&[sizes.obs_size], &hidden[..], &[sizes.n_actions]].concat();
                Network::flat(weights, &widths, sizes.n_agents, activation)?
            }
            NetworkKind::Units => over_units(None)?,
            NetworkKind::Universal => over_units(Some(&UniversalForm::of_obs(last_actions).rows(scenario)?))?,
        };
        Ok(TeamOnScenario { sizes, last_actions, network })
    }

    /// See [`Team::logits`].
    fn logits(&self, obs: &[f32]) -> Vec<f32> {
        let rows = obs.chunks_exact(self.sizes.obs_size).enumerate();
        rows.flat_map(|(agent, row)| self.network.forward(agent, row)).collect()
    }

    /// The actions of a side's units, drawn by their probability. `past` are the side's actions of the steps
    /// before, the newest first. The same seed and battle give the same actions.
    pub(crate) fn act<'a>(
        &self,
        battle: &Battle,
        side: Faction,
        past: impl Iterator<Item = &'a [u16]> + Clone,
        seed: u64,
    ) -> Vec<i32> {
        let Sizes { n_agents, n_actions, obs_size, .. } = self.sizes;
        let mut available = vec![0; n_agents * n_actions];
        battle.write_avail_actions(side, &mut available);
        let mut obs = vec![0.0; n_agents * obs_size];
        battle.write_obs(side, &mut obs, &mut Scratch::new()); // leaves zeros behind its own features
        self.append_past(&mut obs, &available, past);
        let seed = seed ^ (battle.episode_length() as u64) << 32;
        let mut generator = Pcg64Mcg::seed_from_u64(match side {
            Faction::Ally => seed,
            Faction::Enemy => !seed,
        });
        let logits = self.logits(&obs);
        let rows = logits.chunks_exact(n_actions).zip(available.chunks_exact(n_actions));
        rows.map(|(logits, available)| draw(logits, available, &mut generator) as i32).collect()
    }

    /// Writes the last actions of every living agent behind the other features of its row, the newest first.
    fn append_past<'a>(
        &self,
        obs: &mut [f32],
        available: &[u8],
        past: impl Iterator<Item = &'a [u16]> + Clone,
    ) {
        let Sizes { n_actions, obs_size, .. } = self.sizes;
        let own = obs_size - self.last_actions * n_actions;
        let rows = obs.chunks_exact_mut(obs_size).zip(available.chunks_exact(n_actions));
        for (agent, (row, available)) in rows.enumerate() {
            let is_dead = available[action::NO_OP] != 0;
            for (one_hot, joint) in row[own..].chunks_exact_mut(n_actions).zip(past.clone()) {
                one_hot[usize::from(joint[agent])] = if is_dead { 0.0 } else { 1.0 };
            }
        }
    }
}

/// No weights fit if the history is longer than any memory.
fn with_history(sizes: Sizes, last_actions: usize) -> Sizes {
    let history = last_actions.saturating_mul(sizes.n_actions);
    Sizes { obs_size: sizes.obs_size.saturating_add(history), ..sizes }
}

/// Draws an available action by the softmax of the outputs.
fn draw(logits: &[f32], available: &[u8], generator: &mut Pcg64Mcg) -> usize {
    let choices = || logits.iter().zip(available).enumerate().filter(|(_, (_, available))| **available != 0);
    let largest = choices().map(|(_, (logit, _))| *logit).fold(f32::NEG_INFINITY, f32::max);
    let power = |logit: f32| f64::from(logit - largest).exp();
    let total: f64 = choices().map(|(_, (logit, _))| power(*logit)).sum();
    let mut left = total * (generator.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let mut chosen = action::NO_OP;
    for (number, (logit, _)) in choices() {
        chosen = number;
        left -= power(*logit);
        if left < 0.0 {
            break;
        }
    }
    chosen
}
