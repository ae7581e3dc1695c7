//! A learner that compares every frame it gets with the undisturbed run.

use super::{LanePlan, Replay};
use smaclite_ipc::{Batch, Client, ClientError, ConnectError, RuntimeDir, WaitOptions, WaitStrategy};
use std::time::Duration;

/// A client with the battles it should see.
pub struct Player {
    client: Client,
    replay: Replay,
    synchronous: bool,
    n_agents: usize,
    /// Environments that wait for actions.
    ready: Vec<i32>,
    sequence: u64,
}

/// What went wrong for a player.
#[derive(Debug, thiserror::Error)]
pub enum Trouble {
    /// The client's error.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// A frame that must not be.
    #[error("WRONG: {0}")]
    Wrong(String),
}

impl Player {
    /// Attaches to the plan's lane of pool `pool`.
    ///
    /// # Errors
    /// The client's.
    pub fn connect(runtime_dir: &RuntimeDir, pool: &str, plan: &LanePlan) -> Result<Player, ConnectError> {
        Player::connect_waiting(runtime_dir, pool, plan, WaitStrategy::default())
    }

    /// The same with a way of waiting.
    ///
    /// # Errors
    /// The client's.
    pub fn connect_waiting(
        runtime_dir: &RuntimeDir,
        pool: &str,
        plan: &LanePlan,
        wait: WaitStrategy,
    ) -> Result<Player, ConnectError> {
        let client = Client::connect(runtime_dir, pool, Some(&plan.name), wait)?;
        let (synchronous, n_agents) =
            (client.description().settings.is_synchronous(), client.description().sizes.n_agents);
        Ok(Player {
            client,
            replay: Replay::new(plan),
            synchronous,
            n_agents,
            ready: (0..plan.num_envs as i32).collect(),
            sequence: 0,
        })
    }

    /// The client.
    pub fn client(&mut self) -> &mut Client {
        &mut self.client
    }

    /// The undisturbed run.
    pub fn replay(&mut self) -> &mut Replay {
        &mut self.replay
    }

    /// Environments that wait for actions.
    pub fn ready(&self) -> &[i32] {
        &self.ready
    }

    /// Is the environment's episode over?
    pub fn is_over(&self, env: i32) -> bool {
        self.replay.is_over(env as usize)
    }

    /// Resets every environment and receives until all have answered.
    ///
    /// # Errors
    /// The client's, or a wrong frame.
    pub fn reset(&mut self, seed: Option<u64>, timeout: Duration) -> Result<(), Trouble> {
        self.client.send_reset(seed, None, WaitOptions::forever())?;
        self.replay.reset_all(seed);
        self.ready.clear();
        self.sequence = 0; // the client leaves out what is still to come of before
        let batches =
            self.client.description().settings.num_envs / self.client.description().settings.batch_size;
        (0..batches).try_for_each(|_| self.recv(timeout).map(drop))
    }

    /// Resets some environments, which must be ready; they answer like after a step. In synchronous mode the
    /// others come along as they are.
    ///
    /// # Errors
    /// The client's.
    pub fn send_reset(&mut self, envs: &[i32], seed: Option<u64>) -> Result<(), Trouble> {
        self.client.send_reset(seed, Some(envs), WaitOptions::forever())?;
        if self.synchronous {
            self.ready.drain(..).for_each(|env| self.replay.observe(env as usize));
        } else {
            self.ready.retain(|env| !envs.contains(env));
        }
        envs.iter().for_each(|env| self.replay.reset(*env as usize, seed));
        Ok(())
    }

    /// Sends actions to every environment that is ready.
    ///
    /// # Errors
    /// The client's.
    pub fn send(&mut self) -> Result<(), Trouble> {
        let envs = std::mem::take(&mut self.ready);
        self.send_to(&envs)
    }

    /// Sends actions to these environments, which must be ready.
    ///
    /// # Errors
    /// The client's.
    pub fn send_to(&mut self, envs: &[i32]) -> Result<(), Trouble> {
        let mut actions = vec![0; envs.len() * self.n_agents];
        for (env, row) in envs.iter().zip(actions.chunks_exact_mut(self.n_agents)) {
            self.replay.step(*env as usize, row);
        }
        let ids = if self.synchronous { None } else { Some(envs) };
        Ok(self.client.send(&actions, ids, WaitOptions::forever())?)
    }

    /// Receives a batch and compares it.
    ///
    /// # Errors
    /// The client's, or a wrong frame.
    pub fn recv(&mut self, timeout: Duration) -> Result<Batch, Trouble> {
        let batch = self.client.recv(WaitOptions { timeout: Some(timeout), interrupted: &mut || false })?;
        self.replay.check_all(&batch).map_err(Trouble::Wrong)?;
        if self.sequence != 0 && batch.sequence() != self.sequence + 1 {
            let what = format!("frame {} came after frame {}", batch.sequence(), self.sequence);
            return Err(Trouble::Wrong(what));
        }
        self.sequence = batch.sequence();
        self.ready.extend_from_slice(batch.env_id());
        if self.synchronous {
            self.ready.sort_unstable();
        }
        Ok(batch)
    }

    /// [`send`](Player::send) and [`recv`](Player::recv).
    ///
    /// # Errors
    /// The client's, or a wrong frame.
    pub fn step(&mut self, timeout: Duration) -> Result<Batch, Trouble> {
        self.send()?;
        self.recv(timeout)
    }
}
