//! A team whose networks fit every scenario, written as one of a single map: for whatever plays a folder.

use crate::config::{Config, NetworkKind};
use crate::description::{OtherMap, RunDescription, WEIGHTS, Weights, read_policy, write_description};
use crate::weights::write_actor;
use crate::zoo_folders::{ExportError, create_team_folder};
use smaclite_engine::BattleSetup;
use std::path::Path;

/// Writes the team in the folder `from` to the folder `to`, which must not hold a run, as a team with
/// networks over units that plays this map. It plays as the team does; it has no checkpoint.
///
/// # Errors
/// If `from` has no such team, or it does not play the map; if `to` holds a run or cannot be written.
pub fn adapt_team(
    from: &Path,
    weights: Option<Weights>,
    map: BattleSetup,
    to: &Path,
) -> Result<(), ExportError> {
    let run = RunDescription::read(from)?;
    if run.config.network != NetworkKind::Universal {
        return Err(OtherMap::NotUniversal(run.name).into());
    }
    let run = run.on(map)?;
    let (_, actor) = read_policy(from, &run, weights)?;
    create_team_folder(to)?;
    write_actor(&to.join(WEIGHTS), &actor)?;
    // Nothing was trained on this map, and evaluations are those of the run.
    let (evaluate_every, map_weights) = (None, Vec::new());
    let config = Config { network: NetworkKind::Units, evaluate_every, map_weights, ..run.config.clone() };
    // The description last: a folder without it is not a run.
    Ok(write_description(to, &RunDescription { config, former_steps: Vec::new(), ..run })?)
}
