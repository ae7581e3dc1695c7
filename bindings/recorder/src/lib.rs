//! Recording environments of a running pool: `smaclite_ipc` follows them, and `smaclite_view` writes
//! replays. The command `record --pool` and the Python package use it.

#![forbid(unsafe_code)]

mod kept;

use kept::{Kept, MAX_TEXT, Start};
use smaclite_engine::{Battle, Snapshot, SnapshotError, Units};
use smaclite_ipc::{ClientError, ConnectError, Follower, RuntimeDir, WaitOptions};
use smaclite_view::{Replay, ReplayError};
use std::sync::Arc;

/// Follows environments and keeps what they did: per environment the newest complete episodes, and the
/// present one. An episode that began before the recorder is left out.
pub struct PoolRecorder {
    follower: Follower,
    kept: Kept,
    /// The units after a reset; `None` if they are drawn anew, so that an episode begins with a snapshot,
    /// which has them.
    fresh: Option<Units>,
}

/// Why a pool could not be recorded: it reports episodes, states or actions that are none of this release.
#[derive(Debug, thiserror::Error)]
#[error("this release does not play what the pool reports: {0}")]
#[allow(missing_docs)] // the inner errors say it
pub enum PoolRecorderError {
    Replay(#[from] ReplayError),
    Snapshot(#[from] SnapshotError),
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
        let arena = follower.arena();
        let scenario = follower.setup().files.scenario();
        let is_drawn = scenario.is_ok_and(|read| read.generation.is_some() || read.smacv2.is_some());
        let fresh = (!is_drawn).then(|| Battle::new(Arc::clone(arena), 0).units().clone());
        let kept = Kept::new(max_episodes, &arena.sizes(), MAX_TEXT);
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
            for part in piece.parts {
                let fresh = self.fresh.as_ref();
                self.kept.add(part, |start, is_first| start_of(start, is_first, fresh));
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

/// How an episode begins. The first one that is seen of an environment may have begun before.
fn start_of(start: &Snapshot, is_first: bool, fresh: Option<&Units>) -> Option<Start> {
    if start.episode_length == 0 && fresh == Some(&start.units) {
        Some(Start::Reset(start.generator.position(), start.opponent))
    } else if is_first && start.episode_length > 0 {
        None
    } else {
        Some(Start::Restored(Box::new(start.clone())))
    }
}
