//! What is kept of followed environments: per environment the newest complete episodes and the present one,
//! as much as a replay has room for.

use smaclite_engine::{BattleSetup, Opponent, RecordLayout, RecordSizes, Sizes, Snapshot, StreamPosition};
use smaclite_ipc::FollowedPart;
use smaclite_view::{Recorder, Replay};
use std::collections::{BTreeMap, VecDeque};

use crate::PoolRecorderError;

/// Bytes of the text of all kept episodes, about: less than the largest replay has, so that they can be
/// saved.
pub(crate) const MAX_TEXT: usize = 48 << 20;

/// The episodes of all environments.
pub(crate) struct Kept {
    max_episodes: usize,
    envs: BTreeMap<usize, RecordedEnv>,
    n_complete: u64,
    costs: Costs,
    /// Bytes of their text, and how many they may be.
    text: usize,
    max_text: usize,
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
pub(crate) enum Start {
    /// As after a reset, with the generator at this position, against this opponent.
    Reset(StreamPosition, Opponent),
    /// In the state of a restore or fork, or with units that were drawn or are those of a level.
    Restored(Box<Snapshot>),
}

impl RecordedEnv {
    /// Drops the oldest episodes, so that at most so many complete ones are left, and as many that were cut
    /// off by a reset or a fork. Returns the bytes of their text.
    fn limit(&mut self, most: usize, costs: &Costs) -> usize {
        let n_complete = self.episodes.iter().filter(|episode| episode.is_complete).count();
        let is_present = self.episodes.back().is_some_and(|last| !last.is_complete);
        let n_cut = self.episodes.len() - n_complete - usize::from(is_present);
        let (mut complete, mut cut) = (n_complete.saturating_sub(most), n_cut.saturating_sub(most));
        let mut text = 0;
        self.episodes.retain(|episode| {
            let extra = if episode.is_complete { &mut complete } else { &mut cut };
            let is_dropped = *extra > 0;
            if is_dropped {
                *extra -= 1;
                text += costs.of(episode);
            }
            !is_dropped
        });
        text
    }
}

impl Kept {
    /// Nothing yet, of battles of these sizes; at most so many complete episodes per environment, and so many
    /// bytes of text.
    pub(crate) fn new(max_episodes: usize, sizes: &Sizes, max_text: usize) -> Kept {
        let costs = Costs::new(sizes);
        Kept { max_episodes, envs: BTreeMap::new(), n_complete: 0, costs, text: 0, max_text }
    }

    pub(crate) fn n_complete(&self) -> u64 {
        self.n_complete
    }

    pub(crate) fn n_lost(&self) -> u64 {
        self.envs.values().map(|env| env.n_lost).sum()
    }

    pub(crate) fn n_missing(&self) -> u64 {
        let kept = |env: &RecordedEnv| env.episodes.iter().filter(|episode| episode.is_complete).count();
        let missing = |env: &RecordedEnv| env.n_lost.min(self.max_episodes.saturating_sub(kept(env)) as u64);
        self.envs.values().map(missing).sum()
    }

    /// Adds what an environment did. `start_of` says how an episode begins, and is told whether it is the
    /// first one that is seen of its environment.
    pub(crate) fn add(&mut self, part: FollowedPart, start_of: impl Fn(&Snapshot, bool) -> Option<Start>) {
        let env = self.envs.entry(part.env_id).or_default();
        env.n_lost += part.lost;
        if let Some(start) = &part.start {
            let is_first = env.episodes.is_empty() && env.n_lost == 0;
            // One that was reset before its first step tells nothing.
            let is_empty = |last: &RecordedEpisode| last.actions.is_empty() && !last.is_complete;
            if env.episodes.back().is_some_and(is_empty)
                && let Some(empty) = env.episodes.pop_back()
            {
                self.text -= self.costs.of(&empty);
            }
            let (number, start, actions) = (part.number, start_of(start, is_first), Vec::new());
            let episode = RecordedEpisode { number, start, actions, is_complete: false };
            self.text += self.costs.of(&episode);
            env.episodes.push_back(episode);
        }
        let Some(episode) = env.episodes.back_mut().filter(|episode| episode.number == part.number) else {
            return;
        };
        if episode.start.is_some() {
            self.text -= self.costs.of(episode);
            episode.actions.extend(part.actions);
            self.text += self.costs.of(episode);
            episode.is_complete = part.is_over;
            self.n_complete += u64::from(part.is_over);
        }
        self.text -= env.limit(self.max_episodes, &self.costs);
        while self.text > self.max_text {
            self.forget();
        }
    }

    /// Forgets the oldest episode of the environment that has the most text.
    fn forget(&mut self) {
        let costs = &self.costs;
        let size = |env: &RecordedEnv| env.episodes.iter().map(|episode| costs.of(episode)).sum::<usize>();
        let Some(env) = self.envs.values_mut().max_by_key(|env| size(env)) else { return };
        env.n_lost += 1;
        if env.episodes.len() > 1 {
            self.text -= env.episodes.pop_front().map_or(0, |episode| costs.of(&episode));
        } else if let Some(only) = env.episodes.back_mut() {
            self.text -= costs.of(only);
            // It may continue: its number stays.
            only.actions = Vec::new();
            only.start = None;
        }
    }

    /// Plays the episodes again.
    pub(crate) fn replay(
        &self,
        setup: &BattleSetup,
        with_incomplete: bool,
    ) -> Result<Replay, PoolRecorderError> {
        let mut recorder = Recorder::new(setup.clone(), 0)?;
        for episode in self.envs.values().flat_map(|env| &env.episodes) {
            match episode.start.as_ref().filter(|_| episode.is_complete || with_incomplete) {
                None => continue,
                Some(Start::Reset(position, opponent)) => recorder.begin(*position, *opponent),
                Some(Start::Restored(snapshot)) => recorder.begin_at(snapshot)?,
            }
            for actions in episode.actions.chunks(self.costs.n_actors) {
                let actions: Vec<i32> = actions.iter().map(|action| i32::from(*action)).collect();
                recorder.step(&actions)?;
            }
        }
        Ok(recorder.finish())
    }
}

/// Bytes in the text of a replay, at most.
struct Costs {
    n_actors: usize,
    /// Of a step: the actions, and a checksum of five digits.
    step: usize,
    /// Of an episode without steps: keys, seed, outcome and checksum.
    episode: usize,
    /// Of a state in which an episode begins, in base64.
    snapshot: usize,
}

impl Costs {
    fn new(sizes: &Sizes) -> Costs {
        let n_actions = sizes.n_actions.max(sizes.enemies.map_or(0, |enemies| enemies.n_actions));
        let n_actors = sizes.n_actors();
        Costs {
            n_actors,
            step: n_actors * (n_actions.to_string().len() + 1) + 6,
            episode: 350,
            snapshot: RecordLayout::new(RecordSizes::new(sizes, 0)).size().div_ceil(3) * 4,
        }
    }

    fn of(&self, episode: &RecordedEpisode) -> usize {
        let steps = episode.actions.len() / self.n_actors * self.step;
        match &episode.start {
            None => 0,
            Some(Start::Reset(..)) => self.episode + steps,
            Some(Start::Restored(_)) => self.episode + self.snapshot + steps,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_engine::{Battle, action};
    use smaclite_view::ReplayError;

    /// Plays episodes, of which each ends or not, of so many steps in which all stop. Those of drawn units
    /// begin with a snapshot.
    fn record(
        scenario: &str,
        mut kept: impl FnMut(&Sizes) -> Kept,
        episodes: &[(bool, usize)],
    ) -> (Kept, Replay) {
        let (read, files) = smaclite_scenarios::ScenarioFiles::resolve(scenario).expect("a scenario");
        let setup = BattleSetup::new(files);
        let (_, arena) = setup.arena().expect("a valid scenario");
        let sizes = arena.sizes();
        let mut kept = kept(&sizes);
        let mut battle = Battle::new(std::sync::Arc::new(arena), 1);
        let stop = vec![action::STOP as u16; sizes.n_agents];
        for (number, (is_over, steps)) in (0..).zip(episodes) {
            battle.reset();
            let (start, actions) = (Some(battle.save()), stop.repeat(*steps));
            let part = FollowedPart { env_id: 0, number, start, actions, is_over: *is_over, lost: 0 };
            kept.add(part, |start, _| match &read.smacv2 {
                None => Some(Start::Reset(start.generator.position(), start.opponent)),
                Some(_) => Some(Start::Restored(Box::new(start.clone()))),
            });
        }
        let replay = kept.replay(&setup, true).expect("the same battles");
        (kept, replay)
    }

    /// Resets without a step pushed complete episodes out, and nothing said so.
    #[test]
    fn complete_episodes_stay_however_often_an_environment_is_reset() {
        let episodes =
            [(true, 1), (true, 1), (true, 1), (false, 0), (false, 0), (false, 1), (false, 1), (false, 1)];
        let (mut kept, _) = record("3m", |sizes| Kept::new(2, sizes, MAX_TEXT), &episodes);
        let numbers: Vec<u64> = kept.envs[&0].episodes.iter().map(|episode| episode.number).collect();
        assert_eq!(numbers, [1, 2, 5, 6, 7], "two complete ones, two that were cut off, and the present one");
        kept.text -= kept.envs[&0].episodes.iter().map(|episode| kept.costs.of(episode)).sum::<usize>();
        assert_eq!((kept.text, kept.n_complete(), kept.n_missing()), (0, 3, 0));
    }

    /// Only actions were counted, so a long recording of generated battles was too large for a file.
    #[test]
    fn what_is_kept_fits_into_a_replay_whatever_its_episodes_are() -> Result<(), ReplayError> {
        for (scenario, max_text) in [("terran_5_vs_5", 100_000), ("3m", 20_000)] {
            let kept = |sizes: &Sizes| Kept::new(usize::MAX - 1, sizes, max_text);
            let (_, empty) = record(scenario, kept, &[]);
            let (kept, replay) = record(scenario, kept, &[(true, 1); 100]);
            let text = replay.to_json()?.len() - empty.to_json()?.len();
            assert!(text <= max_text && text > max_text / 2, "{scenario}: {text} bytes");
            assert_eq!(kept.n_lost() + replay.episodes().len() as u64, 100, "{scenario}");
        }
        Ok(())
    }
}
