//! The matrix view of observations, which needs the feature `faer`.

use smaclite_engine::BattleSetup;
use smaclite_ipc::{Client, LaneConfig, RuntimeDir, Supervisor, SupervisorConfig, WaitOptions};
use smaclite_scenarios::ScenarioFiles;
use std::error::Error;

#[test]
fn a_row_of_the_matrix_is_the_observation_of_an_agent() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let runtime_dir = RuntimeDir::at(folder.path().to_owned())?;
    let (_, files) = ScenarioFiles::resolve("2s3z")?;
    let lanes = vec![LaneConfig::new("2s3z", BattleSetup::new(files), 4)];
    let (name, options) = ("train".to_owned(), Default::default());
    let config = SupervisorConfig { name, lanes, options, runtime_dir: runtime_dir.clone() };
    let _supervisor = Supervisor::start(config)?;
    let mut client = Client::connect(&runtime_dir, "train", None, Default::default())?;
    let batch = client.reset(Some(1), None, WaitOptions::forever())?;
    let (matrix, obs_size) = (batch.obs_matrix(), client.description().sizes.obs_size);
    assert_eq!(matrix.shape(), (4 * 5, obs_size));
    for (row, agent) in batch.obs().chunks(obs_size).enumerate() {
        assert!(matrix.row(row).iter().eq(agent), "row {row}");
    }
    Ok(())
}
