//! Plays a trained team. Of every environment the first episodes are counted, the same number in each (to
//! within one): to count the first episodes that end anywhere would favour short ones.

use crate::actor::{Actor, Draw};
use crate::checkpoint::read_actor;
use crate::collect::ended_episodes;
use crate::lanes::{LaneBatch, LaneError, Lanes};
use crate::policy::Choice;
use crate::random::Purpose;
use crate::rollout::Episode;
use crate::run::RunDescription;
use crate::team::{Network, Team};
use crate::tensors::FileError;
use serde::Serialize;
use smaclite_engine::Opponents;
use smaclite_ipc::{Batch, ClientError, RuntimeDir};
use std::path::Path;

/// Most environments of an evaluation.
const MAX_ENVS: usize = 64;

/// How to evaluate.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// Number of episodes, at least 1.
    pub episodes: usize,
    /// Environment `i` is seeded with `seed + i`; actions are drawn from the seed too.
    pub seed: u64,
    /// Take the most probable action, instead of drawing one by its probability.
    pub greedy: bool,
    /// Worker threads of the pool.
    pub threads: usize,
    /// Who plays the enemies; `None` for those of the training.
    pub opponents: Option<Opponents>,
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
    /// An environment is to make a step of an episode that counts, with one action per agent.
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
    /// Who played the enemies.
    pub opponents: Opponents,
    /// The seed.
    pub seed: u64,
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
    let mut run = RunDescription::read(folder)?;
    run.setup.opponents = evaluation.opponents.clone().unwrap_or(run.setup.opponents);
    let network = read_network(folder, &run)?;
    let num_envs = episodes.clamp(1, MAX_ENVS);
    let mut lanes = Lanes::start(&run.setup, num_envs, run.config.last_actions, threads, runtime_dir)?;
    lanes.reset(seed)?;
    let choice = if greedy { Choice::Greedy } else { Choice::Sampled };
    let mut actors: Vec<Actor> = (0..lanes.count()).map(|_| Actor::default()).collect();
    let mut tally = Tally { episodes, ended: vec![0; num_envs], counted: Vec::with_capacity(episodes) };
    let mut step = 0;
    while tally.counted.len() < episodes {
        if interrupted() {
            return Err(ClientError::Interrupted.into());
        }
        for (lane, actor) in actors.iter_mut().enumerate() {
            let LaneBatch { first_env, batch, .. } = lanes.batch(lane, interrupted)?;
            tally.add_ended(first_env, batch, on_event);
            let draw = Draw { seed, purpose: Purpose::Evaluation, step, first_env };
            actor.act(&network, run.sizes, batch, choice, draw);
            // After the last batch of an episode, next-step autoreset ignores the actions.
            let ends = batch.terminated().iter().zip(batch.truncated());
            let actions = actor.actions.chunks(run.sizes.n_agents);
            for ((env_id, actions), (terminated, truncated)) in (first_env..).zip(actions).zip(ends) {
                if terminated | truncated == 0 && tally.is_open(env_id) {
                    on_event(EvaluationEvent::Step { env_id, actions });
                }
            }
            lanes.send(lane, &actor.actions)?;
        }
        step += 1;
    }
    Ok(result(&run, &evaluation, num_envs, &tally.counted))
}

fn read_network(folder: &Path, run: &RunDescription) -> Result<Network, FileError> {
    read_actor(&folder.join("weights.safetensors"), Team::new(&run.config, run.sizes).actor.mlp)
}

/// The episodes that ended, by environment, and those of them that count.
struct Tally {
    /// How many are to count.
    episodes: usize,
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
        for (slot, episode) in ended_episodes(batch) {
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
    evaluation: &Evaluation,
    num_envs: usize,
    counted: &[Episode],
) -> EvaluationResult {
    let Evaluation { episodes, seed, greedy, .. } = *evaluation;
    let mean = |value: &dyn Fn(&Episode) -> f64| {
        counted.iter().map(value).sum::<f64>() / counted.len().max(1) as f64
    };
    let mean_return = mean(&|episode| f64::from(episode.episode_return));
    EvaluationResult {
        scenario: run.name.clone(),
        episodes,
        num_envs,
        opponents: run.setup.opponents.clone(),
        seed,
        greedy,
        win_rate: mean(&|episode| f64::from(u8::from(episode.won))),
        mean_return,
        return_deviation: mean(&|episode| (f64::from(episode.episode_return) - mean_return).powi(2)).sqrt(),
        mean_length: mean(&|episode| f64::from(episode.length)),
    }
}
