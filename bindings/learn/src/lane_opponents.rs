//! Who plays the enemies of a lane, as its users name it: scripts, a trained team, or both in turn.

use crate::actor::{Actor, Draw, Rows};
use crate::config::NetworkKind;
use crate::description::{OtherMap, RunDescription};
use crate::lane_error::{UnequalUnits, check_equal_sides};
use crate::policy::Choice;
use crate::random::Purpose;
use crate::trained_team::{TrainedTeam, UnfitTeam};
use crate::zoo::{names_team, zoo_hint};
use smaclite_engine::{BattleSetup, Faction, Opponent, Opponents, OpponentsError, Sides};
use smaclite_pool::enemy_team::{EnemyPolicy, EnemyTeam, EnemyView};
use smaclite_scenarios::Problems;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;

/// The opponents of a lane, with their weights: names of scripts, and at most one trained team, by the folder
/// of its run or as `zoo:3m`. As text `NAME` or `NAME=WEIGHT,NAME=WEIGHT`.
///
/// ```
/// use smaclite_engine::BattleSetup;
/// use smaclite_learn::LaneOpponents;
/// use smaclite_scenarios::ScenarioFiles;
///
/// let opponents: LaneOpponents = "zoo:3m=0.75,kite=0.25".parse()?;
/// let (setup, team) = opponents.open(BattleSetup::new(ScenarioFiles::resolve("3m")?.1))?;
/// assert_eq!(setup.opponents.to_string(), "kite=0.25,learner=0.75");
/// assert_eq!(team.ok_or("no team")?.name, "zoo:3m");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct LaneOpponents {
    /// In which `learner` is the team.
    of_battles: Opponents,
    team: Option<String>,
}

/// Why names and weights are no opponents of a lane.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum LaneOpponentsError {
    #[error("{0}; a trained team is named `zoo:SCENARIO` or by the folder of its run{hint}", hint = hint(.0))]
    Unknown(OpponentsError),
    #[error(transparent)]
    Opponents(#[from] OpponentsError),
    #[error("only one trained team can be among the opponents, got `{0}` and `{1}`")]
    SeveralTeams(String, String),
    #[error("opponent `{0}` is a trained team in the place of `learner`, which cannot be named beside it")]
    Learner(String),
    #[error("opponent `{0}` is a trained team, which needs sides `allies`: with both, its actions are given")]
    BothSides(String),
    #[error(
        "opponent `{0}` is a trained team, which cannot play the enemies of a scenario with key `smacv2`: \
         its interface is that of agents"
    )]
    Smacv2(String),
    #[error(transparent)]
    UnequalUnits(#[from] UnequalUnits),
    #[error("opponent `{0}`: {1}")]
    Unfit(String, UnfitTeam),
    #[error(transparent)]
    Team(#[from] OtherMap),
    #[error(transparent)]
    Scenario(#[from] Problems),
}

/// What an unknown name probably is.
fn hint(error: &OpponentsError) -> String {
    match error {
        OpponentsError::Unknown(name) => zoo_hint(Path::new(name)),
        _ => String::new(),
    }
}

impl LaneOpponents {
    /// Opponents with weights, which need not sum to 1.
    ///
    /// # Errors
    /// As [`Opponents::new`], and if there are several teams. Whether there is such a team is found by
    /// [`open`](Self::open).
    pub fn new<S: AsRef<str>>(
        weights: impl IntoIterator<Item = (S, f64)>,
    ) -> Result<LaneOpponents, LaneOpponentsError> {
        let (mut team, mut has_learner, mut of_battles) = (None::<String>, false, Vec::new());
        for (name, weight) in weights {
            let name = name.as_ref();
            match Opponent::from_name(name) {
                Ok(opponent) => {
                    has_learner |= opponent == Opponent::Learner;
                    of_battles.push((name.to_owned(), weight));
                }
                Err(_) if names_team(name) => {
                    if let Some(other) = team.replace(name.to_owned()) {
                        return Err(LaneOpponentsError::SeveralTeams(other, name.to_owned()));
                    }
                    of_battles.push((Opponent::Learner.name().to_owned(), weight));
                }
                Err(error) => return Err(LaneOpponentsError::Unknown(error)),
            }
        }
        if let Some(team) = team.take_if(|_| has_learner) {
            return Err(LaneOpponentsError::Learner(team));
        }
        let of_battles = Opponents::new(of_battles).map_err(|error| match (error, &team) {
            (OpponentsError::Weight { name, given }, Some(team)) if name == Opponent::Learner.name() => {
                OpponentsError::Weight { name: team.clone(), given }
            }
            (error, _) => error,
        })?;
        Ok(LaneOpponents { of_battles, team })
    }

    /// Checks that the actions of a learner play these sides.
    ///
    /// # Errors
    /// As [`Opponents::check`]; a team plays where actions play the agents alone.
    pub fn check(&self, sides: Sides) -> Result<(), LaneOpponentsError> {
        match &self.team {
            Some(team) if sides.are_both() => Err(LaneOpponentsError::BothSides(team.clone())),
            Some(_) => Ok(()),
            None => Ok(self.of_battles.check(sides)?),
        }
    }

    /// What battles are played with that have these opponents instead of their own, and the team among them,
    /// whose files are read.
    ///
    /// # Errors
    /// If there is no such team, its files are damaged, or it cannot play the enemies of these battles.
    pub fn open(self, setup: BattleSetup) -> Result<(BattleSetup, Option<EnemyTeam>), LaneOpponentsError> {
        self.check(setup.sides)?;
        let LaneOpponents { of_battles: opponents, team } = self;
        let Some(name) = team else { return Ok((BattleSetup { opponents, ..setup }, None)) };
        let folder = Path::new(&name);
        let run = RunDescription::read(folder).map_err(OtherMap::from)?;
        let fits_all = run.config.network == NetworkKind::Universal;
        let run = if fits_all { run.on(setup.clone())? } else { run };
        let team = TrainedTeam::of_run(folder, run, None).map_err(OtherMap::from)?;
        let scenario = setup.files.scenario()?;
        if scenario.smacv2.is_some() {
            return Err(LaneOpponentsError::Smacv2(name));
        }
        if fits_all {
            check_equal_sides(folder, &scenario)?;
        }
        let setup = BattleSetup { opponents, sides: Sides::Mirrored, ..setup };
        let unfit = |why| LaneOpponentsError::Unfit(name.clone(), why);
        team.check(&setup.arena()?.1, Faction::Enemy).map_err(unfit)?;
        let (last_actions, team) = (team.run.config.last_actions, Arc::new(team));
        let make = move || -> Box<dyn EnemyPolicy> {
            Box::new(TeamPolicy { team: Arc::clone(&team), actor: Actor::default() })
        };
        Ok((setup, Some(EnemyTeam { name, last_actions, make: Arc::new(make) })))
    }
}

impl FromStr for LaneOpponents {
    type Err = LaneOpponentsError;

    fn from_str(text: &str) -> Result<LaneOpponents, LaneOpponentsError> {
        // The path of a folder can have both signs.
        let is_one = !text.contains(['=', ',']) || Path::new(text).is_dir();
        if is_one {
            LaneOpponents::new([(text, 1.0)])
        } else {
            LaneOpponents::new(Opponents::named_in(text)?)
        }
    }
}

/// A team in one environment. Its actions are drawn, as they are wherever nothing else is said.
struct TeamPolicy {
    team: Arc<TrainedTeam>,
    actor: Actor,
}

impl EnemyPolicy for TeamPolicy {
    fn act(&mut self, view: EnemyView<'_>, actions: &mut [i32]) {
        let EnemyView { obs, avail_actions: available, position, episode_length } = view;
        let TrainedTeam { run, network } = &*self.team;
        let rows = Rows { sizes: run.sizes, obs, available };
        let draw = Draw { seed: position.seed, purpose: Purpose::Opponents, step: position.draws };
        let numbers = std::iter::once(episode_length as usize);
        self.actor.act(network, rows, Choice::Sampled, draw, numbers);
        actions.copy_from_slice(&self.actor.chosen.actions);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        text.parse::<LaneOpponents>().unwrap_err().to_string()
    }

    #[test]
    fn scripts_and_one_team_are_told_apart() {
        let parse = |text: &str| text.parse::<LaneOpponents>().unwrap();
        let named = |text: &str, of_battles: &str, team: Option<&str>| {
            let (of_battles, team) = (of_battles.parse().unwrap(), team.map(str::to_owned));
            assert_eq!(parse(text), LaneOpponents { of_battles, team }, "{text}");
        };
        named("kite", "kite", None);
        named("attack_move=1,kite=2", "attack_move=1,kite=2", None);
        named("zoo:3m", "learner", Some("zoo:3m"));
        named("runs/3m=3,kite", "learner=3,kite=1", Some("runs/3m"));
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("rate=0.1,seed=2");
        std::fs::create_dir(&folder).unwrap();
        named(folder.to_str().unwrap(), "learner", folder.to_str());
    }

    #[test]
    fn what_names_no_opponents_is_an_error_that_says_what_is_accepted() {
        let unknown = error("kites");
        assert!(
            unknown.starts_with("unknown opponent `kites`; the opponents are attack_move, "),
            "{unknown}"
        );
        assert!(unknown.ends_with("`zoo:SCENARIO` or by the folder of its run"), "{unknown}");
        assert!(error("3m").ends_with("its run; the team of the zoo is `zoo:3m`"));
        assert_eq!(
            error("zoo:3m,kite,runs/a"),
            "only one trained team can be among the opponents, got `zoo:3m` and `runs/a`"
        );
        assert!(error("zoo:3m,learner").starts_with("opponent `zoo:3m` is a trained team in the place of"));
        assert_eq!(error("kite,kite=2"), "opponent `kite` is named twice");
        assert!(error("zoo:3m=0,kite=2").starts_with("the weight of opponent `zoo:3m` must be"));
    }
}
