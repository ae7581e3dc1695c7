//! What a followed environment did: the state where each episode began and the joint actions since, from
//! which a follower plays it again to the bit. An environment without followers keeps no log.

use smaclite_engine::Snapshot;
use std::collections::VecDeque;

/// The most actions of single agents in the log of an environment; older episodes are dropped. Twice this
/// number of bytes, and enough for what a follower misses between two reads.
const MAX_ACTIONS: usize = 1 << 20;

/// The most episodes in a log.
const MAX_EPISODES: usize = 4096;

/// The log of one environment.
pub(crate) struct EpisodeLog {
    /// Followers that read it.
    pub(crate) followers: usize,
    /// In order; the last is the present one.
    episodes: VecDeque<LoggedEpisode>,
    n_agents: usize,
    /// Actions in `episodes`.
    n_actions: usize,
    next_number: u64,
}

struct LoggedEpisode {
    number: u64,
    start: Snapshot,
    actions: Vec<u16>,
    is_over: bool,
}

/// How far a follower has read a log: the last episode that it knows of, and how many of its steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LogCursor {
    episode: Option<u64>,
    steps: usize,
}

/// A part of an episode: what a follower has not read yet.
#[derive(Clone, Debug, PartialEq)]
pub struct EpisodePart {
    /// Counts the episodes of the environment since it has followers, from 0. Numbers are left out if the
    /// follower was too slow.
    pub number: u64,
    /// The state in which the episode began, or in which the log of it begins; in its first part only.
    pub start: Option<Snapshot>,
    /// The joint actions since the last part, `[steps, n_agents]`.
    pub actions: Vec<u16>,
    /// The episode ended with the last of these steps. An episode that is reset before its end has no such
    /// part.
    pub is_over: bool,
}

impl EpisodeLog {
    pub(crate) fn new(n_agents: usize, now: Snapshot) -> EpisodeLog {
        let episodes = VecDeque::new();
        let mut log = EpisodeLog { followers: 0, episodes, n_agents, n_actions: 0, next_number: 0 };
        log.begin(now);
        log
    }

    /// The present episode has too many actions: its log must begin again in the state of now.
    pub(crate) fn is_full(&self) -> bool {
        self.n_actions >= MAX_ACTIONS
    }

    /// Notes the beginning of an episode, or of a new log of the present one.
    pub(crate) fn begin(&mut self, start: Snapshot) {
        let number = self.next_number;
        self.next_number += 1;
        self.episodes.push_back(LoggedEpisode { number, start, actions: Vec::new(), is_over: false });
        while self.episodes.len() > 1 && (self.is_full() || self.episodes.len() > MAX_EPISODES) {
            self.n_actions -= self.episodes.pop_front().map_or(0, |episode| episode.actions.len());
        }
    }

    /// Notes a step of the present episode.
    pub(crate) fn step(&mut self, actions: impl Iterator<Item = i32>, is_over: bool) {
        if let Some(episode) = self.episodes.back_mut() {
            // A checked action is below the 6 + 1000 actions of the largest scenario.
            episode.actions.extend(actions.map(|action| action as u16));
            episode.is_over = is_over;
            self.n_actions += self.n_agents;
        }
    }

    /// What happened since `cursor`, which moves on.
    pub(crate) fn read(&self, cursor: &mut LogCursor) -> Vec<EpisodePart> {
        let mut parts = Vec::new();
        let known = cursor.episode;
        for episode in self.episodes.iter().filter(|episode| Some(episode.number) >= known) {
            let is_new = Some(episode.number) != known;
            let steps = episode.actions.len() / self.n_agents;
            let read = if is_new { 0 } else { cursor.steps };
            if is_new || steps > read {
                parts.push(EpisodePart {
                    number: episode.number,
                    start: is_new.then(|| episode.start.clone()),
                    actions: episode.actions[read * self.n_agents..].to_vec(),
                    is_over: episode.is_over,
                });
            }
            *cursor = LogCursor { episode: Some(episode.number), steps };
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_engine::{Arena, Battle, Rules};
    use smaclite_scenarios::Scenario;
    use std::sync::Arc;

    fn start() -> Snapshot {
        let arena = Arena::new(&Scenario::resolve("3m").unwrap(), Rules::Smaclite);
        Battle::new(Arc::new(arena), 0).save()
    }

    /// Number, steps, and whether there is a start.
    fn read(log: &EpisodeLog, cursor: &mut LogCursor) -> Vec<(u64, usize, bool)> {
        let parts = log.read(cursor).into_iter();
        parts.map(|part| (part.number, part.actions.len() / 3, part.start.is_some())).collect()
    }

    #[test]
    fn every_step_is_read_once_and_every_start() {
        let mut log = EpisodeLog::new(3, start());
        let mut cursor = LogCursor::default();
        assert_eq!(read(&log, &mut cursor), [(0, 0, true)]);
        assert_eq!(read(&log, &mut cursor), []);
        log.step([1, 2, 3].into_iter(), false);
        assert_eq!(read(&log, &mut cursor), [(0, 1, false)]);
        log.step([1, 2, 3].into_iter(), true);
        log.begin(start());
        log.begin(start());
        log.step([4, 5, 6].into_iter(), false);
        assert_eq!(read(&log, &mut cursor), [(0, 1, false), (1, 0, true), (2, 1, true)]);
        assert_eq!(read(&log, &mut cursor), []);
        assert_eq!(read(&log, &mut LogCursor::default()), [(0, 2, true), (1, 0, true), (2, 1, true)]);
    }

    #[test]
    fn what_no_follower_reads_is_limited() {
        let mut log = EpisodeLog::new(3, start());
        let mut cursor = LogCursor::default();
        log.read(&mut cursor);
        let next = start();
        for _ in 0..2 * MAX_EPISODES {
            (0..100).for_each(|step| log.step([7; 3].into_iter(), step == 99));
            log.begin(next.clone());
        }
        assert!(log.n_actions <= MAX_ACTIONS && log.episodes.len() <= MAX_EPISODES);
        let parts = log.read(&mut cursor);
        assert!(parts[0].number > 1, "the oldest are missing");
        assert!(parts.iter().all(|part| part.start.is_some()));
        assert_eq!(parts.last().map(|part| part.number), Some(log.next_number - 1));
    }

    #[test]
    fn an_episode_without_end_is_limited_too() {
        let mut log = EpisodeLog::new(3, start());
        let now = start();
        for _ in 0..MAX_ACTIONS {
            log.step([7; 3].into_iter(), false);
            if log.is_full() {
                log.begin(now.clone());
            }
        }
        assert!(log.n_actions < MAX_ACTIONS);
        assert!(log.next_number > 2);
    }
}
