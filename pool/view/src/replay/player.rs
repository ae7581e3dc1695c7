//! Playing an episode of a replay again.

use std::collections::VecDeque;

use smaclite_engine::{Battle, Scratch, Snapshot, Step, TICKS_PER_STEP, Units};

use super::checksum::Checksum;
use super::recorder::restart;
use super::{Episode, Outcome, Replay, ReplayError};
use crate::{Moment, Observer};

/// Steps between two snapshots, from which [`Player::seek`] plays on.
const SNAPSHOT_EVERY: usize = 16;

/// Plays one episode and checks every step against the recorded checksum.
///
/// As an iterator it gives the moment of the start and then that of every tick; after an error it ends.
pub struct Player<'a> {
    replay: &'a Replay,
    index: usize,
    battle: Battle,
    scratch: Scratch,
    observer: Observer,
    checksum: Checksum,
    /// Number of steps that are played.
    step: usize,
    /// The states before steps 0, [`SNAPSHOT_EVERY`], and so on, as far as the episode was played.
    snapshots: Vec<(Snapshot, Observer, Checksum)>,
    /// Moments that the iterator has not given yet.
    moments: VecDeque<Moment>,
    is_failed: bool,
}

/// A step that was played again.
#[derive(Clone, Debug)]
pub struct PlayedStep {
    /// Its outcome.
    pub step: Step,
    /// The moment after each of its ticks.
    pub moments: Vec<Moment>,
}

impl<'a> Player<'a> {
    pub(super) fn new(replay: &'a Replay, index: usize) -> Player<'a> {
        let Episode { start, opponent, snapshot, .. } = &replay.episodes[index];
        let mut battle = Battle::new(replay.arena.clone(), start.seed);
        match snapshot {
            Some(snapshot) => battle.restore_checked(snapshot),
            None => restart(&mut battle, *start, *opponent),
        }
        let observer = Observer::new(&replay.scenario, &battle);
        let first = observer.moment().clone();
        Player {
            replay,
            index,
            scratch: Scratch::new(),
            checksum: Checksum::default(),
            step: 0,
            snapshots: vec![(battle.save(), observer.clone(), Checksum::default())],
            battle,
            observer,
            moments: VecDeque::from([first]),
            is_failed: false,
        }
    }

    /// The episode.
    pub fn episode(&self) -> &'a Episode {
        &self.replay.episodes[self.index]
    }

    /// Number of steps that are played.
    pub fn step(&self) -> usize {
        self.step
    }

    /// The battle after these steps.
    pub fn battle(&self) -> &Battle {
        &self.battle
    }

    /// The newest moment.
    pub fn moment(&self) -> &Moment {
        self.observer.moment()
    }

    /// The actions of a step; empty if there is none.
    pub fn actions(&self, step: usize) -> &'a [u16] {
        let n_actors = self.replay.arena.sizes().n_actors();
        self.episode().actions.chunks(n_actors).nth(step).unwrap_or(&[])
    }

    /// Plays the next step; `None` at the end of the episode.
    ///
    /// # Errors
    /// [`ReplayError::IllegalAction`] or [`ReplayError::Diverged`] if this version plays the step otherwise
    /// than it was recorded; again if it is called again.
    pub fn play_step(&mut self) -> Result<Option<PlayedStep>, ReplayError> {
        if self.is_failed {
            self.seek(self.step)?; // the battle has gone on
        }
        let played = self.try_play_step();
        self.is_failed = played.is_err();
        played
    }

    fn try_play_step(&mut self) -> Result<Option<PlayedStep>, ReplayError> {
        let actions: Vec<i32> = self.actions(self.step).iter().map(|&action| action.into()).collect();
        if actions.is_empty() {
            return Ok(None);
        }
        let mut moments = Vec::with_capacity(TICKS_PER_STEP);
        let observe = |units: &Units| moments.push(self.observer.observe(units).clone());
        let played = self.checksum.play_step(&mut self.battle, &actions, &mut self.scratch, observe);
        let (episode, step) = (self.index, self.step);
        let step = played.map_err(|error| ReplayError::IllegalAction { episode, step, error })?;
        self.compare(&step)?;
        self.step += 1;
        if self.step == self.snapshots.len() * SNAPSHOT_EVERY {
            self.snapshots.push((self.battle.save(), self.observer.clone(), self.checksum.clone()));
        }
        Ok(Some(PlayedStep { step, moments }))
    }

    /// Goes to the moment after `step` steps, backwards or forwards, from the nearest snapshot before it. The
    /// iterator continues there, with that moment first.
    ///
    /// # Errors
    /// [`ReplayError::NoSuchStep`], and as [`play_step`](Self::play_step).
    pub fn seek(&mut self, step: usize) -> Result<(), ReplayError> {
        let steps = self.episode().step_checksums.len();
        if step > steps {
            return Err(ReplayError::NoSuchStep { episode: self.index, step, steps });
        }
        let nearest = (step / SNAPSHOT_EVERY).min(self.snapshots.len() - 1);
        if step < self.step || nearest * SNAPSHOT_EVERY > self.step || self.is_failed {
            let (snapshot, observer, checksum) = &self.snapshots[nearest];
            let restored = self.battle.restore(snapshot);
            debug_assert_eq!(restored, Ok(()), "a snapshot of the same arena fits");
            (self.observer, self.checksum) = (observer.clone(), checksum.clone());
            self.step = nearest * SNAPSHOT_EVERY;
            self.is_failed = false;
        }
        while self.step < step {
            self.play_step()?;
        }
        self.moments = VecDeque::from([self.observer.moment().clone()]);
        Ok(())
    }

    /// Compares the step that was just played with the recording.
    fn compare(&self, step: &Step) -> Result<(), ReplayError> {
        let episode = self.episode();
        let (recorded, played) = (episode.step_checksums[self.step], self.checksum.value());
        if recorded != played as u16 {
            let (recorded, played) = (format!("{recorded:04x}"), format!("{:04x}", played as u16));
            return Err(self.diverged("the checksum of the step", recorded, played));
        }
        if self.step + 1 < episode.step_checksums.len() {
            return Ok(());
        }
        if episode.checksum != played {
            let (recorded, played) = (format!("{:016x}", episode.checksum), format!("{played:016x}"));
            return Err(self.diverged("the checksum of the episode", recorded, played));
        }
        let (recorded, played) = (&episode.outcome, Outcome::of(&self.battle, step));
        // The checksum includes the bits of the rewards; their sum in the file is a decimal number.
        if (played.episode_return - recorded.episode_return).abs() >= 1e-6 {
            let [recorded, played] = [recorded, &played].map(|outcome| outcome.episode_return.to_string());
            return Err(self.diverged("`episode_return`", recorded, played));
        }
        match recorded.entries().into_iter().zip(played.entries()).find(|(one, other)| one != other) {
            Some(((key, recorded), (_, played))) => Err(self.diverged(key, recorded, played)),
            None => Ok(()),
        }
    }

    fn diverged(&self, what: &'static str, recorded: String, played: String) -> ReplayError {
        let (episode, step, program) = (self.index, self.step, self.replay.program.clone());
        ReplayError::Diverged { episode, step, what, recorded, played, program }
    }
}

impl Iterator for Player<'_> {
    type Item = Result<Moment, ReplayError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.moments.is_empty() && !self.is_failed {
            match self.play_step() {
                Ok(played) => self.moments.extend(played.into_iter().flat_map(|played| played.moments)),
                Err(error) => {
                    self.is_failed = true;
                    return Some(Err(error));
                }
            }
        }
        self.moments.pop_front().map(Ok)
    }
}
