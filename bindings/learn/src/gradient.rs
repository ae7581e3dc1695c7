//! The gradient of a minibatch of all maps. Its rows are divided into jobs, whose gradients are summed in
//! their order; so the result depends neither on the number of threads nor on which of them is fast.

use crate::architecture::Workspace;
use crate::loss::{PolicyLoss, PolicyRow, PolicyStats, ValueLoss};
use crate::math::{add, vectorised, zeros};
use crate::parallel::{self, Interrupted};
use crate::rollout::Rollout;
use crate::team::{Network, Team};
use crate::universal::Specialisation;

/// Rows of one pass: enough for fast products, and few enough that their activations stay in the L2 cache.
const BLOCK: usize = 256;

/// Most jobs per network, map and minibatch. Their gradients must be summed, and more threads find no work.
const MAX_JOBS: usize = 16;

/// The data of an update on one map, as rows of both networks.
pub(crate) struct Data<'a> {
    pub rollout: &'a Rollout,
    /// Inputs of the critic, `[rows, critic_size]`.
    pub critic_inputs: &'a [f32],
    pub critic_size: usize,
    /// Values per sample: 1, or one per agent.
    pub values_per_env: usize,
    /// By row of the critic, as the following two; normalised.
    pub advantages: Vec<f32>,
    /// In units of the normaliser.
    pub old_values: Vec<f32>,
    /// In units of the normaliser.
    pub returns: Vec<f32>,
}

/// What a map has in a minibatch.
pub(crate) struct Share<'a> {
    /// What acts on the map.
    pub team: &'a Team,
    /// How universal networks became that team.
    pub specialisations: Option<&'a [Specialisation; 2]>,
    pub data: &'a Data<'a>,
    pub policy_rows: &'a [u32],
    pub value_rows: &'a [u32],
}

/// The losses of a minibatch.
#[derive(Clone, Copy)]
pub(crate) struct Losses {
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

/// Some rows of one network on one map.
#[derive(Clone, Copy)]
struct Job<'a> {
    share: &'a Share<'a>,
    is_actor: bool,
    rows: &'a [u32],
}

impl Gradients {
    /// Computes the gradients of both losses over the rows of all maps, with one thread per memory.
    pub fn compute(
        &mut self,
        team: &Team,
        shares: &[Share<'_>],
        losses: Losses,
        threads: &mut [ThreadMemory],
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<(), Interrupted> {
        let jobs: Vec<Job<'_>> = shares.iter().flat_map(Share::jobs).collect();
        self.jobs.resize(self.jobs.len().max(jobs.len()), JobResult::default());
        let results = &mut self.jobs[..jobs.len()];
        parallel::run(jobs.iter().zip(&mut *results), threads, interrupted, |(job, result), memory| {
            result.reset(job.network().params.len());
            if job.is_actor {
                differentiate_policy(job, losses.policy, memory, result);
            } else {
                differentiate_values(job, losses.value, memory, result);
            }
        })?;
        self.reset(team);
        for (job, result) in jobs.iter().zip(&self.jobs) {
            let sum = if job.is_actor { &mut self.actor } else { &mut self.critic };
            match job.share.specialisations {
                None => add(sum, &result.gradient),
                Some([actor, critic]) => {
                    if job.is_actor { actor } else { critic }.take_back(&result.gradient, sum);
                }
            }
            self.policy_stats.add(&result.policy_stats);
            self.value_loss += result.value_loss;
        }
        Ok(())
    }

    /// Of no row yet.
    fn reset(&mut self, team: &Team) {
        for (sum, network) in [(&mut self.actor, &team.actor), (&mut self.critic, &team.critic)] {
            zeros(sum, network.params.len());
        }
        (self.policy_stats, self.value_loss) = (PolicyStats::default(), 0.0);
    }
}

impl JobResult {
    fn reset(&mut self, n_params: usize) {
        zeros(&mut self.gradient, n_params);
        (self.policy_stats, self.value_loss) = (PolicyStats::default(), 0.0);
    }
}

impl<'a> Share<'a> {
    fn jobs(&'a self) -> impl Iterator<Item = Job<'a>> {
        let of = |rows, is_actor| split(rows).map(move |rows| Job { share: self, is_actor, rows });
        of(self.policy_rows, true).chain(of(self.value_rows, false))
    }
}

impl<'a> Job<'a> {
    fn network(&self) -> &'a Network {
        if self.is_actor { &self.share.team.actor } else { &self.share.team.critic }
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

fn differentiate_policy(job: &Job<'_>, loss: PolicyLoss, memory: &mut ThreadMemory, result: &mut JobResult) {
    let (Job { share: Share { data, .. }, rows, .. }, network) = (job, job.network());
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
                    loss.differentiate(&policy_row, outputs, powers, stats);
                }
            },
        );
        network.backward(inputs, ids, workspace, &mut result.gradient);
    }
}

fn differentiate_values(job: &Job<'_>, loss: ValueLoss, memory: &mut ThreadMemory, result: &mut JobResult) {
    let (Job { share: Share { data, .. }, rows, .. }, network) = (job, job.network());
    for rows in rows.chunks(BLOCK) {
        memory.gather(data.critic_inputs, data.critic_size, rows, data.values_per_env);
        let ThreadMemory { workspace, inputs, ids, .. } = memory;
        network.forward(inputs, ids, workspace);
        let width = network.architecture.padded_out();
        for (row, outputs) in rows.iter().zip(workspace.output().chunks_exact_mut(width)) {
            let (old, target) = (data.old_values[*row as usize], data.returns[*row as usize]);
            let (error, derivative) = loss.differentiate(outputs[0], old, target);
            outputs.fill(0.0);
            outputs[0] = derivative;
            result.value_loss += f64::from(error);
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
