//! The requests of a lane with a learner for each side: those of the two are carried out together, in their
//! order. The lane gives both learners one session, and both count their requests from its beginning.

use crate::rejection::Rejection;
use crate::transport::{MAX_AHEAD, Message, Request, RequestKind};
use smaclite_engine::Faction;
use std::collections::VecDeque;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

/// A request, or those of the learners of both sides, which are carried out together.
pub(super) enum Incoming<M> {
    Whole(M),
    /// Of the allies, and of the enemies.
    Halves(M, M),
}

/// A request that is checked and carried out.
pub(super) struct Joint<'a> {
    /// Of the only learner, or of that of the allies.
    pub(super) first: Request<'a>,
    /// Of the learner of the enemies.
    pub(super) enemies: Option<Request<'a>>,
}

impl<M: Message> Incoming<M> {
    pub(super) fn request(&self) -> Joint<'_> {
        match self {
            Incoming::Whole(message) => Joint { first: message.request(), enemies: None },
            Incoming::Halves(allies, enemies) => {
                Joint { first: allies.request(), enemies: Some(enemies.request()) }
            }
        }
    }

    pub(super) fn waited(&self) -> Duration {
        match self {
            Incoming::Whole(message) => message.waited(),
            // The pool waited for the later one.
            Incoming::Halves(allies, enemies) => allies.waited().min(enemies.waited()),
        }
    }
}

impl Joint<'_> {
    /// Whether a learner of one side may ask for this, and both want the same.
    pub(super) fn check(&self) -> Result<(), Rejection> {
        std::iter::once(&self.first).chain(&self.enemies).try_for_each(check_side)?;
        let Some(enemies) = &self.enemies else { return Ok(()) };
        let Request { number, kind, env_ids, .. } = self.first;
        let is_same_kind = matches!(
            (kind, enemies.kind),
            (RequestKind::Step, RequestKind::Step) | (RequestKind::Reset { .. }, RequestKind::Reset { .. })
        );
        let mut ids = env_ids.iter().zip(enemies.env_ids);
        let are_same_envs = env_ids.len() == enemies.env_ids.len()
            && ids.all(|(id, other)| id.load(Relaxed) == other.load(Relaxed));
        if is_same_kind && are_same_envs && number == enemies.number {
            Ok(())
        } else {
            Err(Rejection::DifferentRequests { number: number.0 })
        }
    }

    /// The kind; of a reset the first seed that is given.
    pub(super) fn kind(&self) -> RequestKind {
        match (self.first.kind, self.enemies.map(|enemies| enemies.kind)) {
            (RequestKind::Reset { seed, levels }, Some(RequestKind::Reset { seed: of_enemies, .. })) => {
                RequestKind::Reset { seed: seed.or(of_enemies), levels }
            }
            (kind, _) => kind,
        }
    }
}

/// What only the learner of both sides may ask for. Our own client refuses it, too.
fn check_side(request: &Request<'_>) -> Result<(), Rejection> {
    match request.kind {
        RequestKind::Step | RequestKind::Reset { levels: false, .. } => Ok(()),
        _ if request.side.is_none() => Ok(()),
        _ => {
            let what = "a learner of one side cannot restore or fork battles or choose levels".to_owned();
            Err(Rejection::Malformed { what })
        }
    }
}

/// Requests of the learner of one side that wait for those of the other's, by side: at most [`MAX_AHEAD`],
/// since the transport lends a lane only so many.
pub(super) struct Halves<M>([VecDeque<M>; 2]);

/// What became of a request of one side.
pub(super) enum Paired<M> {
    /// It waits for that of the other side.
    Waits,
    /// Those of the two sides that are carried out next.
    Both(Incoming<M>),
    /// Too many of its side wait already.
    TooMany(M),
}

impl<M: Message> Halves<M> {
    pub(super) fn new() -> Halves<M> {
        Halves([VecDeque::new(), VecDeque::new()])
    }

    pub(super) fn clear(&mut self) {
        self.0.iter_mut().for_each(VecDeque::clear);
    }

    /// Drops the requests of a side.
    pub(super) fn drop_side(&mut self, side: Faction) {
        self.0[side as usize].clear();
    }

    /// Takes the oldest request of a side.
    pub(super) fn take(&mut self, side: Faction) -> Option<M> {
        self.0[side as usize].pop_front()
    }

    /// Adds a request, and takes the oldest of either side if both have one.
    pub(super) fn pair(&mut self, side: Faction, message: M) -> Paired<M> {
        let own = &mut self.0[side as usize];
        if own.len() == MAX_AHEAD {
            return Paired::TooMany(message);
        }
        own.push_back(message);
        let [allies, enemies] = &mut self.0;
        if allies.is_empty() || enemies.is_empty() {
            return Paired::Waits;
        }
        let pair = allies.pop_front().zip(enemies.pop_front());
        pair.map_or(Paired::Waits, |(allies, enemies)| Paired::Both(Incoming::Halves(allies, enemies)))
    }
}
