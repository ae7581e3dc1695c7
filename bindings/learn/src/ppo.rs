//! One update of proximal policy optimisation: from a rollout to better networks.

use crate::adam::clip;
use crate::config::{Algorithm, Config};
use crate::gae::{Steps, advantages};
use crate::gradient::{Data, Gradients, Minibatch, ThreadMemory, values};
use crate::loss::{PolicyLoss, PolicyStats, ValueLoss};
use crate::math::mean_and_deviation;
use crate::parallel::Interrupted;
use crate::random::{Purpose, generator};
use crate::rollout::{Rollout, rows};
use crate::team::{Network, Team};
use rand::seq::SliceRandom;
use serde::Serialize;

/// A number that is not finite appeared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "training diverged: the gradient of the {network} is not finite in update {update}; resume from an older \
     copy of the checkpoint, or train with a lower {network}_lr or max_grad_norm"
)]
pub struct Diverged {
    network: &'static str,
    update: u64,
}

/// Why an update was not made. The team is then neither that of before nor that of after.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum UpdateError {
    Diverged(Diverged),
    Interrupted,
}

impl From<Interrupted> for UpdateError {
    fn from(_: Interrupted) -> UpdateError {
        UpdateError::Interrupted
    }
}

/// What an update did, averaged over its minibatches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct UpdateStats {
    /// Share of the rows from which the policy learnt.
    pub policy_rows: f64,
    /// The clipped surrogate, negative.
    pub policy_loss: f64,
    /// In variances of the returns.
    pub value_loss: f64,
    /// Of the actions, in nats.
    pub entropy: f64,
    /// Estimated divergence of the old policy from the new.
    pub kl: f64,
    /// Share of rows whose probability ratio was outside of the clip range.
    pub clip_fraction: f64,
    /// Length of the actor's gradient before it was clipped.
    pub actor_grad_norm: f64,
    /// Length of the critic's gradient before it was clipped.
    pub critic_grad_norm: f64,
    /// Share of the variance of the returns that the critic predicted, before the update.
    pub explained_variance: f64,
    /// Step size of the actor.
    pub actor_lr: f64,
    /// Weight of the entropy.
    pub entropy_weight: f64,
}

/// The memory of updates.
#[derive(Debug)]
pub(crate) struct Ppo {
    threads: Vec<ThreadMemory>,
    gradients: Gradients,
}

/// Advantages, old values and targets by row of the critic, and the explained variance.
struct Estimates {
    advantages: Vec<f32>,
    old_values: Vec<f32>,
    targets: Vec<f32>,
    explained_variance: f64,
}

impl Ppo {
    pub fn new(threads: usize) -> Ppo {
        let threads = (0..threads.max(1)).map(|_| ThreadMemory::default()).collect();
        Ppo { threads, gradients: Gradients::default() }
    }

    /// Trains the team on the rollout. `update` counts the updates of the run, and `steps` is the number of
    /// environment steps before this rollout.
    pub fn update(
        &mut self,
        team: &mut Team,
        rollout: &Rollout,
        config: &Config,
        update: u64,
        steps: u64,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<UpdateStats, UpdateError> {
        let (critic_inputs, critic_size, values_per_env) = match config.algorithm {
            Algorithm::Mappo => (&rollout.state, rollout.sizes.state_size, 1),
            Algorithm::Ippo => (&rollout.obs, rollout.sizes.obs_size, rollout.sizes.n_agents),
        };
        let mut samples = rollout.samples();
        let policy_rows = rollout.policy_rows(&samples);
        let value_rows: Vec<u32> = rows(&samples, values_per_env).collect();
        let threads = &mut self.threads;
        let outputs = values(&team.critic, critic_inputs, critic_size, values_per_env, threads, interrupted)?;
        let estimates = estimate(team, rollout, config, outputs, &value_rows);
        let agents_per_value = rollout.sizes.n_agents / values_per_env;
        let (_, deviation) = team.normaliser.mean_and_deviation();
        let floor = config.advantage_floor * deviation;
        let data = Data {
            rollout,
            critic_inputs,
            critic_size,
            values_per_env,
            advantages: &normalise(estimates.advantages, &policy_rows, agents_per_value, floor),
            old_values: &estimates.old_values,
            targets: &estimates.targets,
        };
        let settings = StepSettings::new(config, update, steps);
        let mut progress = Progress { sums: Sums::default(), interrupted };
        for epoch in 0..config.epochs as u64 {
            self.epoch(team, &data, &mut samples, &settings, epoch, &mut progress)?;
        }
        Ok(UpdateStats {
            policy_rows: policy_rows.len() as f64 / rollout.actions.len() as f64,
            explained_variance: estimates.explained_variance,
            ..progress.sums.stats(&settings)
        })
    }

    /// One pass over the samples, in minibatches of another order.
    fn epoch(
        &mut self,
        team: &mut Team,
        data: &Data<'_>,
        samples: &mut [u32],
        settings: &StepSettings<'_>,
        epoch: u64,
        progress: &mut Progress<'_>,
    ) -> Result<(), UpdateError> {
        let StepSettings { config, update, .. } = *settings;
        // Samples are shuffled and not rows, because the rows of a sample lie side by side in memory.
        samples.shuffle(&mut generator(config.seed, Purpose::Minibatches, [update, epoch]));
        let policy_rows = data.rollout.policy_rows(samples);
        let value_rows: Vec<u32> = rows(samples, data.values_per_env).collect();
        for i in 0..config.minibatches {
            let part = |rows| part(rows, i, config.minibatches);
            let minibatch = settings.minibatch(part(&policy_rows), part(&value_rows));
            self.step(team, data, &minibatch, settings, progress)?;
        }
        Ok(())
    }

    /// One gradient step of both networks.
    fn step(
        &mut self,
        team: &mut Team,
        data: &Data<'_>,
        minibatch: &Minibatch<'_>,
        settings: &StepSettings<'_>,
        progress: &mut Progress<'_>,
    ) -> Result<(), UpdateError> {
        let Progress { sums, interrupted } = progress;
        self.gradients.compute(team, data, minibatch, &mut self.threads, interrupted)?;
        let Gradients { actor, critic, policy_stats, value_loss, .. } = &mut self.gradients;
        let step = |network: &mut Network, gradient: &mut [f32], lr: f64, name| {
            let norm = clip(gradient, settings.config.max_grad_norm);
            if !norm.is_finite() {
                return Err(UpdateError::Diverged(Diverged { network: name, update: settings.update }));
            }
            network.adam.step(&mut network.params, gradient, lr, settings.config.adam_eps);
            Ok(norm)
        };
        if !minibatch.policy_rows.is_empty() {
            sums.actor_norms += step(&mut team.actor, actor, settings.actor_lr, "actor")?;
            sums.actor_steps += 1.0;
        }
        if !minibatch.value_rows.is_empty() {
            sums.critic_norms += step(&mut team.critic, critic, settings.critic_lr, "critic")?;
            sums.critic_steps += 1.0;
        }
        sums.policy.add(policy_stats);
        sums.value_loss += *value_loss;
        sums.value_rows += minibatch.value_rows.len() as f64;
        Ok(())
    }
}

/// The constants of the gradient steps of an update.
struct StepSettings<'a> {
    config: &'a Config,
    update: u64,
    actor_lr: f64,
    critic_lr: f64,
    entropy: f64,
}

impl StepSettings<'_> {
    fn new(config: &Config, update: u64, steps: u64) -> StepSettings<'_> {
        let annealed = |begin, end| config.annealed(begin, end, steps);
        StepSettings {
            config,
            update,
            actor_lr: annealed(config.actor_lr, config.actor_lr * config.lr_end),
            critic_lr: annealed(config.critic_lr, config.critic_lr * config.lr_end),
            entropy: annealed(config.entropy, config.entropy_end),
        }
    }

    /// A minibatch of these rows, over which the losses are means.
    fn minibatch<'a>(&self, policy_rows: &'a [u32], value_rows: &'a [u32]) -> Minibatch<'a> {
        let Config { clip, value_clip, huber, .. } = *self.config;
        let mean = |rows: &[u32]| 1.0 / rows.len().max(1) as f32;
        Minibatch {
            policy: PolicyLoss { clip: clip as f32, entropy: self.entropy as f32, scale: mean(policy_rows) },
            value: ValueLoss { clip: value_clip as f32, huber: huber as f32, scale: mean(value_rows) },
            policy_rows,
            value_rows,
        }
    }
}

/// Part `i` of `n` parts, as equal as can be.
fn part(rows: &[u32], i: usize, n: usize) -> &[u32] {
    &rows[rows.len() * i / n..rows.len() * (i + 1) / n]
}

/// Estimates advantages and returns, and adapts the units of the critic to the returns.
fn estimate(
    team: &mut Team,
    rollout: &Rollout,
    config: &Config,
    mut values: Vec<f32>,
    value_rows: &[u32],
) -> Estimates {
    let (mean, deviation) = team.normaliser.mean_and_deviation();
    values.iter_mut().for_each(|value| *value = (f64::from(*value) * deviation + mean) as f32);
    let Rollout { rewards, terminated, truncated, num_seats, horizon, .. } = rollout;
    let steps = Steps { rewards, terminated, truncated, num_envs: *num_seats };
    let mut estimated = vec![0.0; values.len() / (horizon + 1) * horizon];
    advantages(&steps, &values, config.gamma, config.lambda, &mut estimated);
    let returns: Vec<f32> =
        estimated.iter().zip(&values).map(|(advantage, value)| advantage + value).collect();
    let of_rows = |values: &[f32]| value_rows.iter().map(|row| values[*row as usize]).collect::<Vec<f32>>();
    let (learnt_returns, learnt_errors) = (of_rows(&returns), of_rows(&estimated));
    let (_, spread) = mean_and_deviation(learnt_returns.iter().copied());
    let (_, error) = mean_and_deviation(learnt_errors.iter().copied());
    team.observe_returns(learnt_returns.iter().copied());
    let (mean, deviation) = team.normaliser.mean_and_deviation();
    let to_units = |values: &[f32]| {
        values.iter().map(|value| ((f64::from(*value) - mean) / deviation) as f32).collect::<Vec<f32>>()
    };
    Estimates {
        old_values: to_units(&values[..returns.len()]),
        targets: to_units(&returns),
        advantages: estimated,
        explained_variance: 1.0 - (error / spread).powi(2),
    }
}

/// Shifts and scales the advantages so that those of the learnt rows have mean 0 and variance 1, or less if
/// their standard deviation is below `floor`. `agents_per_value` agents share an advantage.
fn normalise(mut advantages: Vec<f32>, policy_rows: &[u32], agents_per_value: usize, floor: f64) -> Vec<f32> {
    let learnt = policy_rows.iter().map(|row| advantages[*row as usize / agents_per_value]);
    let (mean, deviation) = mean_and_deviation(learnt);
    let scale = deviation.max(floor) + 1e-8;
    for advantage in &mut advantages {
        *advantage = ((f64::from(*advantage) - mean) / scale) as f32;
    }
    advantages
}

/// How far an update is.
struct Progress<'a> {
    sums: Sums,
    interrupted: &'a mut dyn FnMut() -> bool,
}

/// Sums over the minibatches of an update.
#[derive(Default)]
struct Sums {
    policy: PolicyStats,
    value_loss: f64,
    value_rows: f64,
    actor_norms: f64,
    actor_steps: f64,
    critic_norms: f64,
    critic_steps: f64,
}

impl Sums {
    fn stats(&self, settings: &StepSettings<'_>) -> UpdateStats {
        let rows = self.policy.rows.max(1.0);
        UpdateStats {
            policy_loss: self.policy.loss / rows,
            value_loss: self.value_loss / self.value_rows.max(1.0),
            entropy: self.policy.entropy / rows,
            kl: self.policy.kl / rows,
            clip_fraction: self.policy.clipped / rows,
            actor_grad_norm: self.actor_norms / self.actor_steps.max(1.0),
            critic_grad_norm: self.critic_norms / self.critic_steps.max(1.0),
            actor_lr: settings.actor_lr,
            entropy_weight: settings.entropy,
            ..UpdateStats::default()
        }
    }
}

#[cfg(test)]
mod tests;
