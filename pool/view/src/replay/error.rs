//! Errors of recording, reading and playing replays.

use std::io;

use smaclite_engine::IllegalAction;
use smaclite_scenarios::Problems;
use smaclite_units::file::shown_reason;

/// Why a replay was refused, or cannot be played. Episodes and steps are numbered from 0.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The file cannot be read or written.
    #[error("{file}: {error}")]
    Io {
        /// The file.
        file: String,
        /// Why.
        error: io::Error,
    },
    /// The file is larger than any replay may be.
    #[error("{file}: a replay must have at most {max} bytes {unit}")]
    TooLarge {
        /// The file.
        file: String,
        /// The limit.
        max: u64,
        /// Of what it is a limit.
        unit: &'static str,
    },
    /// The file is not a replay, or it is damaged.
    #[error("{file}: expected a replay, which is JSON compressed by gzip: {}", shown_reason(reason))]
    NotAReplay {
        /// The file.
        file: String,
        /// What is wrong with it; it may repeat a value of any length.
        reason: String,
    },
    /// The file has another format.
    #[error("{file}: `version` must be {supported}, got {given}; it was written by {program}")]
    Version {
        /// The file.
        file: String,
        /// Its format version.
        given: u64,
        /// The format version of this program.
        supported: u64,
        /// The program that wrote it.
        program: String,
    },
    /// A value in the file is wrong.
    #[error("{file}: `{key}` must be {expected}, got {given}")]
    Invalid {
        /// The file.
        file: String,
        /// The key of the value.
        key: String,
        /// What is accepted.
        expected: String,
        /// The value.
        given: String,
    },
    /// The scenario in the replay cannot be read.
    #[error("scenario of the replay: {0}")]
    Scenario(#[from] Problems),
    /// It has no episode that could be played or shown.
    #[error("the replay has no episodes")]
    NoEpisodes,
    /// There is no such episode.
    #[error("episode must be below {n_episodes}, the number of episodes of the replay, got {episode}")]
    NoSuchEpisode {
        /// The episode.
        episode: usize,
        /// Number of episodes.
        n_episodes: usize,
    },
    /// There is no such step.
    #[error("step must be at most {steps}, the number of steps of episode {episode}, got {step}")]
    NoSuchStep {
        /// The episode.
        episode: usize,
        /// The step.
        step: usize,
        /// Number of steps of the episode.
        steps: usize,
    },
    /// An action of the replay is not available.
    #[error("episode {episode}, step {step}: {error}")]
    IllegalAction {
        /// The episode.
        episode: usize,
        /// The step.
        step: usize,
        /// The action.
        error: IllegalAction,
    },
    /// This version plays the episode otherwise than the program that recorded it, or the file was changed.
    #[error(
        "episode {episode}, step {step}: {what} must be {recorded}, as recorded by {program}, got {played}"
    )]
    Diverged {
        /// The episode.
        episode: usize,
        /// The first step that differs.
        step: usize,
        /// What was compared.
        what: &'static str,
        /// Its recorded value.
        recorded: String,
        /// Its value as played by this version.
        played: String,
        /// The program that recorded the episode.
        program: String,
    },
}
