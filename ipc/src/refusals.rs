//! Refusals of requests. The first one reaches a learner in another process as a frame, where it waits for
//! its turn among the batches. Further ones would push batches out of the learner's queue, which has room for
//! one: they wait here until the learner has read that one and asks for them through the control socket.

use crate::wire::rejection_of;
use serde::{Deserialize, Serialize};
use smaclite_pool::Rejection;
use smaclite_pool::transport::{Epoch, RequestNumber};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// A request that was refused.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Refusal {
    /// The number of the request.
    pub request: u64,
    /// Why.
    pub rejection: Rejection,
}

/// The refusals of a lane that its learner has not read.
#[derive(Clone)]
pub(crate) struct Refusals {
    unread: Arc<Mutex<Unread>>,
    /// How many can wait: a request is about one environment at least, and each works on one at a time.
    limit: usize,
}

#[derive(Default)]
struct Unread {
    /// The epoch of the one that was sent as a frame.
    sent: Option<Epoch>,
    waiting: VecDeque<Refusal>,
}

impl Refusals {
    pub(crate) fn new(num_envs: usize) -> Refusals {
        Refusals { unread: Arc::default(), limit: num_envs }
    }

    /// Lets a refusal wait until it is asked for; `false` for the first one, which is to be sent as a frame.
    pub(crate) fn keep_unless_first(
        &self,
        epoch: Option<Epoch>,
        request: RequestNumber,
        text: &[u8],
    ) -> bool {
        let mut unread = self.unread.lock().unwrap_or_else(PoisonError::into_inner);
        if unread.sent != epoch {
            // What was refused in an earlier epoch is over.
            *unread = Unread { sent: epoch, waiting: VecDeque::new() };
            return false;
        }
        unread.waiting.push_back(Refusal { request: request.0, rejection: rejection_of(text) });
        if unread.waiting.len() > self.limit {
            unread.waiting.pop_front();
        }
        true
    }

    /// The learner has read the one that was sent: those that wait.
    pub(crate) fn take(&self) -> Vec<Refusal> {
        std::mem::take(&mut *self.unread.lock().unwrap_or_else(PoisonError::into_inner)).waiting.into()
    }
}
