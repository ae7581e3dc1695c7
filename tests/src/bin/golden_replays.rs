//! Writes the recorded battles as replay files into a folder, for the test of the playground: the actions
//! are the recorded ones, and the checksums are those of this processor's engine, which plays every step as
//! it was recorded.
//!
//!     golden_replays FOLDER

use smaclite_engine::{BattleSetup, EpisodeLimit};
use smaclite_tests::recording::{self, Recording};
use smaclite_view::{Recorder, Replay};
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args_os().nth(1).ok_or("usage: golden_replays FOLDER")?);
    if folder.exists() {
        std::fs::remove_dir_all(&folder)?; // replays of other recordings
    }
    std::fs::create_dir_all(&folder)?;
    for recording in recording::all() {
        replay(&recording)?.write(&folder.join(format!("{}.smreplay", recording.name())))?;
    }
    Ok(())
}

fn replay(recording: &Recording) -> Result<Replay, Box<dyn std::error::Error>> {
    let setup = BattleSetup::new(recording.load_files());
    let setup = BattleSetup { episode_limit: EpisodeLimit::None, ..setup };
    let mut recorder = Recorder::new(setup, recording.seed)?;
    for (t, actions) in recording.actions.iter().enumerate() {
        recorder.step(actions)?;
        let (played, recorded) = (recorder.battle().units(), &recording.frames[t + 1]);
        if played.pos != recorded.pos || played.hp != recorded.hp || played.shield != recorded.shield {
            return Err(format!("{}: step {t} differs from the recording", recording.name()).into());
        }
    }
    Ok(recorder.finish())
}
