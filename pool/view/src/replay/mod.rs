//! Replays: a scenario, and the seed and actions of its episodes, from which the engine plays every tick
//! again.
//!
//! ```
//! use smaclite_engine::{BattleSetup, policy};
//! use smaclite_scenarios::ScenarioFiles;
//! use smaclite_view::{Recorder, Replay};
//!
//! let (_, files) = ScenarioFiles::resolve("3m")?;
//! let mut recorder = Recorder::new(BattleSetup::new(files), 1)?;
//! let mut actions = [0; 3];
//! while !recorder.battle().is_over() {
//!     policy::nearest(recorder.battle(), &mut actions);
//!     recorder.step(&actions)?;
//! }
//! let bytes = recorder.finish().to_bytes()?;
//!
//! let replay = Replay::from_bytes(&bytes, "3m.smreplay")?;
//! replay.verify()?; // this version plays every tick as it was recorded
//! for moment in replay.play(0)? {
//!     assert_eq!(moment?.units.len(), 6);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod checksum;
mod error;
mod file;
mod player;
mod recorder;

use std::sync::Arc;

use serde::Serialize;
use smaclite_engine::{Arena, BattleSetup, Opponent, Snapshot, Step, StreamPosition};
use smaclite_scenarios::Scenario;
#[cfg(test)]
use ts_rs::TS;

pub use error::ReplayError;
pub use file::{MAX_FILE_BYTES, MAX_JSON_BYTES, SUFFIX};
pub use player::{PlayedStep, Player};
pub use recorder::Recorder;

/// A recorded episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    /// The generator at its beginning, after the opponent was drawn.
    pub start: StreamPosition,
    /// What plays the enemies.
    pub opponent: Opponent,
    /// The state in which it begins; `None` if it is that after the first reset of a battle.
    pub snapshot: Option<Box<Snapshot>>,
    /// The joint action of every step: `[steps, n_actors]`, row by row.
    pub actions: Vec<u16>,
    /// How it ended.
    pub outcome: Outcome,
    /// The low 16 bits of the checksum after each step, which tell where a reproduction fails.
    pub step_checksums: Vec<u16>,
    /// XXH3 over the bits of all units after every tick and of every reward.
    pub checksum: u64,
}

impl Episode {
    /// Number of recorded steps; fewer than those of the outcome if the recording begins within an episode.
    pub fn n_steps(&self) -> usize {
        self.step_checksums.len()
    }
}

/// How an episode ended, or where its recording ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Number of steps.
    pub steps: u32,
    /// Sum of the rewards.
    pub episode_return: f64,
    /// No unit of a faction was alive.
    pub terminated: bool,
    /// The episode limit was reached.
    pub truncated: bool,
    /// No enemy was alive.
    pub battle_won: bool,
    /// Number of agents that died.
    pub dead_allies: u32,
    /// Number of enemies that died.
    pub dead_enemies: u32,
}

impl Outcome {
    /// All but the return, which is compared as a number: keys of files and values.
    fn entries(&self) -> [(&'static str, String); 6] {
        let Outcome {
            steps,
            episode_return: _,
            terminated,
            truncated,
            battle_won,
            dead_allies,
            dead_enemies,
        } = self;
        [
            ("`steps`", steps.to_string()),
            ("`terminated`", terminated.to_string()),
            ("`truncated`", truncated.to_string()),
            ("`battle_won`", battle_won.to_string()),
            ("`dead_allies`", dead_allies.to_string()),
            ("`dead_enemies`", dead_enemies.to_string()),
        ]
    }

    /// How the episode ended, if its end was recorded.
    pub fn result(&self) -> Option<EpisodeResult> {
        EpisodeResult::of(self.battle_won, self.terminated, self.truncated)
    }
}

/// How an episode ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub enum EpisodeResult {
    /// The agents have won.
    Won,
    /// The enemies have won, or nobody.
    Lost,
    /// The episode limit was reached.
    Truncated,
}

impl EpisodeResult {
    /// How a step ended the episode, if it did.
    pub fn after(step: &Step) -> Option<EpisodeResult> {
        EpisodeResult::of(step.battle_won, step.terminated, step.truncated)
    }

    fn of(battle_won: bool, terminated: bool, truncated: bool) -> Option<EpisodeResult> {
        match (battle_won, terminated, truncated) {
            (true, _, _) => Some(EpisodeResult::Won),
            (_, true, _) => Some(EpisodeResult::Lost),
            (_, _, true) => Some(EpisodeResult::Truncated),
            _ => None,
        }
    }

    /// Its name in data and texts.
    pub fn name(self) -> &'static str {
        match self {
            EpisodeResult::Won => "won",
            EpisodeResult::Lost => "lost",
            EpisodeResult::Truncated => "truncated",
        }
    }
}

/// A recording that this program can play.
#[derive(Clone, Debug)]
pub struct Replay {
    setup: BattleSetup,
    program: String,
    episodes: Vec<Episode>,
    scenario: Scenario,
    arena: Arc<Arena>,
}

impl Replay {
    /// A replay without episodes.
    fn new(mut setup: BattleSetup, program: String) -> Result<Replay, ReplayError> {
        let (scenario, arena) = setup.arena()?;
        setup.episode_limit = arena.episode_limit().into(); // as its file has it
        Ok(Replay { setup, program, episodes: Vec::new(), scenario, arena: Arc::new(arena) })
    }

    /// What all episodes are played with.
    pub fn setup(&self) -> &BattleSetup {
        &self.setup
    }

    /// The program that recorded it, with its version.
    pub fn program(&self) -> &str {
        &self.program
    }

    /// The scenario.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The scenario prepared for play.
    pub fn arena(&self) -> &Arc<Arena> {
        &self.arena
    }

    /// The episodes, in the order in which they were played.
    pub fn episodes(&self) -> &[Episode] {
        &self.episodes
    }

    /// Plays an episode: an iterator over its moments from the start, and step by step.
    ///
    /// # Errors
    /// [`ReplayError::NoEpisodes`] or [`ReplayError::NoSuchEpisode`]. A moment that this version cannot
    /// reproduce is an error of the iterator.
    pub fn play(&self, episode: usize) -> Result<Player<'_>, ReplayError> {
        if self.episodes.is_empty() {
            return Err(ReplayError::NoEpisodes);
        }
        if episode >= self.episodes.len() {
            return Err(ReplayError::NoSuchEpisode { episode, n_episodes: self.episodes.len() });
        }
        Ok(Player::new(self, episode))
    }

    /// Plays all episodes and compares the bits of every tick with the recorded checksums.
    ///
    /// # Errors
    /// The first step that this version plays otherwise: [`ReplayError::Diverged`], or
    /// [`ReplayError::IllegalAction`].
    pub fn verify(&self) -> Result<(), ReplayError> {
        for episode in 0..self.episodes.len() {
            let mut player = Player::new(self, episode);
            while player.play_step()?.is_some() {}
        }
        Ok(())
    }
}

/// The name and version of this program, as replays store it.
fn this_program() -> String {
    format!("smaclite-pool {}", env!("CARGO_PKG_VERSION"))
}
