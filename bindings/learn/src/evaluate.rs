//! Plays a trained team. Of every environment the first episodes are counted, the same number in each (to
//! within one): to count the first episodes that end anywhere would favour short ones.

use crate::actor::Draw;
use crate::collect::ended_episodes;
use crate::config::Enemies;
use crate::description::{OtherMap, RunDescription, Weights, read_policy};
use crate::enemy_actor::{BothActors, Teams};
use crate::evaluations::Summary;
use crate::lane_error::LaneError;
use crate::lanes::{LaneBatch, Lanes};
use crate::league::League;
use crate::policy::Choice;
use crate::random::Purpose;
use crate::rollout::Episode;
use crate::setups::with_an_end;
use crate::team_files::TeamFiles;
use crate::tensors::FileError;
use serde::Serialize;
use smaclite_engine::{BattleSetup, Opponents, Rules};
use smaclite_ipc::{Batch, ClientError, RuntimeDir};
use std::path::{Path, PathBuf};

/// Most environments of an evaluation.
const MAX_ENVS: usize = 64;

/// How to evaluate.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// Number of episodes, at least 1.
    pub episodes: usize,
    /// Environment `i` is seeded with `seed + i`; actions are drawn from the seed too.
    pub seed: u64,
    /// Which weights play; `None` for those of [`Weights::of`].
    pub weights: Option<Weights>,
    /// Take the most probable action, instead of drawing one by its probability.
    pub greedy: bool,
    /// Worker threads of the pool.
    pub threads: usize,
    /// Who plays the enemies; `None` for the scripts of the training, or attack-move if a team played them,
    /// and on another map as [`RunDescription::on`] says.
    pub opponents: Option<Opponents>,
    /// The folder of a trained team that plays the enemies instead.
    pub opponent_team: Option<PathBuf>,
    /// What is played instead of what the team was trained on.
    pub map: Option<BattleSetup>,
}

impl Evaluation {
    /// The run in a folder, on the map that is played.
    ///
    /// # Errors
    /// If there is none, or its team does not play that map.
    pub fn run(&self, folder: &Path) -> Result<RunDescription, EvaluateError> {
        let run = RunDescription::read(folder)?;
        match &self.map {
            None => Ok(run),
            Some(map) => Ok(run.on(map.clone())?),
        }
    }

    /// What the team of a run plays. Its episodes [end](with_an_end).
    pub fn setup(&self, run: &RunDescription) -> BattleSetup {
        let setup = with_an_end(run.setup.clone());
        if let Some(folder) = &self.opponent_team {
            return Enemies::Team { folder: folder.clone() }.setup(&setup);
        }
        let opponents = self.opponents.clone().unwrap_or(setup.opponents.clone());
        BattleSetup { opponents, ..setup }
    }
}

/// An episode that counts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EvaluatedEpisode {
    /// The environment.
    pub env_id: usize,
    /// The number of the episode in its environment, from 0.
    pub number: usize,
    /// How it ended.
    #[serde(flatten)]
    pub episode: Episode,
}

/// What happens in an evaluation.
#[derive(Clone, Copy, Debug)]
pub enum EvaluationEvent<'a> {
    /// An environment is to make a step of an episode that counts, with one action per agent, and then one
    /// per enemy if a team plays them.
    Step {
        /// The environment.
        env_id: usize,
        /// The actions.
        actions: &'a [i32],
    },
    /// An episode that counts has ended.
    Ended(EvaluatedEpisode),
}

/// The result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EvaluationResult {
    /// The scenario's name.
    pub scenario: String,
    /// Number of episodes.
    pub episodes: usize,
    /// Environments that they were played in.
    pub num_envs: usize,
    /// The rules of the battles.
    pub rules: Rules,
    /// Who played the enemies.
    pub opponents: Opponents,
    /// The folder of the team that played them, if one did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub opponent_team: Option<PathBuf>,
    /// The seed.
    pub seed: u64,
    /// Which weights played.
    pub weights: Weights,
    /// Whether the actions were the most probable ones.
    pub greedy: bool,
    /// Share of won episodes.
    pub win_rate: f64,
    /// Mean of the episodes' sums of rewards.
    pub mean_return: f64,
    /// Standard deviation of those sums.
    pub return_deviation: f64,
    /// Mean number of steps.
    pub mean_length: f64,
}

/// Why an evaluation failed.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[allow(missing_docs)] // the inner errors say it
pub enum EvaluateError {
    File(#[from] FileError),
    Map(#[from] OtherMap),
    Lane(#[from] LaneError),
    Client(#[from] ClientError),
}

/// Plays the team in the folder, and calls `on_event` for all that happens in the episodes that count.
///
/// # Errors
/// If the folder holds no valid run, or the pool fails; `ClientError::Interrupted` if `interrupted` returned
/// true.
pub fn evaluate(
    folder: &Path,
    evaluation: Evaluation,
    runtime_dir: &RuntimeDir,
    interrupted: &mut dyn FnMut() -> bool,
    on_event: &mut dyn FnMut(EvaluationEvent),
) -> Result<EvaluationResult, EvaluateError> {
    let Evaluation { episodes, seed, greedy, threads, .. } = evaluation;
    let run = evaluation.run(folder)?;
    let (weights, network) = read_policy(folder, &run, evaluation.weights)?;
    let (num_envs, setup) = (episodes.clamp(1, MAX_ENVS), evaluation.setup(&run));
    let mut lanes = Lanes::start(&setup, num_envs, run.config.last_actions, threads, runtime_dir)?;
    let league = match &evaluation.opponent_team {
        None => League::default(),
        Some(folder) => {
            League::of_one(num_envs, TeamFiles::read(folder, None)?.rival::<EvaluateError>(&setup, &lanes)?)
        }
    };
    let teams = Teams { own: &network, league: &league };
    lanes.reset(seed)?;
    let choice = Choice::of(greedy);
    let mut actors: Vec<BothActors> = (0..lanes.count()).map(|_| BothActors::default()).collect();
    let (sizes, n_actors) = (lanes.sizes(), lanes.sizes().n_actors());
    let counted = Vec::with_capacity(episodes);
    let n_agents = evaluation.opponent_team.as_ref().map(|_| sizes.n_agents);
    let mut tally = Tally { episodes, n_agents, ended: vec![0; num_envs], counted };
    let mut step = 0;
    while tally.counted.len() < episodes {
        if interrupted() {
            return Err(ClientError::Interrupted.into());
        }
        for (lane, actor) in actors.iter_mut().enumerate() {
            let LaneBatch { first_env, batch, .. } = lanes.batch(lane, interrupted)?;
            tally.add_ended(first_env, batch, on_event);
            let draws = [Purpose::Evaluation, Purpose::EnemyEvaluation];
            let draws = draws.map(|purpose| Draw { seed, purpose, step });
            actor.act(teams, batch, sizes, first_env, choice, draws);
            let joint = actor.actions();
            // After the last batch of an episode, next-step autoreset ignores the actions.
            let ends = batch.terminated().iter().zip(batch.truncated());
            let actions = joint.chunks(n_actors);
            for ((env_id, actions), (terminated, truncated)) in (first_env..).zip(actions).zip(ends) {
                if terminated | truncated == 0 && tally.is_open(env_id) {
                    on_event(EvaluationEvent::Step { env_id, actions });
                }
            }
            lanes.send(lane, joint)?;
        }
        step += 1;
    }
    Ok(result(&run, weights, &setup, &evaluation, num_envs, &tally.counted))
}

/// The episodes that ended, by environment, and those of them that count.
struct Tally {
    /// How many are to count.
    episodes: usize,
    /// If a team plays the enemies.
    n_agents: Option<usize>,
    ended: Vec<usize>,
    counted: Vec<Episode>,
}

impl Tally {
    /// Whether the present episode of an environment counts.
    fn is_open(&self, env_id: usize) -> bool {
        let num_envs = self.ended.len();
        let quota = self.episodes / num_envs + usize::from(env_id < self.episodes % num_envs);
        self.ended[env_id] < quota
    }

    /// Adds the episodes that ended in a batch of the environments from `first_env` on.
    fn add_ended(&mut self, first_env: usize, batch: &Batch, on_event: &mut dyn FnMut(EvaluationEvent)) {
        for (slot, episode) in ended_episodes(batch, |_| self.n_agents) {
            let env_id = first_env + slot;
            let number = self.ended[env_id];
            if self.is_open(env_id) {
                on_event(EvaluationEvent::Ended(EvaluatedEpisode { env_id, number, episode }));
                self.counted.push(episode);
            }
            self.ended[env_id] += 1;
        }
    }
}

fn result(
    run: &RunDescription,
    weights: Weights,
    setup: &BattleSetup,
    evaluation: &Evaluation,
    num_envs: usize,
    counted: &[Episode],
) -> EvaluationResult {
    let Evaluation { episodes, seed, greedy, .. } = *evaluation;
    let Summary { win_rate, mean_return, mean_length } = Summary::of(counted);
    let squares = counted.iter().map(|episode| (f64::from(episode.episode_return) - mean_return).powi(2));
    EvaluationResult {
        scenario: run.name.clone(),
        episodes,
        num_envs,
        rules: setup.rules,
        opponents: setup.opponents.clone(),
        opponent_team: evaluation.opponent_team.clone(),
        seed,
        weights,
        greedy,
        win_rate,
        mean_return,
        return_deviation: (squares.sum::<f64>() / counted.len().max(1) as f64).sqrt(),
        mean_length,
    }
}
