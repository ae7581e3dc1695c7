//! Recording environments of a running pool: `smaclite_ipc` follows them, and `smaclite_view` writes
//! replays. The command `record --pool` and the Python package use it.

#![forbid(unsafe_code)]

use smaclite_engine::{Battle, Opponent, Snapshot, SnapshotError, StreamPosition, Units};
use smaclite_ipc::{ClientError, ConnectError, EpisodePart, FollowedPart, Follower, RuntimeDir, WaitOptions};
use smaclite_view::{Recorder, Replay, ReplayError};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Bytes of the text of all kept episodes, about: less than the largest replay has, so that they can be
/// saved.
const MAX_TEXT: usize = 48 << 20;

/// Follows environments and keeps what they did: per environment the newest complete episodes, and the
/// present one. An episode that began before the recorder is left out.
pub struct PoolRecorder {
    follower: Follower,
    max_episodes: usize,
    envs: BTreeMap<usize, RecordedEnv>,
    n_complete: u64,
    /// Actions of single agents that are kept, and how many may be.
    n_actions: usize,
    max_actions: usize,
    fresh: Fresh,
}

#[derive(Default)]
struct RecordedEnv {
    /// Only the last one may continue.
    episodes: VecDeque<RecordedEpisode>,
    n_lost: u64,
}

struct RecordedEpisode {
    number: u64,
    /// `None` if its beginning was not seen.
    start: Option<Start>,
    actions: Vec<u16>,
    is_complete: bool,
}

/// How an episode begins.
enum Start {
    /// As after a reset, with the generator at this position, against this opponent.
    Reset(StreamPosition, Opponent),
    /// In the state of a restore or fork.
    Restored(Box<Snapshot>),
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
        let follower = Follower::connect_within(runtime_dir, pool, lane, env_ids, wait)?;
        // Files that are no scenario are an error of `replay`.
        let arena = follower.setup().arena().ok();
        let fresh = match arena {
            None => Fresh::Any,
            Some((scenario, _)) if scenario.generation.is_some() || scenario.smacv2.is_some() => Fresh::None,
            Some((_, arena)) => Fresh::Units(Box::new(Battle::new(Arc::new(arena), 0).units().clone())),
        };
        let n_actors = follower.description().sizes.n_actors();
        let (envs, n_complete, n_actions) = (BTreeMap::new(), 0, 0);
        let max_actions = MAX_TEXT / text_bytes_per_step(&follower) * n_actors;
        Ok(PoolRecorder { follower, max_episodes, envs, n_complete, n_actions, max_actions, fresh })
    }

    /// Receives what happened since the last call. The logs of a lane keep
    /// [`MAX_LOG_BYTES`](smaclite_ipc::MAX_LOG_BYTES); if there was more, the oldest episodes are lost.
    ///
    /// # Errors
    /// As [`Follower::read`]; what was received before stays.
    pub fn read(&mut self, mut wait: WaitOptions<'_>) -> Result<(), ClientError> {
        loop {
            let piece = self.follower.read_piece(wait.reborrow())?;
            piece.parts.into_iter().for_each(|FollowedPart { env_id, part }| self.add(env_id, part));
            if !piece.more {
                return Ok(());
            }
        }
    }

    /// Number of episodes of which the end was received since the recorder began; it keeps the newest.
    pub fn n_complete(&self) -> u64 {
        self.n_complete
    }

    /// Number of episodes that were lost since the recorder began: the pool dropped them before they were
    /// read, or this recorder to limit its memory.
    pub fn n_lost(&self) -> u64 {
        self.envs.values().map(|env| env.n_lost).sum()
    }

    /// Number of episodes that a replay would have if none had been lost: of an environment of which enough
    /// complete ones are kept, none is missing.
    pub fn n_missing(&self) -> u64 {
        let kept = |env: &RecordedEnv| env.episodes.iter().filter(|episode| episode.is_complete).count();
        let missing = |env: &RecordedEnv| env.n_lost.min(self.max_episodes.saturating_sub(kept(env)) as u64);
        self.envs.values().map(missing).sum()
    }

    fn add(&mut self, env_id: usize, part: EpisodePart) {
        let env = self.envs.entry(env_id).or_default();
        env.n_lost += part.lost;
        if let Some(start) = &part.start {
            let is_first = env.episodes.is_empty() && env.n_lost == 0;
            let start = self.fresh.start_of(start, is_first);
            let (number, actions) = (part.number, Vec::new());
            env.episodes.push_back(RecordedEpisode { number, start, actions, is_complete: false });
        }
        let Some(episode) = env.episodes.back_mut().filter(|episode| episode.number == part.number) else {
            return;
        };
        if episode.start.is_some() {
            self.n_actions += part.actions.len();
            episode.actions.extend(part.actions);
            episode.is_complete = part.is_over;
            self.n_complete += u64::from(part.is_over);
        }
        // One more than the complete ones: the present episode.
        while env.episodes.len() > self.max_episodes + 1 {
            self.n_actions -= env.episodes.pop_front().map_or(0, |episode| episode.actions.len());
        }
        while self.n_actions > self.max_actions {
            self.forget();
        }
    }

    /// Forgets the oldest episode of the environment that has the most actions.
    fn forget(&mut self) {
        let size =
            |env: &RecordedEnv| env.episodes.iter().map(|episode| episode.actions.len()).sum::<usize>();
        let Some(env) = self.envs.values_mut().max_by_key(|env| size(env)) else { return };
        env.n_lost += 1;
        if env.episodes.len() > 1 {
            self.n_actions -= env.episodes.pop_front().map_or(0, |episode| episode.actions.len());
        } else if let Some(only) = env.episodes.back_mut() {
            // It may continue: its number stays.
            self.n_actions -= std::mem::take(&mut only.actions).len();
            only.start = None;
        }
    }

    /// Plays the episodes again: a replay with their checksums, by environment; with those that did not end,
    /// or without.
    ///
    /// # Errors
    /// If this release plays other battles than the pool.
    pub fn replay(&self, with_incomplete: bool) -> Result<Replay, PoolRecorderError> {
        let n_actors = self.follower.description().sizes.n_actors();
        let mut recorder = Recorder::new(self.follower.setup().clone(), 0)?;
        for episode in self.envs.values().flat_map(|env| &env.episodes) {
            match episode.start.as_ref().filter(|_| episode.is_complete || with_incomplete) {
                None => continue,
                Some(Start::Reset(position, opponent)) => recorder.begin(*position, *opponent),
                Some(Start::Restored(snapshot)) => recorder.begin_at(snapshot)?,
            }
            for actions in episode.actions.chunks(n_actors) {
                let actions: Vec<i32> = actions.iter().map(|action| i32::from(*action)).collect();
                recorder.step(&actions)?;
            }
        }
        Ok(recorder.finish())
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

/// Bytes of a step in the text of a replay, at most: the actions, and a checksum of five digits.
fn text_bytes_per_step(follower: &Follower) -> usize {
    let sizes = follower.description().sizes;
    let n_actions = sizes.n_actions.max(sizes.enemies.map_or(0, |enemies| enemies.n_actions));
    sizes.n_actors() * (n_actions.to_string().len() + 1) + 6
}
