//! Recording environments of a running pool: `smaclite_ipc` follows them, and `smaclite_view` writes
//! replays. The command `record --pool` and the Python package use it.

#![forbid(unsafe_code)]

mod kept;

use kept::{Kept, MAX_TEXT, Start};
use smaclite_engine::{Battle, Snapshot, SnapshotError, Units};
use smaclite_ipc::{ClientError, ConnectError, FollowedPart, Follower, RuntimeDir, WaitOptions};
use smaclite_view::{Replay, ReplayError};
use std::sync::Arc;

/// Follows environments and keeps what they did: per environment the newest complete episodes, and the
/// present one. An episode that began before the recorder is left out.
pub struct PoolRecorder {
    follower: Follower,
    kept: Kept,
    fresh: Fresh,
}

/// Why a pool could not be recorded.
#[derive(Debug, thiserror::Error)]
pub enum PoolRecorderError {
    /// The pool's answer is not what this release plays.
    #[error("this release does not play what the pool reports: {0}")]
    Replay(#[from] ReplayError),
    /// A state that the pool reports is not one of the scenario.
    #[error("this release does not play what the pool reports: {0}")]
    Snapshot(#[from] SnapshotError),
    /// An action that the pool reports is not available.
    #[error("this release does not play what the pool reports: {0}")]
    Action(#[from] smaclite_engine::IllegalAction),
}

impl PoolRecorder {
    /// Follows environments of a lane, of the only lane if none is named.
    ///
    /// # Errors
    /// As [`Follower::connect`].
    pub fn connect(
        runtime_dir: &RuntimeDir,
        pool: &str,
        lane: Option<&str>,
        env_ids: &[usize],
        max_episodes: usize,
        wait: WaitOptions<'_>,
    ) -> Result<PoolRecorder, ConnectError> {
        let follower = Follower::connect(runtime_dir, pool, lane, env_ids, wait)?;
        // Files that are no scenario are an error of `replay`.
        let arena = follower.setup().arena().ok();
        // The learner of the lane sees one side where a team plays the other.
        let sizes = arena.as_ref().map_or(follower.description().sizes, |(_, arena)| arena.sizes());
        let fresh = match arena {
            None => Fresh::Any,
            Some((scenario, _)) if scenario.generation.is_some() || scenario.smacv2.is_some() => Fresh::None,
            Some((_, arena)) => Fresh::Units(Box::new(Battle::new(Arc::new(arena), 0).units().clone())),
        };
        let kept = Kept::new(max_episodes, &sizes, MAX_TEXT);
        Ok(PoolRecorder { follower, kept, fresh })
    }

    /// Receives what happened since the last call. The logs of a lane keep
    /// [`MAX_LOG_BYTES`](smaclite_ipc::MAX_LOG_BYTES); if there was more, the oldest episodes are lost.
    ///
    /// # Errors
    /// As [`Follower::read`]; what was received before stays.
    pub fn read(&mut self, mut wait: WaitOptions<'_>) -> Result<(), ClientError> {
        loop {
            let piece = self.follower.read(wait.reborrow())?;
            for FollowedPart { env_id, part } in piece.parts {
                self.kept.add(env_id, part, |start, is_first| self.fresh.start_of(start, is_first));
            }
            if !piece.more {
                return Ok(());
            }
        }
    }

    /// Number of episodes of which the end was received since the recorder began; it keeps the newest.
    pub fn n_complete(&self) -> u64 {
        self.kept.n_complete()
    }

    /// Number of episodes that were lost since the recorder began: the pool dropped them before they were
    /// read, or this recorder to limit its memory.
    pub fn n_lost(&self) -> u64 {
        self.kept.n_lost()
    }

    /// Number of episodes that a replay would have if none had been lost: of an environment of which enough
    /// complete ones are kept, none is missing.
    pub fn n_missing(&self) -> u64 {
        self.kept.n_missing()
    }

    /// Plays the episodes again: a replay with their checksums, by environment; with those that did not end,
    /// or without.
    ///
    /// # Errors
    /// If this release plays other battles than the pool.
    pub fn replay(&self, with_incomplete: bool) -> Result<Replay, PoolRecorderError> {
        self.kept.replay(self.follower.setup(), with_incomplete)
    }
}

/// The units after a reset.
enum Fresh {
    /// The scenario is not known.
    Any,
    /// They are drawn anew, so an episode begins with a snapshot, which has them.
    None,
    Units(Box<Units>),
}

impl Fresh {
    /// How an episode begins. The first one that is seen of an environment may have begun before.
    fn start_of(&self, start: &Snapshot, is_first: bool) -> Option<Start> {
        let is_fresh = match self {
            Fresh::Any => true,
            Fresh::None => false,
            Fresh::Units(fresh) => **fresh == start.units,
        };
        if start.episode_length == 0 && is_fresh {
            Some(Start::Reset(start.generator.position(), start.opponent))
        } else if is_first && start.episode_length > 0 {
            None
        } else {
            Some(Start::Restored(Box::new(start.clone())))
        }
    }
}
