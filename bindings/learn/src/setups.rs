//! What teams play: setups whose episodes end.

use smaclite_engine::{BattleSetup, EpisodeLimit, Rules};
use smaclite_scenarios::{ScenarioError, ScenarioFiles};

/// Steps of an episode in a scenario without a limit: units that stay apart would never end it.
const DEFAULT_LIMIT: u32 = 1000;

/// The same battles, whose episodes end after 1000 steps if they have no limit, as those of a pool can have
/// none: for what plays whole episodes.
pub fn with_an_end(setup: BattleSetup) -> BattleSetup {
    let episode_limit = match setup.episode_limit {
        EpisodeLimit::None => EpisodeLimit::Steps(DEFAULT_LIMIT),
        limit => limit,
    };
    BattleSetup { episode_limit, ..setup }
}

/// The setup of a standard scenario or a scenario file. Without an episode limit, its episodes end after 1000
/// steps.
///
/// # Errors
/// If the scenario cannot be read.
pub fn resolve_scenario(name: &str, rules: Rules) -> Result<BattleSetup, ScenarioError> {
    let (scenario, files) = ScenarioFiles::resolve(name)?;
    let episode_limit = EpisodeLimit::Steps(scenario.episode_limit.unwrap_or(DEFAULT_LIMIT));
    Ok(BattleSetup { rules, episode_limit, ..BattleSetup::new(files) })
}
