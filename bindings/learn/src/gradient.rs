//! The gradient of a minibatch. Its rows are divided into jobs, whose gradients are summed in their order; so
//! the result depends neither on the number of threads nor on which of them is fast.

use crate::architecture::Workspace;
use crate::loss::{PolicyLoss, PolicyRow, PolicyStats, ValueLoss};
use crate::math::{add, vectorised};
use crate::parallel::{self, Interrupted};
use crate::rollout::Rollout;
use crate::team::{Network, Team};

/// Rows of one pass: enough for fast products, and few enough that their activations stay in the L2 cache.
const BLOCK: usize = 256;

/// Most jobs per network and minibatch. Their gradients must be summed, and more threads find no work.
const MAX_JOBS: usize = 16;

/// The data of an update, as rows of both networks.
pub(crate) struct Data<'a> {
    pub rollout: &'a Rollout,
    /// Inputs of the critic, `[rows, critic_size]`.
    pub critic_inputs: &'a [f32],
    pub critic_size: usize,
    /// Values per sample: 1, or one per agent.
    pub values_per_env: usize,
    /// By row of the critic: normalised.
    pub advantages: &'a [f32],
    /// By row of the critic: in units of the normaliser.
    pub old_values: &'a [f32],
    /// By row of the critic: in units of the normaliser.
    pub targets: &'a [f32],
}

/// The rows and constants of a minibatch.
pub(crate) struct Minibatch<'a> {
    pub policy_rows: &'a [u32],
    pub value_rows: &'a [u32],
    pub policy: PolicyLoss,
    pub value: ValueLoss,
}

/// The memory of a thread.
#[derive(Debug, Default)]
pub(crate) struct ThreadMemory {
    pub workspace: Workspace,
    inputs: Vec<f32>,
    ids: Vec<u16>,
    /// Of the actions of one row.
    powers: Vec<f32>,
}

/// The gradients of a minibatch, and sums over its rows.
#[derive(Debug, Default)]
pub(crate) struct Gradients {
    jobs: Vec<JobResult>,
    pub actor: Vec<f32>,
    pub critic: Vec<f32>,
    pub policy_stats: PolicyStats,
    pub value_loss: f64,
}

#[derive(Clone, Debug, Default)]
struct JobResult {
    gradient: Vec<f32>,
    policy_stats: PolicyStats,
    value_loss: f64,
}

/// Some rows of one network.
#[derive(Clone, Copy)]
enum Job<'a> {
    Actor(&'a [u32]),
    Critic(&'a [u32]),
}

impl Gradients {
    /// Computes the gradients of both losses, with one thread per memory.
    pub fn compute(
        &mut self,
        team: &Team,
        data: &Data<'_>,
        minibatch: &Minibatch<'_>,
        threads: &mut [ThreadMemory],
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<(), Interrupted> {
        let actor_jobs = split(minibatch.policy_rows).map(Job::Actor);
        let jobs: Vec<Job<'_>> = actor_jobs.chain(split(minibatch.value_rows).map(Job::Critic)).collect();
        self.jobs.resize(self.jobs.len().max(jobs.len()), JobResult::default());
        let results = &mut self.jobs[..jobs.len()];
        parallel::run(jobs.iter().zip(&mut *results), threads, interrupted, |(job, result), memory| {
            let network = job.network(team);
            result.reset(network.params.len());
            match job {
                Job::Actor(rows) => differentiate_policy(network, data, rows, minibatch, memory, result),
                Job::Critic(rows) => differentiate_values(network, data, rows, minibatch, memory, result),
            }
        })?;
        self.reset(team);
        for (job, result) in jobs.iter().zip(&self.jobs) {
            let sum = if let Job::Actor(_) = job { &mut self.actor } else { &mut self.critic };
            add(sum, &result.gradient);
            self.policy_stats.add(&result.policy_stats);
            self.value_loss += result.value_loss;
        }
        Ok(())
    }

    /// Of no row yet.
    pub fn reset(&mut self, team: &Team) {
        for (sum, network) in [(&mut self.actor, &team.actor), (&mut self.critic, &team.critic)] {
            sum.clear();
            sum.resize(network.params.len(), 0.0);
        }
        (self.policy_stats, self.value_loss) = (PolicyStats::default(), 0.0);
    }
}

impl JobResult {
    fn reset(&mut self, n_params: usize) {
        self.gradient.clear();
        self.gradient.resize(n_params, 0.0);
        (self.policy_stats, self.value_loss) = (PolicyStats::default(), 0.0);
    }
}

impl Job<'_> {
    fn network<'t>(&self, team: &'t Team) -> &'t Network {
        match self {
            Job::Actor(_) => &team.actor,
            Job::Critic(_) => &team.critic,
        }
    }
}

/// The rows of each job: as equal parts as can be, whose number depends on the number of rows alone.
fn split(rows: &[u32]) -> impl Iterator<Item = &[u32]> {
    let n_jobs = rows.len().div_ceil(BLOCK).min(MAX_JOBS);
    let begin = move |job: usize| rows.len() * job / n_jobs.max(1);
    (0..n_jobs).map(move |job| &rows[begin(job)..begin(job + 1)])
}

impl ThreadMemory {
    /// Copies rows of inputs, and notes their agents.
    fn gather(&mut self, inputs: &[f32], size: usize, rows: &[u32], n_agents: usize) {
        self.inputs.clear();
        self.ids.clear();
        for row in rows.iter().map(|row| *row as usize) {
            self.inputs.extend_from_slice(&inputs[row * size..][..size]);
            self.ids.push((row % n_agents) as u16);
        }
    }
}

fn differentiate_policy(
    network: &Network,
    data: &Data<'_>,
    rows: &[u32],
    minibatch: &Minibatch<'_>,
    memory: &mut ThreadMemory,
    result: &mut JobResult,
) {
    let Rollout { sizes, padded_actions, .. } = *data.rollout;
    let agents_per_value = sizes.n_agents / data.values_per_env;
    for rows in rows.chunks(BLOCK) {
        memory.gather(&data.rollout.obs, sizes.obs_size, rows, sizes.n_agents);
        let ThreadMemory { workspace, inputs, ids, powers } = memory;
        powers.resize(padded_actions, 0.0);
        network.forward(inputs, ids, workspace);
        let outputs = workspace.output();
        let stats = &mut result.policy_stats;
        vectorised(
            #[inline(always)]
            || {
                for (row, outputs) in rows.iter().zip(outputs.chunks_exact_mut(padded_actions)) {
                    let row = *row as usize;
                    let policy_row = PolicyRow {
                        mask: &data.rollout.masks[row * padded_actions..][..padded_actions],
                        action: usize::from(data.rollout.actions[row]),
                        old_log_prob: data.rollout.log_probs[row],
                        advantage: data.advantages[row / agents_per_value],
                    };
                    minibatch.policy.differentiate(&policy_row, outputs, powers, stats);
                }
            },
        );
        network.backward(inputs, ids, workspace, &mut result.gradient);
    }
}

fn differentiate_values(
    network: &Network,
    data: &Data<'_>,
    rows: &[u32],
    minibatch: &Minibatch<'_>,
    memory: &mut ThreadMemory,
    result: &mut JobResult,
) {
    for rows in rows.chunks(BLOCK) {
        memory.gather(data.critic_inputs, data.critic_size, rows, data.values_per_env);
        let ThreadMemory { workspace, inputs, ids, .. } = memory;
        network.forward(inputs, ids, workspace);
        let width = network.architecture.padded_out();
        for (row, outputs) in rows.iter().zip(workspace.output().chunks_exact_mut(width)) {
            let (old, target) = (data.old_values[*row as usize], data.targets[*row as usize]);
            let (loss, derivative) = minibatch.value.differentiate(outputs[0], old, target);
            outputs.fill(0.0);
            outputs[0] = derivative;
            result.value_loss += f64::from(loss);
        }
        network.backward(inputs, ids, workspace, &mut result.gradient);
    }
}

/// The outputs of the critic for all rows of `inputs`, `[rows, size]`.
pub(crate) fn values(
    network: &Network,
    inputs: &[f32],
    size: usize,
    values_per_env: usize,
    threads: &mut [ThreadMemory],
    interrupted: &mut dyn FnMut() -> bool,
) -> Result<Vec<f32>, Interrupted> {
    let mut values = vec![0.0; inputs.len() / size];
    let jobs = values.chunks_mut(BLOCK).zip(inputs.chunks(BLOCK * size)).enumerate();
    parallel::run(
        jobs,
        threads,
        interrupted,
        |(job, (values, inputs)), ThreadMemory { workspace, ids, .. }| {
            ids.clear();
            ids.extend((0..values.len()).map(|row| ((job * BLOCK + row) % values_per_env) as u16));
            network.forward(inputs, ids, workspace);
            let outputs = workspace.output().chunks_exact(network.architecture.padded_out());
            values.iter_mut().zip(outputs).for_each(|(value, outputs)| *value = outputs[0]);
        },
    )?;
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_have_every_row_once() {
        for n_rows in [0, 1, 255, 256, 257, 5000, 100_000] {
            let rows: Vec<u32> = (0..n_rows).collect();
            assert!(split(&rows).flatten().eq(&rows), "{n_rows}");
            assert!(split(&rows).count() <= MAX_JOBS && split(&rows).all(|rows| !rows.is_empty()));
        }
    }
}
