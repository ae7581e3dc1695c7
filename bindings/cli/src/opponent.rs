//! The option `--opponent` of `train` and `evaluate`, and `--against` of `play`: scripts, a trained team,
//! or the team that is trained.

use crate::number::{count, whole};
use clap::Args;
use smaclite_engine::{Opponent, Opponents, OpponentsError, Rules, Sides};
use smaclite_learn::{Enemies, FileError, SelfPlay, TrainedTeam, names_team};
use smaclite_units::file::or_did_you_mean;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Who plays the enemies.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum OpponentOption {
    Scripts(Opponents),
    /// The folder of a run, or a team of the zoo.
    Team(PathBuf),
    /// The team that is trained.
    OwnTeam,
    /// The same, copies of it, and the script `attack_move`.
    League,
}

/// Why a text names no scripts. The messages of [`OpponentsError`] name `learner` too.
#[derive(Debug, thiserror::Error)]
pub(super) enum ScriptsError {
    #[error(
        "unknown opponent `{0}`; the opponents are {names}{hint}",
        names = scripts_by_name().join(", "),
        hint = or_did_you_mean(.0, scripts_by_name())
    )]
    Unknown(String),
    #[error(
        "`{0}` is a trained team, and only scripts play the enemies here: {names}",
        names = scripts_by_name().join(", ")
    )]
    Team(String),
    #[error("`learner` is for pools whose actions play both sides; the opponents here are {}",
        scripts_by_name().join(", "))]
    Learner,
    #[error("at least one opponent must be named: {}", scripts_by_name().join(", "))]
    None,
    #[error(transparent)]
    Other(OpponentsError),
}

fn scripts_by_name() -> Vec<&'static str> {
    Opponent::scripts().map(Opponent::name).collect()
}

/// A text that is none of them.
#[derive(Debug, thiserror::Error)]
pub(super) enum OpponentOptionError {
    #[error("{0}; and there is no folder of that name with a run")]
    Neither(ScriptsError),
    #[error("a trained team cannot be mixed with scripts here: name the team alone, or scripts alone")]
    Mixture,
    #[error(
        "`learner` is no opponent of a team; choose a script, the folder of a run or, in training, `self` or \
         `league`"
    )]
    Learner,
}

impl FromStr for OpponentOption {
    type Err = OpponentOptionError;

    fn from_str(text: &str) -> Result<OpponentOption, OpponentOptionError> {
        match text {
            "self" => return Ok(OpponentOption::OwnTeam),
            "league" => return Ok(OpponentOption::League),
            _ => {}
        }
        match scripts(text) {
            Ok(scripts) => Ok(OpponentOption::Scripts(scripts)),
            Err(ScriptsError::Learner) => Err(OpponentOptionError::Learner),
            Err(_) if text.contains('=') && !Path::new(text).is_dir() && names_a_team_of(text) => {
                Err(OpponentOptionError::Mixture)
            }
            Err(_) if names_team(text) => Ok(OpponentOption::Team(text.into())),
            Err(error) => Err(OpponentOptionError::Neither(error)),
        }
    }
}

/// Whether one of the names of a mixture is a team's.
fn names_a_team_of(mixture: &str) -> bool {
    mixture.split(',').filter_map(|part| part.split('=').next()).any(names_team)
}

/// Scripts, for battles in which nothing else plays the enemies.
pub(super) fn scripts(text: &str) -> Result<Opponents, ScriptsError> {
    let opponents = text.parse::<Opponents>().map_err(|error| match error {
        OpponentsError::Unknown(name) if names_team(&name) => ScriptsError::Team(name),
        OpponentsError::Unknown(name) => ScriptsError::Unknown(name),
        OpponentsError::None => ScriptsError::None,
        error => ScriptsError::Other(error),
    })?;
    opponents.check(Sides::Allies).map_err(|_| ScriptsError::Learner)?;
    Ok(opponents)
}

/// Says that a team which is to play the enemies was trained with other rules than those of the battles.
pub(super) fn warn_of_other_rules(folder: &Path, rules: Rules) -> Result<(), FileError> {
    if let Some(other) = TrainedTeam::other_rules(folder, rules)? {
        err!("smaclite-pool: warning: {other}");
    }
    Ok(())
}

#[derive(Args, Clone, Copy)]
#[group(id = "self_play", multiple = true, conflicts_with = "resume")]
#[command(next_help_heading = "Self-play (docs/how-to/self-play.md)")]
pub(super) struct SelfPlayOptions {
    /// With self or league: share of the episodes in which attack_move plays the enemies, 0 to 0.9
    /// [default: 0; with league 0.2]
    #[arg(long, value_name = "SHARE")]
    script_share: Option<f64>,
    /// With league: share of the other episodes in which the present team plays both sides, 0 to 1; in the
    /// rest, copies play the enemies [default: 0.5]
    #[arg(long, value_name = "SHARE")]
    self_share: Option<f64>,
    /// With league: a copy is made every N updates [default: 10]
    #[arg(long, value_name = "N", value_parser = whole(1..=1_000_000_u64))]
    league_every: Option<u64>,
    /// With league: most copies that are drawn from, 1 to 64; the one that is easiest to beat is left out
    /// [default: 16]
    #[arg(long, value_name = "N", value_parser = count(1..=64))]
    league_size: Option<usize>,
    /// With self or league: the reward of each side is what it earns less what the other side earns
    #[arg(long)]
    zero_sum: bool,
}

impl SelfPlayOptions {
    /// What `--opponent` and these options say.
    pub(super) fn enemies(self, opponent: Option<OpponentOption>) -> Result<Enemies, &'static str> {
        let SelfPlayOptions { script_share, self_share, league_every, league_size, zero_sum } = self;
        let is_league = opponent == Some(OpponentOption::League);
        let of_league = self_share.is_some() || league_every.is_some() || league_size.is_some();
        if of_league && !is_league {
            return Err("--self-share, --league-every and --league-size need --opponent league");
        }
        if (script_share.is_some() || zero_sum) && !is_league && opponent != Some(OpponentOption::OwnTeam) {
            return Err("--script-share and --zero-sum need --opponent self or league");
        }
        if script_share.is_some_and(|share| !(0.0..=0.9).contains(&share)) {
            return Err("--script-share must be between 0 and 0.9");
        }
        let defaults = if is_league { SelfPlay::LEAGUE } else { SelfPlay::ALONE };
        let self_play = SelfPlay {
            script_share: script_share.unwrap_or(defaults.script_share),
            self_share: self_share.unwrap_or(defaults.self_share),
            league_every: league_every.unwrap_or(defaults.league_every),
            league_size: league_size.unwrap_or(defaults.league_size),
            zero_sum,
        };
        Ok(match opponent {
            None | Some(OpponentOption::Scripts(_)) => Enemies::Scripts,
            Some(OpponentOption::Team(folder)) => Enemies::Team { folder },
            Some(OpponentOption::OwnTeam | OpponentOption::League) => Enemies::SelfPlay(self_play),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scripts_teams_and_keywords_are_told_apart() {
        let parse = |text: &str| text.parse::<OpponentOption>();
        assert_eq!(parse("self").unwrap(), OpponentOption::OwnTeam);
        assert_eq!(parse("league").unwrap(), OpponentOption::League);
        assert_eq!(parse("kite").unwrap(), OpponentOption::Scripts("kite".parse().unwrap()));
        let mixture = "attack_move=0.5,kite=0.5";
        assert_eq!(parse(mixture).unwrap(), OpponentOption::Scripts(mixture.parse().unwrap()));
        assert_eq!(parse("./kite").unwrap(), OpponentOption::Team("./kite".into()));
        assert_eq!(parse("runs/3m").unwrap(), OpponentOption::Team("runs/3m".into()));
        assert_eq!(parse("zoo:3m").unwrap(), OpponentOption::Team("zoo:3m".into()));
        let error = |text: &str| parse(text).unwrap_err().to_string();
        assert!(error("kites").starts_with("unknown opponent `kites`; the opponents are attack_move"));
        assert!(error("kites").ends_with("no folder of that name with a run"));
        assert!(error("learner=1,kite=1").starts_with("`learner` is no opponent of a team"));
        // It was unknown, and the documentation named it.
        let mixture = scripts("hold=1,zoo:3m=1").unwrap_err().to_string();
        assert!(mixture.starts_with("`zoo:3m` is a trained team, and only scripts play the enemies here: "));
        // They named sides `both`, which these options do not take.
        for text in ["kites", "", "learner"] {
            let errors = [error(text), scripts(text).unwrap_err().to_string()];
            assert!(errors.iter().all(|error| !error.contains("sides `both`")), "{errors:?}");
        }
    }
}
