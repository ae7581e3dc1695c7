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
        EpisodeLimit::Scenario
            if setup.files.scenario().is_ok_and(|scenario| scenario.episode_limit.is_none()) =>
        {
            EpisodeLimit::Steps(DEFAULT_LIMIT)
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    /// A scenario without a limit, as `BattleSetup::new` takes it, kept none, and a tournament had no end.
    #[test]
    fn episodes_of_every_setup_end() {
        let (scenario, files) = ScenarioFiles::resolve("3m").unwrap();
        let endless = files.with_keys([("episode_limit".to_owned(), Value::Null)]);
        let limit = |files: &ScenarioFiles, episode_limit| {
            let setup = BattleSetup { episode_limit, ..BattleSetup::new(files.clone()) };
            with_an_end(setup).arena().unwrap().1.episode_limit()
        };
        assert_eq!(limit(&files, EpisodeLimit::Scenario), scenario.episode_limit);
        for episode_limit in [EpisodeLimit::Scenario, EpisodeLimit::None] {
            assert_eq!(limit(&endless, episode_limit), Some(1000), "{episode_limit}");
        }
        assert_eq!(limit(&endless, EpisodeLimit::Steps(7)), Some(7));
    }
}
