//! The files of a team in the folder of its run, read once: the run may go on meanwhile, and what plays is
//! then what is copied.

use crate::description::{RunDescription, WEIGHTS, Weights};
use crate::lane_error::LaneError;
use crate::lanes::Lanes;
use crate::team::Network;
use crate::tensors::{FileError, create_folder, read, write};
use crate::weights::actor_of;
use smaclite_engine::BattleSetup;
use std::path::{Path, PathBuf};

/// The files of the team in the folder of a run, as they are: `run.json`, and the weights of [`Weights::of`].
///
/// # Errors
/// If they cannot be read or `run.json` is damaged.
pub fn read_team_files(folder: &Path) -> Result<(Vec<u8>, Vec<u8>), FileError> {
    let TeamFiles { text, weights, .. } = TeamFiles::read(folder, None)?;
    Ok((text, weights))
}

/// What a team needs to play.
pub(crate) struct TeamFiles {
    folder: PathBuf,
    run: RunDescription,
    /// Of `run.json`.
    text: Vec<u8>,
    weights_path: PathBuf,
    weights: Vec<u8>,
}

impl TeamFiles {
    /// Reads those of the team in a folder; with the weights of [`Weights::of`], if none are named.
    pub fn read(folder: &Path, weights: Option<Weights>) -> Result<TeamFiles, FileError> {
        let (run, text) = RunDescription::read_with_text(folder)?;
        let weights = weights.unwrap_or_else(|| Weights::of(folder, &run));
        weights.check_kept(folder)?;
        let weights_path = folder.join(weights.file_name());
        let weights = read(&weights_path)?;
        Ok(TeamFiles { folder: folder.to_owned(), run, text, weights_path, weights })
    }

    /// The policy of the team, if it can play the enemies of these lanes, which play `setup`.
    pub fn rival<E>(&self, setup: &BattleSetup, lanes: &Lanes) -> Result<Network, E>
    where
        E: From<FileError> + From<LaneError>,
    {
        let run = self.run.clone().playing_enemies_of::<LaneError>(&self.folder, setup)?;
        lanes.check_rival(&self.folder, run.sizes)?;
        Ok(run.playing(actor_of(&self.weights_path, &self.weights, run.actor())?))
    }

    /// Copies them to a folder of a team alone.
    pub fn write(&self, folder: &Path) -> Result<(), FileError> {
        create_folder(folder)?;
        write(&folder.join("run.json"), &self.text)?;
        write(&folder.join(WEIGHTS), &self.weights)
    }
}
