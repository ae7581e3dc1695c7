//! One update of proximal policy optimisation: from the rollouts of all maps to better networks.

mod part;

use crate::adam::clip;
use crate::config::Config;
use crate::gradient::{Data, Gradients, Losses, Share, ThreadMemory};
use crate::loss::{PolicyLoss, PolicyStats, ValueLoss};
use crate::math::mean_and_deviation;
use crate::parallel::Interrupted;
use crate::team::{Network, Team};
use part::Part;
pub(crate) use part::Played;
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

impl Ppo {
    pub fn new(threads: usize) -> Ppo {
        let threads = (0..threads.max(1)).map(|_| ThreadMemory::default()).collect();
        Ppo { threads, gradients: Gradients::default() }
    }

    /// Trains the team on what was played on its maps. `update` counts the updates of the run, and `steps` is
    /// the number of environment steps before.
    pub fn update(
        &mut self,
        team: &mut Team,
        played: Vec<Played<'_>>,
        config: &Config,
        update: u64,
        steps: u64,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<UpdateStats, UpdateError> {
        let threads = &mut self.threads;
        let parts = played.into_iter().map(|played| Part::new(played, team, config, threads, interrupted));
        let mut parts = parts.collect::<Result<Vec<Part<'_>>, Interrupted>>()?;
        let explained_variance = estimate(team, &mut parts, config);
        let (_, deviation) = team.normaliser.mean_and_deviation();
        let floor = config.advantage_floor * deviation;
        for part in &mut parts {
            let agents_per_value = part.played.rollout.sizes.n_agents / part.data.values_per_env;
            normalise(&mut part.data.advantages, &part.policy_rows, agents_per_value, floor);
        }
        let (learnt, all) = parts.iter().fold((0, 0), |(learnt, all), part| {
            (learnt + part.policy_rows.len(), all + part.played.rollout.actions.len())
        });
        let settings = StepSettings::new(config, update, steps);
        let mut progress = Progress { sums: Sums::default(), interrupted };
        for epoch in 0..config.epochs as u64 {
            self.epoch(team, &mut parts, &settings, epoch, &mut progress)?;
        }
        let policy_rows = learnt as f64 / all as f64;
        Ok(UpdateStats { policy_rows, explained_variance, ..progress.sums.stats(&settings) })
    }

    /// One pass over the samples, in minibatches of another order. Each has the same share of every map.
    fn epoch(
        &mut self,
        team: &mut Team,
        parts: &mut [Part<'_>],
        settings: &StepSettings<'_>,
        epoch: u64,
        progress: &mut Progress<'_>,
    ) -> Result<(), UpdateError> {
        parts.iter_mut().for_each(|part| part.shuffle(settings.update, epoch));
        for i in 0..settings.config.minibatches {
            self.step(team, parts, i, settings, progress)?;
        }
        Ok(())
    }

    /// One gradient step of both networks, with minibatch `i`.
    fn step(
        &mut self,
        team: &mut Team,
        parts: &mut [Part<'_>],
        i: usize,
        settings: &StepSettings<'_>,
        progress: &mut Progress<'_>,
    ) -> Result<(), UpdateError> {
        let Progress { sums, interrupted } = progress;
        let Ppo { threads, gradients } = self;
        parts.iter_mut().for_each(|part| part.played.specialise(team));
        let shares: Vec<Share<'_>> =
            parts.iter().map(|part| part.share(team, i, settings.config.minibatches)).collect();
        let count = |rows: fn(&Share<'_>) -> usize| shares.iter().map(rows).sum::<usize>();
        let policy_rows = count(|share| share.policy_rows.len());
        let value_rows = count(|share| share.value_rows.len());
        let losses = settings.losses(policy_rows, value_rows);
        gradients.compute(team, &shares, losses, threads, interrupted)?;
        sums.policy.add(&gradients.policy_stats);
        sums.value_loss += gradients.value_loss;
        let step = |network: &mut Network, gradient: &mut [f32], lr: f64, name| {
            let norm = clip(gradient, settings.config.max_grad_norm);
            if !norm.is_finite() {
                return Err(UpdateError::Diverged(Diverged { network: name, update: settings.update }));
            }
            network.adam.step(&mut network.params, gradient, lr, settings.config.adam_eps);
            Ok(norm)
        };
        if policy_rows > 0 {
            sums.actor_norms += step(&mut team.actor, &mut gradients.actor, settings.actor_lr, "actor")?;
            sums.actor_steps += 1.0;
        }
        if value_rows > 0 {
            sums.critic_norms += step(&mut team.critic, &mut gradients.critic, settings.critic_lr, "critic")?;
            sums.critic_steps += 1.0;
        }
        sums.value_rows += value_rows as f64;
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

    /// The losses of a minibatch, means over its rows of all maps.
    fn losses(&self, policy_rows: usize, value_rows: usize) -> Losses {
        let Config { clip, value_clip, huber, .. } = *self.config;
        let mean = |rows: usize| 1.0 / rows.max(1) as f32;
        Losses {
            policy: PolicyLoss { clip: clip as f32, entropy: self.entropy as f32, scale: mean(policy_rows) },
            value: ValueLoss { clip: value_clip as f32, huber: huber as f32, scale: mean(value_rows) },
        }
    }
}

/// Estimates advantages and returns, and adapts the units of the critic to the returns. Returns the share of
/// their variance that the critic predicted.
fn estimate(team: &mut Team, parts: &mut [Part<'_>], config: &Config) -> f64 {
    let (mean, deviation) = team.normaliser.mean_and_deviation();
    parts.iter_mut().for_each(|part| part.estimate(mean, deviation, config));
    let returns = parts.iter().flat_map(|part| part.learnt(&part.data.returns));
    let errors = parts.iter().flat_map(|part| part.learnt(&part.data.advantages));
    let (_, spread) = mean_and_deviation(returns.clone());
    let (_, error) = mean_and_deviation(errors);
    team.observe_returns(returns);
    let (mean, deviation) = team.normaliser.mean_and_deviation();
    for part in parts {
        let to_units = |value: &mut f32| *value = ((f64::from(*value) - mean) / deviation) as f32;
        let Data { old_values, returns, .. } = &mut part.data;
        old_values.truncate(returns.len());
        old_values.iter_mut().chain(returns).for_each(to_units);
    }
    1.0 - (error / spread).powi(2)
}

/// Shifts and scales the advantages so that those of the learnt rows have mean 0 and variance 1, or less if
/// their standard deviation is below `floor`. `agents_per_value` agents share an advantage.
fn normalise(advantages: &mut [f32], policy_rows: &[u32], agents_per_value: usize, floor: f64) {
    let learnt = policy_rows.iter().map(|row| advantages[*row as usize / agents_per_value]);
    let (mean, deviation) = mean_and_deviation(learnt);
    let scale = deviation.max(floor) + 1e-8;
    for advantage in advantages {
        *advantage = ((f64::from(*advantage) - mean) / scale) as f32;
    }
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
