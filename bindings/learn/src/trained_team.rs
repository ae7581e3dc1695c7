//! A trained team that plays one side of a single battle, which its caller steps: no lane, no pool.

use crate::actor::{Actor, Draw, Rows};
use crate::adam::Adam;
use crate::architecture::{Architecture, Workspace};
use crate::description::{OtherMap, RunDescription, Weights, read_policy};
use crate::lanes::sizes_with_history;
use crate::policy::Choice;
use crate::random::Purpose;
use crate::team::{Network, agent_ids};
use crate::tensors::FileError;
use smaclite_engine::{Arena, Battle, BattleSetup, Rules, Scratch, Sizes, action};
use smaclite_scenarios::Faction;
use std::path::Path;

/// Rows of observations whose outputs are computed at a time, so that what is between them stays small.
const ROWS_AT_A_TIME: usize = 128;

/// A team as `smaclite-pool train` leaves it in a folder.
#[derive(Debug)]
pub struct TrainedTeam {
    pub(crate) run: RunDescription,
    pub(crate) network: Network,
}

/// A team has networks for units of other numbers or kinds.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error(
    "the team was trained in `{trained_in}` and plays {} units with {} actions and observations of {} \
     numbers, but the {side} of this scenario are {} with {} and {}; a team plays the enemies only of \
     scenarios whose two sides have equal sizes",
    expected.n_agents, expected.n_actions, expected.obs_size, given.n_agents, given.n_actions, given.obs_size
)]
pub struct UnfitTeam {
    trained_in: String,
    side: &'static str,
    expected: Box<Sizes>,
    given: Box<Sizes>,
}

impl TrainedTeam {
    /// Reads the folder of a run, with the weights of [`Weights::of`].
    ///
    /// # Errors
    /// If it holds no run, or its files are damaged.
    pub fn open(folder: &Path) -> Result<TrainedTeam, FileError> {
        TrainedTeam::open_with(folder, None)
    }

    /// The same with these weights.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_with(folder: &Path, weights: Option<Weights>) -> Result<TrainedTeam, FileError> {
        TrainedTeam::of_run(folder, RunDescription::read(folder)?, weights)
    }

    /// The same on the map of this description of its run.
    pub(crate) fn of_run(
        folder: &Path,
        run: RunDescription,
        weights: Option<Weights>,
    ) -> Result<TrainedTeam, FileError> {
        let (_, network) = read_policy(folder, &run, weights)?;
        Ok(TrainedTeam { run, network })
    }

    /// The team of a run, with the weights in this file.
    ///
    /// # Errors
    /// As [`RunDescription::read_actor`].
    pub fn open_file(run: &RunDescription, weights: &Path) -> Result<TrainedTeam, FileError> {
        let network = run.playing(run.read_actor(weights)?);
        Ok(TrainedTeam { run: run.clone(), network })
    }

    /// The same on another map, with networks that fit every scenario.
    ///
    /// # Errors
    /// If they do not, and as [`open`](Self::open).
    pub fn open_on(
        folder: &Path,
        weights: Option<Weights>,
        map: BattleSetup,
    ) -> Result<TrainedTeam, OtherMap> {
        Ok(TrainedTeam::of_run(folder, RunDescription::read(folder)?.on(map)?, weights)?)
    }

    /// The team as it plays the enemies of these battles: on them if its networks fit every scenario, else on
    /// its own map, which [`check`](Self::check) compares.
    ///
    /// # Errors
    /// If there is no such team, its files are damaged, or it knows its own units from those of the enemies,
    /// and these are others.
    pub fn open_enemies(
        folder: &Path,
        weights: Option<Weights>,
        battles: &BattleSetup,
    ) -> Result<TrainedTeam, OtherMap> {
        let run = RunDescription::read(folder)?.playing_enemies_of::<OtherMap>(folder, battles)?;
        Ok(TrainedTeam::of_run(folder, run, weights)?)
    }

    /// Says that a team which is to play the enemies was trained with other rules than those of the battles;
    /// `None` if it was not.
    ///
    /// # Errors
    /// If the run in the folder cannot be read.
    pub fn other_rules(folder: &Path, of_battles: Rules) -> Result<Option<String>, FileError> {
        let of_team = RunDescription::read(folder)?.setup.rules;
        let says = || {
            let folder = folder.display();
            format!(
                "the team `{folder}` was trained with rules {of_team}, and the battles have rules \
                 {of_battles}"
            )
        };
        Ok((of_team != of_battles).then(says))
    }

    /// The run that it is of.
    pub fn run(&self) -> &RunDescription {
        &self.run
    }

    /// The team in two parts, of which [`from_parts`](Self::from_parts) makes it again, also in another
    /// process: what `run.json` says, and the parameters of its network.
    #[must_use]
    pub fn parts(&self) -> (Vec<u8>, &[f32]) {
        (self.run.to_json(), &self.network.params)
    }

    /// A team from its [`parts`](Self::parts); `None` if they are not those of one team.
    #[must_use]
    pub fn from_parts(run: &[u8], params: Vec<f32>) -> Option<TrainedTeam> {
        let run = RunDescription::from_json(run).ok()?;
        let architecture = Architecture::actor(&run.config, &run.inputs);
        let are_all = params.len() == architecture.n_params() && params.iter().all(|param| param.is_finite());
        are_all.then(|| TrainedTeam { run, network: Network { architecture, params, adam: Adam::new(0) } })
    }

    /// Whether the team has the networks for a side of an arena.
    ///
    /// # Errors
    /// If it has not.
    pub fn check(&self, arena: &Arena, side: Faction) -> Result<(), UnfitTeam> {
        let expected = self.run.sizes;
        let given = sizes_with_history(arena.sizes_of(side), self.run.config.last_actions);
        let shape = |sizes: Sizes| (sizes.n_agents, sizes.n_actions, sizes.obs_size);
        if shape(expected) == shape(given) {
            return Ok(());
        }
        let side = if side == Faction::Ally { "agents" } else { "enemies" };
        let [expected, given] = [expected, given].map(Box::new);
        Err(UnfitTeam { trained_in: self.run.name.clone(), side, expected, given })
    }

    /// The network's outputs, f32 `[m, n_agents, n_actions]`, for the observations of `m` battles, f32
    /// `[m, n_agents, obs_size]`, which include the last actions.
    ///
    /// # Panics
    /// If `obs` has another size.
    pub fn logits(&self, obs: &[f32]) -> Vec<f32> {
        let Sizes { n_agents, n_actions, obs_size, .. } = self.run.sizes;
        assert_eq!(obs.len() % (n_agents * obs_size), 0, "[m, n_agents, obs_size]");
        let battles_at_a_time = (ROWS_AT_A_TIME / n_agents).max(1);
        let mut outputs = Vec::with_capacity(obs.len() / obs_size * n_actions);
        let (mut workspace, ids) = (Workspace::default(), agent_ids(battles_at_a_time * n_agents, n_agents));
        for obs in obs.chunks(battles_at_a_time * n_agents * obs_size) {
            self.network.forward(obs, &ids[..obs.len() / obs_size], &mut workspace);
            let rows = workspace.output().chunks_exact(self.network.architecture.padded_out());
            rows.for_each(|row| outputs.extend_from_slice(&row[..n_actions]));
        }
        outputs
    }

    /// The actions of a side's units, drawn by their probability. `past` are the side's actions of the steps
    /// before, the newest first. The same seed, step and battle give the same actions.
    ///
    /// # Panics
    /// If the team does not [fit](Self::check).
    pub fn act<'a>(
        &self,
        battle: &Battle,
        side: Faction,
        past: impl Iterator<Item = &'a [u16]>,
        seed: u64,
        step: u64,
    ) -> Vec<i32> {
        let sizes = self.run.sizes;
        let mut obs = vec![0.0; sizes.n_agents * sizes.obs_size];
        let mut available = vec![0; sizes.n_agents * sizes.n_actions];
        let past = past.take(self.run.config.last_actions);
        let past: Vec<Vec<i32>> =
            past.map(|actions| actions.iter().map(|&action| action.into()).collect()).collect();
        let past = past.iter().map(Vec::as_slice);
        self.observe(battle, side, past, &mut Scratch::new(), &mut obs, &mut available);
        let purpose = match side {
            Faction::Ally => Purpose::Evaluation,
            Faction::Enemy => Purpose::EnemyEvaluation,
        };
        let mut actor = Actor::default();
        let rows = Rows { sizes, obs: &obs, available: &available };
        actor.act(&self.network, rows, Choice::Sampled, Draw { seed, purpose, step }, 0..1);
        actor.chosen.actions
    }

    /// Writes what a side's units observe and can do. Behind the other features of its row, every living
    /// unit has the last actions, as in lanes.
    pub(crate) fn observe<'a>(
        &self,
        battle: &Battle,
        side: Faction,
        past: impl Iterator<Item = &'a [i32]> + Clone,
        scratch: &mut Scratch,
        obs: &mut [f32],
        available: &mut [u8],
    ) {
        battle.write_obs(side, obs, scratch); // leaves zeros behind its own features
        battle.write_avail_actions(side, available);
        let sizes = self.run.sizes;
        let own = sizes.obs_size - self.run.config.last_actions * sizes.n_actions;
        let rows = obs.chunks_exact_mut(sizes.obs_size).zip(available.chunks_exact(sizes.n_actions));
        for (agent, (row, available)) in rows.enumerate() {
            let is_dead = available[action::NO_OP] != 0;
            for (one_hot, actions) in row[own..].chunks_exact_mut(sizes.n_actions).zip(past.clone()) {
                one_hot[actions[agent] as usize] = if is_dead { 0.0 } else { 1.0 };
            }
        }
    }
}
