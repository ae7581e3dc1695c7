//! One check for every way to step a lane: what a learner receives is what its environments produce when they
//! are stepped one by one. A new way costs an implementation of [`Stepping`].

use crate::{LanePlan, Reference, Row};
use smaclite_ipc::{Client, Order, WaitOptions};
use smaclite_pool::Autoreset;
use std::time::Duration;

/// Long enough for valgrind and Miri; only a test that fails waits for it.
const TIMEOUT: Duration = Duration::from_secs(30);

/// A learner, whatever is between it and its lane.
pub trait Stepping {
    /// Resets environments, or all of them, which begins an epoch.
    fn send_reset(&mut self, seed: Option<u64>, env_ids: Option<&[i32]>);
    /// Sends actions, `[count, n_actors]`.
    fn send_step(&mut self, env_ids: &[i32], actions: &[i32]);
    /// The slots of the next batch.
    fn batch(&mut self) -> Vec<Row>;
}

/// Embedded, or of another process.
impl Stepping for Client {
    fn send_reset(&mut self, seed: Option<u64>, env_ids: Option<&[i32]>) {
        Client::send(self, Order::reset(seed), env_ids, WaitOptions::forever()).expect("sent");
    }

    fn send_step(&mut self, env_ids: &[i32], actions: &[i32]) {
        self.send(Order::Step(actions), Some(env_ids), WaitOptions::forever()).expect("sent");
    }

    fn batch(&mut self) -> Vec<Row> {
        let wait = WaitOptions { timeout: Some(TIMEOUT), interrupted: &mut || false };
        let batch = self.recv(wait).expect("a batch");
        (0..batch.layout().slots()).map(|slot| Row::read(batch.bytes(), batch.layout(), slot)).collect()
    }
}

/// A learner with the environments whose next row is still to come.
struct Episodes<'a, S> {
    plan: &'a LanePlan,
    learner: &'a mut S,
    reference: Reference,
    is_awaited: Vec<bool>,
}

/// Steps a lane until that many batches came, and compares every row.
///
/// # Panics
/// If one is wrong; `context` is part of the message.
pub fn check(plan: &LanePlan, learner: &mut impl Stepping, batches: usize, context: &str) {
    let (reference, is_awaited) = (Reference::new(plan), vec![true; plan.num_envs]);
    let mut episodes = Episodes { plan, learner, reference, is_awaited };
    episodes.learner.send_reset(Some(7), None);
    episodes.reference.reset_all(Some(7));
    for _ in 0..batches {
        let rows = episodes.learner.batch();
        episodes.compare(&rows, context);
        episodes.answer(rows);
    }
}

impl<S: Stepping> Episodes<'_, S> {
    fn compare(&mut self, rows: &[Row], context: &str) {
        for (slot, row) in rows.iter().enumerate() {
            let env = row.env() as usize;
            assert!(!self.is_synchronous() || env == slot, "{context}: slot {slot} is environment {env}");
            assert!(std::mem::take(&mut self.is_awaited[env]), "{context}: environment {env} came twice");
            let difference = row.difference(self.reference.row(row.env()));
            assert_eq!(difference, None, "environment {env}: {context}");
        }
    }

    /// Resets environments whose episode ended where that is left to the learner, and steps the others.
    fn answer(&mut self, rows: Vec<Row>) {
        let by_hand = self.plan.autoreset == Autoreset::Disabled;
        let (ended, going): (Vec<Row>, Vec<Row>) = rows.into_iter().partition(|row| by_hand && row.ended());
        if !ended.is_empty() {
            let ended: Vec<_> = ended.iter().map(Row::env).collect();
            for env in &ended {
                self.is_awaited[*env as usize] = true;
                self.reference.reset(*env, None);
            }
            let is_all = ended.len() == self.plan.num_envs;
            self.learner.send_reset(None, (!is_all).then_some(&*ended));
            if self.is_synchronous() {
                // The batch also has the others, unchanged; all are stepped next time.
                for row in &going {
                    self.is_awaited[row.env() as usize] = true;
                    self.reference.observe(row.env());
                }
                return;
            }
        }
        if !going.is_empty() {
            let (mut env_ids, mut actions) = (Vec::new(), Vec::new());
            for row in &going {
                self.is_awaited[row.env() as usize] = true;
                let joint = row.legal_actions();
                self.reference.step(row.env(), &joint);
                env_ids.push(row.env());
                actions.extend(joint);
            }
            self.learner.send_step(&env_ids, &actions);
        }
    }

    fn is_synchronous(&self) -> bool {
        self.plan.batch_size == self.plan.num_envs
    }
}
