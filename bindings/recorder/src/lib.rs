//! Recording environments of a running pool: `smaclite_ipc` follows them, and `smaclite_view` writes
//! replays. The command `record --pool` and the Python package use it.

#![forbid(unsafe_code)]

use smaclite_engine::StreamPosition;
use smaclite_ipc::{ClientError, ConnectError, EpisodePart, FollowedPart, Follower, RuntimeDir};
use smaclite_view::{Recorder, Replay, ReplayError};
use std::collections::{BTreeMap, VecDeque};

/// Follows environments and keeps what they did: per environment the newest complete episodes, and the
/// present one. An episode that began before the recorder is left out.
pub struct PoolRecorder {
    follower: Follower,
    max_episodes: usize,
    /// By environment. In each only the last one may continue.
    episodes: BTreeMap<usize, VecDeque<RecordedEpisode>>,
    n_complete: u64,
}

struct RecordedEpisode {
    number: u64,
    /// `None` if its beginning was not seen.
    start: Option<StreamPosition>,
    actions: Vec<u16>,
    is_complete: bool,
}

/// Why a pool could not be recorded.
#[derive(Debug, thiserror::Error)]
pub enum PoolRecorderError {
    /// The pool's answer is not what this release plays.
    #[error("this release does not play what the pool reports: {0}")]
    Replay(#[from] ReplayError),
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
    ) -> Result<PoolRecorder, ConnectError> {
        let follower = Follower::connect(runtime_dir, pool, lane, env_ids)?;
        Ok(PoolRecorder { follower, max_episodes, episodes: BTreeMap::new(), n_complete: 0 })
    }

    /// Receives what happened since the last call. The pool keeps a million actions of single agents; if
    /// there were more, episodes are missing.
    ///
    /// # Errors
    /// As [`Follower::read`]; what was received before stays.
    pub fn read(&mut self) -> Result<(), ClientError> {
        for FollowedPart { env_id, part } in self.follower.read()? {
            self.add(env_id, part);
        }
        Ok(())
    }

    /// Number of episodes that ended since the recorder began; it keeps the newest.
    pub fn n_complete(&self) -> u64 {
        self.n_complete
    }

    fn add(&mut self, env_id: usize, part: EpisodePart) {
        let episodes = self.episodes.entry(env_id).or_default();
        if let Some(start) = &part.start {
            let start = (start.episode_length == 0).then(|| start.generator.position());
            let (number, actions) = (part.number, Vec::new());
            episodes.push_back(RecordedEpisode { number, start, actions, is_complete: false });
        }
        let Some(episode) = episodes.back_mut().filter(|episode| episode.number == part.number) else {
            return;
        };
        if episode.start.is_some() {
            episode.actions.extend(part.actions);
            episode.is_complete = part.is_over;
            self.n_complete += u64::from(part.is_over);
        }
        // One more than the complete ones: the present episode.
        while episodes.len() > self.max_episodes + 1 {
            episodes.pop_front();
        }
    }

    /// Plays the episodes again: a replay with their checksums, by environment; with those that did not end,
    /// or without.
    ///
    /// # Errors
    /// If this release plays other battles than the pool.
    pub fn replay(&self, with_incomplete: bool) -> Result<Replay, PoolRecorderError> {
        let n_agents = self.follower.description().sizes.n_agents;
        let mut recorder = Recorder::new(self.follower.setup().clone(), 0)?;
        for episode in self.episodes.values().flatten() {
            let Some(start) = episode.start.filter(|_| episode.is_complete || with_incomplete) else {
                continue;
            };
            recorder.begin(start);
            for actions in episode.actions.chunks(n_agents) {
                let actions: Vec<i32> = actions.iter().map(|action| i32::from(*action)).collect();
                recorder.step(&actions)?;
            }
        }
        Ok(recorder.finish())
    }
}
