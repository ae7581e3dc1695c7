//! Recording: a battle that notes its seed and actions.

use smaclite_engine::{
    Battle, BattleSetup, IllegalAction, Opponent, Scratch, Snapshot, SnapshotError, Step, StreamPosition,
    Units,
};
use smaclite_scenarios::Scenario;

use super::checksum::Checksum;
use super::{Episode, Outcome, Replay, ReplayError, this_program};

/// A battle that is recorded: it is stepped and reset like a [`Battle`].
///
/// It notes seeds and actions, not states: a replay has a few kilobytes per episode, and whoever reads it
/// plays the battle again. With the published faults of SMACv2's interface the second episode and later ones
/// depend on those before them, and begin with their state instead. Environments of a pool record themselves
/// (`record` of a lane, or Python's `Recorder`).
///
/// # Example
///
/// ```
/// use smaclite_engine::{BattleSetup, policy};
/// use smaclite_scenarios::ScenarioFiles;
/// use smaclite_view::Recorder;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let (scenario, files) = ScenarioFiles::resolve("3m")?;
/// let mut recorder = Recorder::new(BattleSetup::new(files), 1)?;
/// let mut actions = vec![0; scenario.n_agents()];
/// while !recorder.battle().is_over() {
///     policy::nearest(recorder.battle(), &mut actions);
///     recorder.step(&actions)?;
/// }
/// let replay = recorder.finish();
/// assert_eq!(replay.episodes().len(), 1);
/// replay.verify()?; // plays it again, and compares every tick
/// # Ok(())
/// # }
/// ```
///
/// # At the edges
///
/// A step with an action that is not available is an error and records nothing. Episodes without a step are
/// left out, and [`finish`](Self::finish) includes an episode that has not ended. A replay of another
/// release is played by the present rules; [`Replay::verify`] finds the first step that differs.
///
/// To record a battle that runs elsewhere, step the recorder with the same actions; what it
/// [plays](Self::battle) is the same to the bit if it began at the same [`StreamPosition`] and with the same
/// opponent.
pub struct Recorder {
    replay: Replay,
    battle: Battle,
    scratch: Scratch,
    /// The generator's position at the start of this episode.
    start: StreamPosition,
    /// The state at its start, if that is not the one after a reset.
    snapshot: Option<Box<Snapshot>>,
    actions: Vec<u16>,
    checksum: Checksum,
    step_checksums: Vec<u16>,
    outcome: Outcome,
}

impl Recorder {
    /// Begins with the first episode of a battle of that seed.
    ///
    /// # Errors
    /// [`ReplayError::Scenario`] if the texts of the setup are no scenario.
    pub fn new(setup: BattleSetup, seed: u64) -> Result<Recorder, ReplayError> {
        let replay = Replay::new(setup, this_program())?;
        let battle = Battle::new(replay.arena.clone(), seed);
        Ok(Recorder {
            start: battle.start(),
            battle,
            replay,
            scratch: Scratch::new(),
            snapshot: None,
            actions: Vec::new(),
            checksum: Checksum::default(),
            step_checksums: Vec::new(),
            outcome: Outcome::default(),
        })
    }

    /// The scenario.
    pub fn scenario(&self) -> &Scenario {
        &self.replay.scenario
    }

    /// The battle that is recorded.
    pub fn battle(&self) -> &Battle {
        &self.battle
    }

    /// Plays and records a step, as [`Battle::step`].
    ///
    /// # Errors
    /// As [`Battle::step`]; then nothing is recorded.
    pub fn step(&mut self, actions: &[i32]) -> Result<Step, IllegalAction> {
        self.step_observed(actions, |_| {})
    }

    /// As [`step`](Self::step); `observe` is called with the units after each tick.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn step_observed(
        &mut self,
        actions: &[i32],
        observe: impl FnMut(&Units),
    ) -> Result<Step, IllegalAction> {
        let step = self.checksum.play_step(&mut self.battle, actions, &mut self.scratch, observe)?;
        self.step_checksums.push(self.checksum.value() as u16);
        // Legal actions are below the 6 + 360 + 1000 actions of the largest scenario.
        self.actions.extend(actions.iter().map(|&action| action as u16));
        self.outcome = Outcome::of(&self.battle, &step);
        Ok(step)
    }

    /// Ends the episode and begins the next one, with the generator as it is. An episode without a step is
    /// not recorded.
    pub fn reset(&mut self) {
        self.end_episode();
        self.battle.reset();
        self.start = self.battle.start();
        // With the published faults an episode depends on those before it, which a player does not play.
        if self.scenario().smacv2.as_ref().is_some_and(|options| options.published) {
            self.note_snapshot(self.battle.save());
        }
    }

    /// Ends the episode and begins one with the generator at that position, against this opponent. Nothing is
    /// left of earlier episodes, also with the published faults of SMACv2's interface.
    pub fn begin(&mut self, start: StreamPosition, opponent: Opponent) {
        self.end_episode();
        restart(&mut self.battle, start, opponent);
        self.start = start;
    }

    /// Ends the episode and begins one in the state of a snapshot.
    ///
    /// # Errors
    /// If the state is not one of this scenario; then nothing changes.
    pub fn begin_at(&mut self, snapshot: &Snapshot) -> Result<(), SnapshotError> {
        snapshot.check(&self.replay.arena)?;
        self.end_episode();
        self.battle.restore_checked(snapshot);
        self.note_snapshot(snapshot.clone());
        Ok(())
    }

    /// Lets the episode begin in a state, which the battle has now.
    fn note_snapshot(&mut self, snapshot: Snapshot) {
        self.start = snapshot.generator.position();
        self.snapshot = Some(Box::new(snapshot));
    }

    /// The joint actions of this episode so far: `[steps, n_actors]`, row by row.
    pub fn actions(&self) -> &[u16] {
        &self.actions
    }

    /// How far this episode has come.
    pub fn outcome(&self) -> &Outcome {
        &self.outcome
    }

    /// The recording so far, including the episode that is not over.
    pub fn replay(&self) -> Replay {
        let mut replay = self.replay.clone();
        replay.episodes.extend(self.episode());
        replay
    }

    /// As [`replay`](Self::replay), without a copy.
    pub fn finish(mut self) -> Replay {
        self.end_episode();
        self.replay
    }

    /// This episode so far, if it has a step.
    fn episode(&self) -> Option<Episode> {
        (!self.step_checksums.is_empty()).then(|| Episode {
            start: self.start,
            opponent: self.battle.opponent(),
            snapshot: self.snapshot.clone(),
            actions: self.actions.clone(),
            outcome: self.outcome,
            step_checksums: self.step_checksums.clone(),
            checksum: self.checksum.value(),
        })
    }

    fn end_episode(&mut self) {
        let episode = self.episode();
        self.replay.episodes.extend(episode);
        self.actions.clear();
        self.step_checksums.clear();
        (self.snapshot, self.checksum, self.outcome) = Default::default();
    }
}

/// Begins the first episode of a battle whose generator is at that position, against this opponent.
pub(super) fn restart(battle: &mut Battle, start: StreamPosition, opponent: Opponent) {
    battle.set_generator(start.into());
    battle.forget_episodes();
    battle.reset_against(opponent);
}

impl Outcome {
    /// The outcome after a step.
    pub(super) fn of(battle: &Battle, step: &Step) -> Outcome {
        Outcome {
            steps: battle.episode_length(),
            episode_return: battle.episode_return(),
            terminated: step.terminated,
            truncated: step.truncated,
            battle_won: step.battle_won,
            dead_allies: battle.dead_allies() as u32,
            dead_enemies: battle.dead_enemies() as u32,
        }
    }
}
