//! What battles are played with: the one record that pools, replays and training runs keep of it.

use crate::{Arena, Opponents, Rules, Sides};
use serde::{Deserialize, Serialize};
use smaclite_scenarios::{Problem, Problems, Scenario, ScenarioFiles};
use smaclite_units::file::Report;
use std::fmt;

/// What battles are played with. As JSON, the keys `files`, `rules`, `episode_limit` and, where they are not
/// the defaults, `opponents` and `sides`.
///
/// ```
/// use smaclite_engine::{BattleSetup, EpisodeLimit, Rules};
/// use smaclite_scenarios::ScenarioFiles;
///
/// let (_, files) = ScenarioFiles::resolve("2s3z")?;
/// let setup = BattleSetup { episode_limit: EpisodeLimit::Steps(30), ..BattleSetup::new(files) };
/// assert_eq!(setup.rules, Rules::Smaclite);
/// let (scenario, arena) = setup.arena()?;
/// assert_eq!((scenario.episode_limit, arena.episode_limit()), (Some(120), Some(30)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BattleSetup {
    /// The texts of the scenario file and of its unit files.
    pub files: ScenarioFiles,
    /// The rule set.
    pub rules: Rules,
    /// When an episode is truncated.
    pub episode_limit: EpisodeLimit,
    /// Who plays the enemies.
    #[serde(default, skip_serializing_if = "Opponents::is_default")]
    pub opponents: Opponents,
    /// Which sides joint actions play.
    #[serde(default, skip_serializing_if = "Sides::is_default")]
    pub sides: Sides,
}

/// When an episode is truncated. As JSON `"scenario"`, a number or `null`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EpisodeLimit {
    /// When the scenario file says.
    #[default]
    Scenario,
    /// After this many steps, whatever the scenario file says.
    #[serde(untagged)]
    Steps(u32),
    /// Never.
    #[serde(untagged)]
    None,
}

impl BattleSetup {
    /// A scenario with the default rules, its own opponent and its own episode limit.
    pub fn new(files: ScenarioFiles) -> BattleSetup {
        let (rules, episode_limit) = (Rules::default(), EpisodeLimit::default());
        let sides = Sides::default();
        let opponents = Opponents::of(&files, sides);
        BattleSetup { files, rules, episode_limit, opponents, sides }
    }

    /// The same with joint actions that play these sides, and the opponent that is the default then.
    pub fn with_sides(self, sides: Sides) -> BattleSetup {
        let opponents = Opponents::of(&self.files, sides);
        BattleSetup { sides, opponents, ..self }
    }

    /// What is probably a mistake in these battles, as [`ScenarioFiles::warnings`] under their rules. Of
    /// standard scenarios nothing is said.
    pub fn warnings(&self) -> Vec<Problem> {
        let scenario = if self.files.is_standard() { None } else { self.files.scenario().ok() };
        scenario.map_or_else(Vec::new, |scenario| {
            self.files.warnings_of(&self.rules.figures(&scenario), self.rules == Rules::Starcraft)
        })
    }

    /// The scenario, and the arena in which the battles are played.
    ///
    /// # Errors
    /// If the texts are no valid scenario, its battles cannot have these sides, the opponents are not
    /// those of the sides, or the limit is 0 steps.
    pub fn arena(&self) -> Result<(Scenario, Arena), Problems> {
        let scenario = self.files.scenario()?;
        let report = Report::default();
        let refuse = |path: &str, message: String| {
            let (file, path) = (self.files.source.clone(), path.to_owned());
            report.add(|| Problem { file, line: None, column: None, path, message })
        };
        let sides = self.sides.check(&scenario).map_err(|why| refuse("smacv2", why.to_string()));
        let opponents = self.opponents.check(self.sides).map_err(|why| refuse("opponents", why.to_string()));
        let limit = match self.episode_limit {
            EpisodeLimit::Steps(0) => {
                Err(refuse("episode_limit", "episode_limit must be at least 1, or none".to_owned()))
            }
            _ => Ok(()),
        };
        // The reader looked for room with the sizes in the files.
        let room = if self.rules != Rules::Starcraft || self.rules.figures(&scenario).leaves_room() {
            Ok(())
        } else {
            let n_units = scenario.units.len();
            Err(refuse(
                "start_positions",
                format!(
                    "`start_positions` must leave room for {n_units} units on the map, of which none overlap \
                     with the sizes and planes that they have under the rules `starcraft`"
                ),
            ))
        };
        report.finish(sides.and(opponents).and(limit).and(room))?;
        let arena = Arena::new(&scenario, self.rules).with_sides(self.sides);
        let arena = arena.with_opponents(self.opponents.clone());
        let arena = match self.episode_limit {
            EpisodeLimit::Scenario => arena,
            EpisodeLimit::Steps(steps) => arena.with_episode_limit(Some(steps)),
            EpisodeLimit::None => arena.with_episode_limit(None),
        };
        Ok((scenario, arena))
    }

    /// In what these battles differ from the expected ones, for messages: such as `rules (paper instead of
    /// smaclite)`, with commas between several. Empty if they are equal.
    pub fn differences(&self, expected: &BattleSetup) -> String {
        let mut parts = Vec::new();
        if self.files != expected.files {
            parts.push("scenario or unit types".to_owned());
        }
        let mut compare = |what: &str, given: &dyn ToString, expected: &dyn ToString| {
            let (given, expected) = (given.to_string(), expected.to_string());
            if given != expected {
                parts.push(format!("{what} ({given} instead of {expected})"));
            }
        };
        compare("rules", &self.rules, &expected.rules);
        compare("episode limit", &self.episode_limit, &expected.episode_limit);
        if self.opponents != expected.opponents {
            compare("opponents", &self.opponents, &expected.opponents);
        }
        compare("sides", &self.sides, &expected.sides);
        parts.join(", ")
    }
}

impl fmt::Display for EpisodeLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EpisodeLimit::Scenario => f.write_str("the scenario's"),
            EpisodeLimit::Steps(steps) => steps.fmt(f),
            EpisodeLimit::None => f.write_str("none"),
        }
    }
}

/// The limit of an arena, in which the scenario's has been looked up: a number of steps, or none.
impl From<Option<u32>> for EpisodeLimit {
    fn from(steps: Option<u32>) -> EpisodeLimit {
        steps.map_or(EpisodeLimit::None, EpisodeLimit::Steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Opponent;

    /// Such battles began: enemies stood still, or no limit was reached, and their snapshots were refused.
    #[test]
    fn battles_that_nobody_can_play_are_refused() {
        let setup = |map: &str| BattleSetup::new(ScenarioFiles::resolve(map).unwrap().1);
        let learner = BattleSetup { opponents: Opponent::Learner.into(), ..setup("3m") };
        let script = BattleSetup { sides: Sides::Both, ..setup("3m") };
        let no_steps = BattleSetup { episode_limit: EpisodeLimit::Steps(0), ..setup("3m") };
        for (setup, expected) in [
            (learner, "opponent `learner` needs sides `both`"),
            (script, "attack_move"),
            (no_steps, "episode_limit must be at least 1"),
        ] {
            let error = setup.arena().unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }

    /// Training runs have these texts in their folders.
    #[test]
    fn limits_and_rules_are_written_as_files_have_them() {
        let limits = [EpisodeLimit::Scenario, EpisodeLimit::Steps(120), EpisodeLimit::None];
        for (limit, text) in limits.into_iter().zip(["\"scenario\"", "120", "null"]) {
            assert_eq!(serde_json::to_string(&limit).unwrap(), text);
            assert_eq!(serde_json::from_str::<EpisodeLimit>(text).unwrap(), limit);
        }
        for rules in Rules::ALL {
            assert_eq!(serde_json::to_value(rules).unwrap(), rules.to_string());
            assert_eq!(serde_json::from_value::<Rules>(rules.to_string().into()).unwrap(), rules);
        }
    }

    #[test]
    fn differences_are_named_one_by_one() {
        let setup = |map: &str| BattleSetup::new(ScenarioFiles::resolve(map).unwrap().1);
        let expected = setup("3m");
        assert_eq!(expected.differences(&expected), "");
        assert_eq!(setup("8m").differences(&expected), "scenario or unit types");
        let rules = BattleSetup { rules: Rules::Paper, ..setup("3m") };
        assert_eq!(rules.differences(&expected), "rules (paper instead of smaclite)");
        let both = setup("3m").with_sides(Sides::Both);
        let given = BattleSetup { episode_limit: EpisodeLimit::Steps(7), ..both };
        let words = "episode limit (7 instead of the scenario's), \
                     opponents (learner instead of attack_move), \
                     sides (both instead of allies)";
        assert_eq!(given.differences(&expected), words);
    }
}
