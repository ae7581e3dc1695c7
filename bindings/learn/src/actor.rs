//! From a batch to actions. The first layer reads the observations in shared memory.

use crate::math::vectorised;
use crate::mlp::Workspace;
use crate::policy::{Choice, choose};
use crate::random::{Purpose, generator, uniform};
use crate::team::{Network, agent_ids};
use faer::MatRef;
use smaclite_engine::Sizes;
use smaclite_ipc::Batch;
use smaclite_pool::fields::Field;

/// The memory of inference. Rows are agents of environments of one lane.
#[derive(Debug, Default)]
pub(crate) struct Actor {
    workspace: Workspace,
    ids: Vec<u16>,
    /// Of the actions of one row.
    powers: Vec<f32>,
    /// `[rows, padded_actions]`.
    pub masks: Vec<u8>,
    /// `[rows]`.
    pub actions: Vec<i32>,
    /// `[rows]`.
    pub log_probs: Vec<f32>,
}

/// Where the random numbers of actions come from.
#[derive(Clone, Copy)]
pub(crate) struct Draw {
    pub seed: u64,
    pub purpose: Purpose,
    /// Steps before this one.
    pub step: u64,
    /// The number of the lane's first environment.
    pub first_env: usize,
}

impl Actor {
    /// Chooses an action for every agent. A dead agent has only no-op to choose.
    pub fn act(&mut self, network: &Network, sizes: Sizes, batch: &Batch, choice: Choice, draw: Draw) {
        let Sizes { n_agents, n_actions, obs_size, .. } = sizes;
        let obs = batch.obs();
        let x = MatRef::from_row_major_slice(obs, obs.len() / obs_size, obs_size); // no copy of shared memory
        let (rows, padded) = (x.nrows(), network.mlp.padded_out());
        if self.ids.len() != rows {
            self.ids = agent_ids(rows, n_agents);
            (self.actions, self.log_probs) = (vec![0; rows], vec![0.0; rows]);
            (self.masks, self.powers) = (vec![0; rows * padded], vec![0.0; padded]);
        }
        let available: &[u8] = batch.field(Field::AvailActions).unwrap_or(&[]);
        for (padded, mask) in self.masks.chunks_exact_mut(padded).zip(available.chunks_exact(n_actions)) {
            padded[..n_actions].copy_from_slice(mask);
        }
        network.forward(x, &self.ids, &mut self.workspace);
        let Actor { workspace, masks, actions, log_probs, powers, .. } = self;
        let rows = workspace.output().chunks_exact_mut(padded).zip(masks.chunks_exact(padded));
        let chosen = actions.iter_mut().zip(log_probs.iter_mut());
        let mut generators = (0..)
            .map(|env: u64| generator(draw.seed, draw.purpose, [draw.step, draw.first_env as u64 + env]));
        let mut current = generators.next();
        vectorised(
            #[inline(always)]
            || {
                for (row, ((outputs, mask), (action, log_prob))) in rows.zip(chosen).enumerate() {
                    if row > 0 && row % n_agents == 0 {
                        current = generators.next();
                    }
                    let random = current.as_mut().map_or(0.0, uniform);
                    let (choice, log) = choose(outputs, mask, powers, choice, random);
                    (*action, *log_prob) = (choice as i32, log);
                }
            },
        );
    }
}
