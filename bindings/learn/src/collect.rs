//! Fills a rollout: lane by lane, a batch is stored, the policy acts on it in place, and its actions are
//! sent. The workers step one lane while the policy acts on the other.

use crate::actor::{Actor, Draw};
use crate::lanes::{LaneBatch, Lanes};
use crate::policy::Choice;
use crate::random::Purpose;
use crate::rollout::{Episode, Rollout};
use crate::team::Network;
use smaclite_ipc::{Batch, ClientError};
use smaclite_pool::fields::Field;
use std::time::{Duration, Instant};

/// The memory of collection, one actor per lane.
#[derive(Debug, Default)]
pub(crate) struct Collector {
    actors: Vec<Actor>,
}

impl Collector {
    /// Plays `rollout.horizon` steps of every environment. `seed` and the number of steps made before decide
    /// the random numbers. Returns the time that was spent waiting for batches.
    pub fn collect(
        &mut self,
        lanes: &mut Lanes,
        network: &Network,
        rollout: &mut Rollout,
        (seed, first_step): (u64, u64),
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Duration, ClientError> {
        self.actors.resize_with(lanes.count(), Actor::default);
        rollout.episodes.clear();
        let mut waited = Duration::ZERO;
        for t in 0..=rollout.horizon {
            if interrupted() {
                return Err(ClientError::Interrupted);
            }
            for (lane, actor) in self.actors.iter_mut().enumerate() {
                let begin = Instant::now();
                let LaneBatch { first_env, batch, over } = lanes.batch(lane, interrupted)?;
                waited += begin.elapsed();
                rollout.store_inputs(t, first_env, batch);
                if t > 0 {
                    rollout.store_outcome(t - 1, first_env, batch);
                }
                if t < rollout.horizon {
                    let step = first_step + t as u64;
                    let draw = Draw { seed, purpose: Purpose::Actions, step, first_env };
                    actor.act(network, rollout.sizes, batch, Choice::Sampled, draw);
                    rollout.store_actions(t, first_env, over, actor);
                    lanes.send(lane, &actor.actions)?;
                }
            }
        }
        Ok(waited)
    }
}

/// Copies `values` into row `row` of rows of `width`.
fn store<T: Copy>(to: &mut [T], row: usize, width: usize, values: &[T]) {
    to[row * width..][..values.len()].copy_from_slice(values);
}

impl Rollout {
    /// Stores what the networks see at time `t`.
    fn store_inputs(&mut self, t: usize, first_env: usize, batch: &Batch) {
        let sample = t * self.num_envs + first_env;
        store(&mut self.obs, sample, self.sizes.n_agents * self.sizes.obs_size, batch.obs());
        if !self.state.is_empty() {
            let state = batch.field(Field::State).unwrap_or(&[]);
            store(&mut self.state, sample, self.sizes.state_size, state);
        }
    }

    /// Stores what the policy chose at time `t`. Where the episode is over, next-step autoreset ignores the
    /// choice.
    fn store_actions(&mut self, t: usize, first_env: usize, over: &[bool], actor: &Actor) {
        let sample = t * self.num_envs + first_env;
        let row = sample * self.sizes.n_agents;
        store(&mut self.masks, row, self.padded_actions, &actor.masks);
        store(&mut self.log_probs, row, 1, &actor.log_probs);
        let actions = self.actions[row..].iter_mut().zip(&actor.actions);
        actions.for_each(|(to, action)| *to = *action as u16);
        store(&mut self.is_reset, sample, 1, over);
    }

    /// Stores what the step of time `t` led to.
    fn store_outcome(&mut self, t: usize, first_env: usize, batch: &Batch) {
        let sample = t * self.num_envs + first_env;
        store(&mut self.rewards, sample, 1, batch.reward());
        let flags = batch.terminated().iter().zip(batch.truncated());
        for (i, (terminated, truncated)) in flags.enumerate() {
            self.terminated[sample + i] = *terminated != 0;
            self.truncated[sample + i] = *truncated != 0;
        }
        self.episodes.extend(ended_episodes(batch).map(|(_, episode)| episode));
    }
}

/// The episodes that ended with this batch, with the slots.
pub(crate) fn ended_episodes(batch: &Batch) -> impl Iterator<Item = (usize, Episode)> {
    let (returns, won) = (batch.field(Field::EpisodeReturn), batch.field::<u8>(Field::BattleWon));
    let lengths = batch.field(Field::EpisodeLength);
    let ends = batch.terminated().iter().zip(batch.truncated()).enumerate();
    let ended = ends.filter(|(_, (terminated, truncated))| **terminated | **truncated != 0);
    ended.map(move |(slot, _)| {
        let episode = Episode {
            episode_return: returns.map_or(0.0, |returns| returns[slot]),
            length: lengths.map_or(0, |lengths| lengths[slot]),
            won: won.is_some_and(|won| won[slot] != 0),
        };
        (slot, episode)
    })
}
