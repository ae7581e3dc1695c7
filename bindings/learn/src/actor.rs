//! From observations to actions. The first layer reads the observations in shared memory.

use crate::architecture::Workspace;
use crate::math::{vectorised, zeros};
use crate::policy::{Choice, choose};
use crate::random::{Purpose, generator, uniform};
use crate::team::{Network, agent_ids};
use smaclite_engine::Sizes;

/// The memory of inference. Rows are agents of environments.
#[derive(Debug, Default)]
pub(crate) struct Actor {
    workspace: Workspace,
    ids: Vec<u16>,
    /// Of the actions of one row.
    powers: Vec<f32>,
    pub chosen: Chosen,
}

/// What a policy chose, by row.
#[derive(Debug, Default)]
pub(crate) struct Chosen {
    /// `[rows, padded_actions]`.
    pub masks: Vec<u8>,
    /// `[rows]`.
    pub actions: Vec<i32>,
    /// `[rows]`.
    pub log_probs: Vec<f32>,
}

impl Chosen {
    /// That many rows, with no-op alone.
    pub fn clear(&mut self, rows: usize, padded: usize) {
        zeros(&mut self.masks, rows * padded);
        zeros(&mut self.actions, rows);
        zeros(&mut self.log_probs, rows);
    }

    /// Copies the rows of environment `from_env` of another choice to those of environment `env`.
    pub fn copy_env(&mut self, env: usize, from: &Chosen, from_env: usize, n_agents: usize) {
        let masks = n_agents * (from.masks.len() / from.actions.len());
        self.masks[env * masks..][..masks].copy_from_slice(&from.masks[from_env * masks..][..masks]);
        let (to, rows) = (env * n_agents, from_env * n_agents..(from_env + 1) * n_agents);
        self.actions[to..][..n_agents].copy_from_slice(&from.actions[rows.clone()]);
        self.log_probs[to..][..n_agents].copy_from_slice(&from.log_probs[rows]);
    }
}

/// What a policy chooses from: the rows of some environments.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a> {
    pub sizes: Sizes,
    /// `[environments, n_agents, obs_size]`.
    pub obs: &'a [f32],
    /// `[environments, n_agents, n_actions]`.
    pub available: &'a [u8],
}

/// Where the random numbers of actions come from.
#[derive(Clone, Copy)]
pub(crate) struct Draw {
    pub seed: u64,
    pub purpose: Purpose,
    /// Steps before this one.
    pub step: u64,
}

impl Actor {
    /// Chooses an action for every agent of the environments with these numbers. A dead agent has only
    /// no-op to choose.
    pub fn act(
        &mut self,
        network: &Network,
        rows: Rows<'_>,
        choice: Choice,
        draw: Draw,
        envs: impl Iterator<Item = usize>,
    ) {
        let Rows { sizes: Sizes { n_agents, n_actions, obs_size, .. }, obs, available } = rows;
        let (rows, padded) = (obs.len() / obs_size, network.architecture.padded_out());
        if self.ids.len() != rows {
            self.ids = agent_ids(rows, n_agents);
            self.chosen.clear(rows, padded);
        }
        self.powers.resize(padded, 0.0);
        let masks = self.chosen.masks.chunks_exact_mut(padded);
        for (padded, mask) in masks.zip(available.chunks_exact(n_actions)) {
            padded[..n_actions].copy_from_slice(mask);
        }
        network.forward(obs, &self.ids, &mut self.workspace);
        let Actor { workspace, chosen: Chosen { masks, actions, log_probs }, powers, .. } = self;
        let rows = workspace.output().chunks_exact_mut(padded).zip(masks.chunks_exact(padded));
        let chosen = actions.iter_mut().zip(log_probs.iter_mut());
        let mut generators = envs.map(|env| generator(draw.seed, draw.purpose, [draw.step, env as u64]));
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
