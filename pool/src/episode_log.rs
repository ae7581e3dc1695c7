//! What a followed environment did: the state where each episode began and the joint actions since, from
//! which a follower plays it again to the bit. An environment without followers keeps no log.
//!
//! A log keeps what one of its followers has not read, and the present episode. The logs of a lane share
//! [`MAX_LOG_BYTES`] equally; a log that needs more drops its oldest episodes, and tells the followers that
//! had not read them how many they lost.

use crate::sync::{AtomicUsize, Ordering};
use std::collections::VecDeque;
use std::sync::Arc;

/// Bytes that the logs of a lane use at most, together.
pub const MAX_LOG_BYTES: usize = 64 << 20;

/// Room for at least this many states of a battle is in every log.
const MIN_SNAPSHOTS: usize = 4;

/// A follower of environments of a lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FollowerId(pub u64);

/// The logs of the lane have no room for more environments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("at most {limit} environments of this size can be followed at once")]
pub struct TooManyFollowed {
    /// How many environments of the lane can be followed at once.
    pub limit: usize,
}

/// The memory that the logs of one lane share.
#[derive(Clone, Debug)]
pub(crate) struct LogMemory {
    /// Logs of the lane.
    logs: Arc<AtomicUsize>,
}

impl LogMemory {
    pub(crate) fn new() -> LogMemory {
        LogMemory { logs: Arc::new(AtomicUsize::new(0)) }
    }

    /// Is there room for the logs of more environments, which begin in a state of so many bytes?
    pub(crate) fn check(&self, more: usize, state: usize) -> Result<(), TooManyFollowed> {
        let limit = MAX_LOG_BYTES / (MIN_SNAPSHOTS * state);
        let logs = self.logs.load(Ordering::Relaxed);
        if logs + more > limit { Err(TooManyFollowed { limit }) } else { Ok(()) }
    }

    /// Bytes that one log may use. Relaxed: a log that sees an older number of logs is trimmed again when the
    /// follower that changed it has been added.
    fn share(&self) -> usize {
        MAX_LOG_BYTES / self.logs.load(Ordering::Relaxed).max(1)
    }
}

/// The log of one environment.
pub(crate) struct EpisodeLog {
    readers: Vec<Reader>,
    /// In order; the last is the present one.
    episodes: VecDeque<LoggedEpisode>,
    n_actors: usize,
    /// Bytes of `episodes`.
    bytes: usize,
    next_number: u64,
    memory: LogMemory,
}

/// A follower, and how far it has read.
struct Reader {
    follower: FollowerId,
    /// The episode that it reads.
    episode: u64,
    /// How many steps of that it has read; `None` if it has not got its start.
    steps: Option<usize>,
    /// Episodes before that one, since the one that it read before, that were dropped.
    lost: u64,
}

struct LoggedEpisode {
    number: u64,
    /// The record of the state in which it begins.
    start: Vec<u8>,
    actions: Vec<u16>,
    is_over: bool,
    /// The log began again in the middle of it, which all followers know.
    is_cut: bool,
}

/// A part of an episode: what a follower has not read yet.
#[derive(Clone, Debug, PartialEq)]
pub struct EpisodePart {
    /// Counts the episodes of the environment since it has followers, from 0.
    pub number: u64,
    /// The record of the state in which the episode began, or in which the log of it begins, without past
    /// actions; in its first part only.
    pub start: Option<Vec<u8>>,
    /// The joint actions since the last part, `[steps, n_actors]`.
    pub actions: Vec<u16>,
    /// The episode ended with the last of these steps. An episode that is reset before its end has no such
    /// part.
    pub is_over: bool,
    /// Episodes between the last part and this one that the log dropped, because the follower had not read
    /// them in time; all of them or their ends.
    pub lost: u64,
}

impl LoggedEpisode {
    fn bytes(&self) -> usize {
        size_of::<LoggedEpisode>() + self.start.capacity() + self.actions.capacity() * size_of::<u16>()
    }

    /// Adds a joint action. The memory grows by a quarter, because what it has room for counts too.
    fn push(&mut self, actions: impl Iterator<Item = i32>, n_actors: usize) {
        if self.actions.capacity() - self.actions.len() < n_actors {
            self.actions.reserve_exact((self.actions.len() / 4).max(16 * n_actors));
        }
        // A checked action is below the 6 + 360 + 1000 actions of the largest scenario.
        self.actions.extend(actions.map(|action| action as u16));
    }
}

impl Reader {
    fn has_read(&self, episode: &LoggedEpisode, n_actors: usize) -> bool {
        let steps = episode.actions.len() / n_actors;
        self.episode > episode.number || (self.episode == episode.number && self.steps == Some(steps))
    }
}

impl EpisodeLog {
    pub(crate) fn new(n_actors: usize, now: Vec<u8>, memory: LogMemory) -> EpisodeLog {
        memory.logs.fetch_add(1, Ordering::Relaxed);
        let (readers, episodes) = (Vec::new(), VecDeque::new());
        let mut log = EpisodeLog { readers, episodes, n_actors, bytes: 0, next_number: 0, memory };
        log.begin(now);
        log
    }

    /// Adds a follower, which reads from the beginning of the present episode on.
    pub(crate) fn add_reader(&mut self, follower: FollowerId) {
        let episode = self.next_number - 1;
        self.readers.push(Reader { follower, episode, steps: None, lost: 0 });
    }

    /// Removes a follower; whether it was the last one.
    pub(crate) fn remove_reader(&mut self, follower: FollowerId) -> bool {
        self.readers.retain(|reader| reader.follower != follower);
        self.drop_read();
        self.readers.is_empty()
    }

    /// The present episode alone uses the log's memory: its log must begin again in the state of now.
    pub(crate) fn is_full(&self) -> bool {
        self.episodes.len() == 1 && self.bytes > self.memory.share()
    }

    /// Begins the log of the present episode again, which has filled it. No follower can have the whole
    /// episode.
    pub(crate) fn begin_again(&mut self, now: Vec<u8>) {
        if let Some(last) = self.episodes.back_mut() {
            last.is_cut = true;
        }
        self.readers.iter_mut().for_each(|reader| reader.lost += 1);
        self.begin(now);
    }

    /// Notes the beginning of an episode.
    pub(crate) fn begin(&mut self, start: Vec<u8>) {
        if let Some(last) = self.episodes.back_mut() {
            self.bytes -= last.bytes();
            last.actions.shrink_to_fit();
            self.bytes += last.bytes();
        }
        let episode = LoggedEpisode {
            number: self.next_number,
            start,
            actions: Vec::new(),
            is_over: false,
            is_cut: false,
        };
        self.next_number += 1;
        self.bytes += episode.bytes();
        self.episodes.push_back(episode);
        self.drop_read();
        self.trim();
    }

    /// Notes a step of the present episode.
    pub(crate) fn step(&mut self, actions: impl Iterator<Item = i32>, is_over: bool) {
        if let Some(episode) = self.episodes.back_mut() {
            let before = episode.actions.capacity();
            episode.push(actions, self.n_actors);
            episode.is_over = is_over;
            self.bytes += (episode.actions.capacity() - before) * size_of::<u16>();
        }
        self.trim();
    }

    /// What happened since a follower's last call, until `budget` bytes are used up; then there may be more.
    pub(crate) fn read(&mut self, follower: FollowerId, budget: &mut usize) -> Vec<EpisodePart> {
        let mut parts = Vec::new();
        let Some(reader) = self.readers.iter_mut().find(|reader| reader.follower == follower) else {
            return parts;
        };
        let known = self.episodes.partition_point(|episode| episode.number < reader.episode);
        for episode in self.episodes.range(known..) {
            if *budget == 0 {
                break;
            }
            if !reader.has_read(episode, self.n_actors) {
                parts.push(reader.read(episode, self.n_actors, budget));
            }
        }
        self.drop_read();
        parts
    }

    /// Drops what all followers have read, except for the present episode.
    fn drop_read(&mut self) {
        while self.episodes.len() > 1
            && let Some(oldest) = self.episodes.front()
            && self.readers.iter().all(|reader| reader.has_read(oldest, self.n_actors))
        {
            self.drop_oldest();
        }
    }

    /// Drops the oldest episodes while the log uses more than its share of the memory.
    pub(crate) fn trim(&mut self) {
        while self.episodes.len() > 1 && self.bytes > self.memory.share() {
            // An episode without steps is no loss.
            let is_loss = |episode: &&LoggedEpisode| !episode.actions.is_empty() && !episode.is_cut;
            if let Some(oldest) = self.episodes.front().filter(is_loss) {
                let late = self.readers.iter_mut().filter(|reader| !reader.has_read(oldest, self.n_actors));
                late.for_each(|reader| reader.lost += 1);
            }
            self.drop_oldest();
        }
    }

    fn drop_oldest(&mut self) {
        self.bytes -= self.episodes.pop_front().map_or(0, |episode| episode.bytes());
    }
}

impl Drop for EpisodeLog {
    fn drop(&mut self) {
        self.memory.logs.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Reader {
    /// What was not read of an episode, as far as the budget goes, and at least one step.
    fn read(&mut self, episode: &LoggedEpisode, n_actors: usize, budget: &mut usize) -> EpisodePart {
        let read = self.steps.filter(|_| self.episode == episode.number);
        let start = read.is_none().then(|| episode.start.clone());
        let used = size_of::<EpisodePart>() + start.as_ref().map_or(0, Vec::len);
        *budget = budget.saturating_sub(used);
        let (read, step_bytes) = (read.unwrap_or(0), n_actors * size_of::<u16>());
        let steps = episode.actions.len() / n_actors;
        let end = steps.min(read + (*budget / step_bytes).max(1));
        // What is too little for another step is no budget for the next episode.
        *budget = if end < steps { 0 } else { budget.saturating_sub((end - read) * step_bytes) };
        (self.episode, self.steps) = (episode.number, Some(end));
        EpisodePart {
            number: episode.number,
            start,
            actions: episode.actions[read * n_actors..end * n_actors].to_vec(),
            is_over: episode.is_over && end == steps,
            lost: std::mem::take(&mut self.lost),
        }
    }
}

#[cfg(test)]
mod tests;
