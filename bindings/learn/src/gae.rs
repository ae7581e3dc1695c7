//! Generalised advantage estimation (Schulman et al., 2016).
//!
//! The error of the critic in one step is δ_t = r_t + γ V_{t+1} - V_t, and the advantage is the sum of the
//! errors that follow, each discounted by γλ: A_t = δ_t + γλ A_{t+1}.
//!
//! - A battle that ended has no future: if step t terminated, V_{t+1} counts as 0.
//! - A battle that was cut off has one: if step t was truncated, V_{t+1} is the value of the episode's last
//!   state, as in any other step. The same holds at the end of the rollout.
//! - Either way the errors that follow belong to another episode, so A_{t+1} counts as 0.
//!
//! Under next-step autoreset the observation after step t is always that of the same episode, so V_{t+1}
//! needs no special case. The step that follows the last one of an episode only resets the environment.
//! Nothing is learnt from it, and its advantage reaches no other step.

/// What GAE needs to know of a rollout of `horizon` steps of `num_envs` environments.
pub(crate) struct Steps<'a> {
    /// `[horizon, num_envs]`.
    pub rewards: &'a [f32],
    /// `[horizon, num_envs]`: the step ended the battle.
    pub terminated: &'a [bool],
    /// `[horizon, num_envs]`: the step reached the episode limit.
    pub truncated: &'a [bool],
    pub num_envs: usize,
}

/// Writes the advantages, `[horizon, num_envs, values per environment]`, of `values`, which have one more
/// step.
pub(crate) fn advantages(steps: &Steps<'_>, values: &[f32], gamma: f64, lambda: f64, out: &mut [f32]) {
    let Steps { rewards, terminated, truncated, num_envs } = *steps;
    let horizon = rewards.len() / num_envs;
    let width = values.len() / (horizon + 1); // values per step
    let per_env = width / num_envs;
    let (gamma, decay) = (gamma as f32, (gamma * lambda) as f32);
    let mut next = vec![0.0; width];
    for t in (0..horizon).rev() {
        for (i, next) in next.iter_mut().enumerate() {
            let step = t * num_envs + i / per_env;
            let future = if terminated[step] { 0.0 } else { values[(t + 1) * width + i] };
            let error = rewards[step] + gamma * future - values[t * width + i];
            let is_over = terminated[step] || truncated[step];
            *next = error + if is_over { 0.0 } else { decay * *next };
            out[t * width + i] = *next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Purpose, generator, uniform};

    /// The definition: the sum of the discounted errors until the episode or the rollout ends.
    fn naive(steps: &Steps<'_>, values: &[f32], per_env: usize, t: usize, i: usize) -> f64 {
        let (num_envs, width) = (steps.num_envs, steps.num_envs * per_env);
        let (mut sum, mut factor) = (0.0, 1.0);
        for k in t..steps.rewards.len() / num_envs {
            let step = k * num_envs + i / per_env;
            let value = |k: usize| f64::from(values[k * width + i]);
            let future = if steps.terminated[step] { 0.0 } else { value(k + 1) };
            sum += factor * (f64::from(steps.rewards[step]) + 0.9 * future - value(k));
            factor *= 0.9 * 0.8;
            if steps.terminated[step] || steps.truncated[step] {
                break;
            }
        }
        sum
    }

    #[test]
    fn advantages_are_the_sum_of_discounted_errors() {
        let mut generator = generator(3, Purpose::Weights, [0, 0]);
        let (horizon, num_envs) = (17, 3);
        for per_env in [1, 2] {
            let mut random = |n: usize| (0..n).map(|_| uniform(&mut generator)).collect::<Vec<f32>>();
            let (rewards, ends) = (random(horizon * num_envs), random(horizon * num_envs));
            let values = random((horizon + 1) * num_envs * per_env);
            let steps = Steps {
                rewards: &rewards,
                terminated: &ends.iter().map(|x| *x < 0.1).collect::<Vec<_>>(),
                truncated: &ends.iter().map(|x| *x > 0.9).collect::<Vec<_>>(),
                num_envs,
            };
            let mut out = vec![0.0; horizon * num_envs * per_env];
            advantages(&steps, &values, 0.9, 0.8, &mut out);
            for (k, advantage) in out.iter().enumerate() {
                let width = num_envs * per_env;
                let expected = naive(&steps, &values, per_env, k / width, k % width);
                assert!((f64::from(*advantage) - expected).abs() < 1e-5, "{k}: {advantage} {expected}");
            }
        }
    }
}
