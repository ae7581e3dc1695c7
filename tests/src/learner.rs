//! A learner that compares every frame it receives with the reference.

use crate::reference::SavedEnv;
use crate::{LanePlan, Reference};
use smaclite_ipc::{Batch, Client, ClientError, ConnectError, Order, RuntimeDir, WaitOptions, WaitStrategy};
use std::sync::Arc;
use std::time::Duration;

/// A client, and what it must receive.
pub struct Learner {
    client: Client,
    reference: Reference,
    synchronous: bool,
    /// Environments that wait for actions.
    ready: Vec<i32>,
    sequence: u64,
    /// Requests that were refused since that frame.
    refused: u64,
}

/// What went wrong for a learner.
#[derive(Debug, thiserror::Error)]
pub enum LearnerError {
    /// The client's error.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// A frame that differs from the reference.
    #[error("WRONG FRAME: {0}")]
    Frame(String),
}

impl Learner {
    /// Attaches to the plan's lane of pool `pool`.
    ///
    /// # Errors
    /// The client's.
    pub fn connect(runtime_dir: &RuntimeDir, pool: &str, plan: &LanePlan) -> Result<Learner, ConnectError> {
        Learner::connect_waiting(runtime_dir, pool, plan, WaitStrategy::default())
    }

    /// The same with a wait strategy.
    ///
    /// # Errors
    /// The client's.
    pub fn connect_waiting(
        runtime_dir: &RuntimeDir,
        pool: &str,
        plan: &LanePlan,
        wait: WaitStrategy,
    ) -> Result<Learner, ConnectError> {
        let client = Client::connect(runtime_dir, pool, Some(&plan.name), wait, WaitOptions::no_wait())?;
        Ok(Learner::new(client, plan))
    }

    /// The learner of a client of the plan's lane.
    pub fn new(client: Client, plan: &LanePlan) -> Learner {
        let synchronous = client.description().settings.is_synchronous();
        let ready = (0..plan.num_envs as i32).collect();
        Learner { client, reference: Reference::new(plan), synchronous, ready, sequence: 0, refused: 0 }
    }

    /// The client.
    pub fn client(&mut self) -> &mut Client {
        &mut self.client
    }

    /// What the lane must produce.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// Environments that wait for actions.
    pub fn ready(&self) -> &[i32] {
        &self.ready
    }

    /// Resets every environment and receives until all have answered.
    ///
    /// # Errors
    /// The client's, or a wrong frame.
    pub fn reset(&mut self, seed: Option<u64>, timeout: Duration) -> Result<(), LearnerError> {
        self.client.send(Order::reset(seed), None, WaitOptions::forever())?;
        self.reference.reset_all(seed);
        self.ready.clear();
        self.sequence = 0; // the client drops frames of earlier requests
        let batches =
            self.client.description().settings.num_envs / self.client.description().settings.batch_size;
        (0..batches).try_for_each(|_| self.recv(timeout).map(drop))
    }

    /// Resets some environments, which must be ready; they answer as after a step. In synchronous mode the
    /// others are part of the batch, unchanged.
    ///
    /// # Errors
    /// The client's.
    pub fn send_reset(&mut self, envs: &[i32], seed: Option<u64>) -> Result<(), LearnerError> {
        self.order_some(Order::reset(seed), envs)?;
        for env in envs {
            self.reference.reset(*env, seed);
        }
        Ok(())
    }

    /// Copies environments, which must be ready, to others; in synchronous mode the rest is unchanged.
    ///
    /// # Errors
    /// The client's.
    pub fn send_fork(&mut self, from: &[i32], to: &[i32], seed: Option<u64>) -> Result<(), LearnerError> {
        self.order_some(Order::Fork { from, seeds: seed.into() }, to)?;
        // Each is copied as it was before.
        let saved: Vec<SavedEnv> = from.iter().map(|env| self.reference.save(*env)).collect();
        self.restore(to, &saved, seed);
        Ok(())
    }

    /// Continues environments, which must be ready, from snapshots, `[count, snapshot_size]`, that are equal
    /// to these states; in synchronous mode the rest is unchanged.
    ///
    /// # Errors
    /// The client's.
    pub fn send_restore(
        &mut self,
        snapshots: &[u8],
        saved: &[SavedEnv],
        to: &[i32],
        seed: Option<u64>,
    ) -> Result<(), LearnerError> {
        self.order_some(Order::Restore { snapshots, seeds: seed.into() }, to)?;
        self.restore(to, saved, seed);
        Ok(())
    }

    fn restore(&mut self, to: &[i32], saved: &[SavedEnv], seed: Option<u64>) {
        for (env, saved) in to.iter().zip(saved) {
            self.reference.restore(*env, saved, seed);
        }
    }

    /// Sends an order to some environments. In synchronous mode the others are part of the batch, unchanged.
    fn order_some(&mut self, order: Order<'_>, envs: &[i32]) -> Result<(), LearnerError> {
        self.client.send(order, Some(envs), WaitOptions::forever())?;
        if self.synchronous {
            for env in self.ready.drain(..) {
                self.reference.observe(env);
            }
        } else {
            self.ready.retain(|env| !envs.contains(env));
        }
        Ok(())
    }

    /// Sends actions to every environment that is ready.
    ///
    /// # Errors
    /// The client's.
    pub fn send(&mut self) -> Result<(), LearnerError> {
        let envs = std::mem::take(&mut self.ready);
        self.send_to(&envs)
    }

    /// Sends actions to these environments, which must be ready.
    ///
    /// # Errors
    /// The client's.
    pub fn send_to(&mut self, envs: &[i32]) -> Result<(), LearnerError> {
        let mut actions = Vec::new();
        for env in envs {
            let joint = self.reference.row(*env).legal_actions();
            self.reference.step(*env, &joint);
            actions.extend(joint);
        }
        let ids = if self.synchronous { None } else { Some(envs) };
        Ok(self.client.send(Order::Step(&actions), ids, WaitOptions::forever())?)
    }

    /// Receives a batch and compares it.
    ///
    /// # Errors
    /// The client's, or a wrong frame.
    pub fn recv(&mut self, timeout: Duration) -> Result<Arc<Batch>, LearnerError> {
        let received = self.client.recv(WaitOptions { timeout: Some(timeout), interrupted: &mut || false });
        if matches!(received, Err(ClientError::Rejected(_))) {
            self.refused += 1;
        }
        let batch = received?;
        self.reference.check(&batch).map_err(LearnerError::Frame)?;
        // A refusal takes a frame, unless the pool still keeps it after an earlier one.
        let next = self.sequence + 1..=self.sequence + 1 + std::mem::take(&mut self.refused);
        if self.sequence != 0 && !next.contains(&batch.sequence()) {
            let what = format!("frame {} came after frame {}", batch.sequence(), self.sequence);
            return Err(LearnerError::Frame(what));
        }
        self.sequence = batch.sequence();
        self.ready.extend_from_slice(batch.env_id());
        if self.synchronous {
            self.ready.sort_unstable();
        }
        Ok(batch)
    }

    /// [`send`](Learner::send) and [`recv`](Learner::recv).
    ///
    /// # Errors
    /// The client's, or a wrong frame.
    pub fn step(&mut self, timeout: Duration) -> Result<Arc<Batch>, LearnerError> {
        self.send()?;
        self.recv(timeout)
    }
}
