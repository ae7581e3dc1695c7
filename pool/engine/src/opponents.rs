//! Who plays the enemies: the scenario's attack-move, or a scripted policy, drawn at each reset.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::random::Generator;
use crate::sides::Sides;
use crate::tactic::Tactic;
use smaclite_scenarios::{March, ScenarioFiles};
use smaclite_units::file::or_did_you_mean;

/// The greatest weight of an opponent: sums of weights stay finite.
const MAX_WEIGHT: f64 = 1e6;

/// What plays the enemies in one episode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Opponent {
    /// SMAClite's: all enemies march to the scenario's attack point, and attack agents in scan range.
    #[default]
    AttackMove,
    /// SMACv2's: an enemy without a target marches to the nearest agent, wherever that is, and attacks agents
    /// in scan range.
    AttackNearest,
    /// A scripted policy. It has the actions of agents, targets within 6 squares, and knows of agents within
    /// 9 squares of an enemy; while there are none, enemies go to the attack point.
    Scripted(Tactic),
    /// Whoever gives the joint actions, which have the enemies' actions too.
    Learner,
}

impl Opponent {
    /// All opponents; the field `opponent` and snapshots have their index.
    pub const ALL: [Opponent; 3 + Tactic::ALL.len()] = {
        let mut all = [Opponent::Learner; 3 + Tactic::ALL.len()];
        all[0] = Opponent::AttackMove;
        all[1] = Opponent::AttackNearest;
        let mut i = 0;
        while i < Tactic::ALL.len() {
            all[2 + i] = Opponent::Scripted(Tactic::ALL[i]);
            i += 1;
        }
        all
    };

    /// Its name in commands, files and Python.
    pub const fn name(self) -> &'static str {
        match self {
            Opponent::AttackMove => "attack_move",
            Opponent::AttackNearest => "attack_nearest",
            Opponent::Scripted(tactic) => tactic.name(),
            Opponent::Learner => "learner",
        }
    }

    /// Those that choose the enemies' actions by themselves.
    pub fn scripts() -> impl Iterator<Item = Opponent> {
        Opponent::ALL.into_iter().filter(|opponent| *opponent != Opponent::Learner)
    }

    /// Whether it sends the enemies to the attack point or to the agents, and leaves them the choice of
    /// targets.
    pub(crate) fn marches(self) -> bool {
        matches!(self, Opponent::AttackMove | Opponent::AttackNearest)
    }

    /// The opponent of that name.
    ///
    /// # Errors
    /// If there is none.
    pub fn from_name(name: &str) -> Result<Opponent, OpponentsError> {
        let found = Opponent::ALL.into_iter().find(|opponent| opponent.name() == name);
        found.ok_or_else(|| OpponentsError::Unknown(name.to_owned()))
    }

    /// The names of all opponents, as text.
    pub fn names() -> String {
        let scripts: Vec<&str> = Opponent::scripts().map(Opponent::name).collect();
        format!("{}, and {} with sides `both`", scripts.join(", "), Opponent::Learner.name())
    }

    /// Its index in [`ALL`](Self::ALL).
    pub const fn index(self) -> usize {
        match self {
            Opponent::AttackMove => 0,
            Opponent::AttackNearest => 1,
            Opponent::Scripted(tactic) => 2 + tactic as usize,
            Opponent::Learner => 2 + Tactic::ALL.len(),
        }
    }
}

/// The opponents of a lane, with their weights. As JSON an object, as text `NAME` or
/// `NAME=WEIGHT,NAME=WEIGHT`. They are equal if they play in equal shares of the episodes.
///
/// ```
/// use smaclite_engine::Opponents;
///
/// let opponents: Opponents = "attack_move=0.5,focus_fire=0.5".parse()?;
/// assert_eq!(opponents.to_string(), "attack_move=0.5,focus_fire=0.5");
/// assert_eq!("kite".parse::<Opponents>()?.to_string(), "kite");
/// # Ok::<(), smaclite_engine::OpponentsError>(())
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "BTreeMap<String, f64>", into = "BTreeMap<String, f64>")]
pub struct Opponents {
    /// By index in [`Opponent::ALL`]; those that never play are left out.
    weights: Vec<(Opponent, f64)>,
}

/// Why a text or a table names no opponents.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OpponentsError {
    /// A name that no opponent has.
    #[error(
        "unknown opponent `{0}`; the opponents are {names}{hint}",
        names = Opponent::names(),
        hint = or_did_you_mean(.0, Opponent::ALL.map(Opponent::name))
    )]
    Unknown(String),
    /// A weight that is no share.
    #[error("the weight of opponent `{name}` must be a number above 0, at most {MAX_WEIGHT}, got {given}")]
    Weight {
        /// The opponent.
        name: String,
        /// Its weight.
        given: String,
    },
    /// A name that occurs twice.
    #[error("opponent `{0}` is named twice")]
    Twice(String),
    /// Nobody gives actions to the enemies.
    #[error(
        "opponent `learner` needs sides `both` or `mirrored`, so that the actions of the enemies are given"
    )]
    OneSide,
    /// A learner whose actions no battle reads.
    #[error(
        "actions play both sides, so the opponents must include `learner`, got `{0}`: \
         omit the opponent, mix it with `learner`, or choose sides `allies`"
    )]
    NoLearner(String),
    /// No name.
    #[error("at least one opponent must be named: {names}", names = Opponent::names())]
    None,
}

/// Shares that differ by less are those of the same numbers, rounded.
const ROUNDING: f64 = 1e-12;

impl PartialEq for Opponents {
    fn eq(&self, other: &Opponents) -> bool {
        let mut pairs = self.shares().zip(other.shares());
        self.weights.len() == other.weights.len()
            && pairs.all(|((a, of_a), (b, of_b))| a == b && (of_a - of_b).abs() < ROUNDING)
    }
}

impl Default for Opponents {
    fn default() -> Opponents {
        Opponents::from(Opponent::AttackMove)
    }
}

impl From<Opponent> for Opponents {
    fn from(opponent: Opponent) -> Opponents {
        Opponents { weights: vec![(opponent, 1.0)] }
    }
}

impl Opponents {
    /// Opponents with weights, which need not sum to 1.
    ///
    /// # Errors
    /// If there are none, a name is unknown or occurs twice, or a weight is not a number above 0, at most a
    /// million.
    pub fn new<S: AsRef<str>>(
        weights: impl IntoIterator<Item = (S, f64)>,
    ) -> Result<Opponents, OpponentsError> {
        let mut own: Vec<(Opponent, f64)> = Vec::new();
        for (name, weight) in weights {
            let name = name.as_ref();
            let opponent = Opponent::from_name(name)?;
            if !(weight > 0.0 && weight <= MAX_WEIGHT) {
                return Err(OpponentsError::Weight { name: name.to_owned(), given: weight.to_string() });
            }
            if own.iter().any(|(known, _)| *known == opponent) {
                return Err(OpponentsError::Twice(name.to_owned()));
            }
            own.push((opponent, weight));
        }
        // One order, so that equal weights draw equally.
        own.sort_by_key(|(opponent, _)| opponent.index());
        if own.is_empty() { Err(OpponentsError::None) } else { Ok(Opponents { weights: own }) }
    }

    /// The names and weights in a text such as `NAME` or `NAME=WEIGHT,NAME=WEIGHT`.
    ///
    /// # Errors
    /// If a weight is not a number.
    pub fn named_in(text: &str) -> Result<Vec<(String, f64)>, OpponentsError> {
        let pair = |part: &str| {
            let (name, weight) = part.rsplit_once('=').unwrap_or((part, "1"));
            let (name, weight) = (name.trim().to_owned(), weight.trim());
            let error = || OpponentsError::Weight { name: name.clone(), given: weight.to_owned() };
            let weight = weight.parse().map_err(|_| error())?;
            Ok((name, weight))
        };
        text.split(',').filter(|part| !part.trim().is_empty()).map(pair).collect()
    }

    /// Who plays the enemies where nothing else is said: the learner if joint actions play both sides, else
    /// the opponent that the scenario file names, else attack-move. What cannot be read names none.
    pub fn of(files: &ScenarioFiles, sides: Sides) -> Opponents {
        let own = match sides.are_both() {
            true => Opponent::Learner,
            false => match files.scenario().map(|scenario| scenario.opponent) {
                Ok(Some(March::ToNearestAgent)) => Opponent::AttackNearest,
                Ok(Some(March::ToAttackPoint) | None) | Err(_) => Opponent::AttackMove,
            },
        };
        own.into()
    }

    /// Whether they are attack-move alone.
    pub fn is_default(&self) -> bool {
        *self == Opponents::default()
    }

    /// Checks that joint actions play the enemies in some episodes if they have numbers for them, and in none
    /// otherwise.
    ///
    /// # Errors
    /// If the joint actions are those of the agents alone, and an opponent is [`Opponent::Learner`]; or if
    /// they play both sides, and no opponent is: then the enemies' actions would never be carried out.
    pub fn check(&self, sides: Sides) -> Result<(), OpponentsError> {
        let has_learner = self.weights.iter().any(|(opponent, _)| *opponent == Opponent::Learner);
        match (sides.are_both(), has_learner) {
            (false, true) => Err(OpponentsError::OneSide),
            (true, false) => Err(OpponentsError::NoLearner(self.to_string())),
            _ => Ok(()),
        }
    }

    /// The opponents and their weights.
    pub fn weights(&self) -> &[(Opponent, f64)] {
        &self.weights
    }

    /// The opponents and their shares of the episodes.
    fn shares(&self) -> impl Iterator<Item = (Opponent, f64)> {
        let total: f64 = self.weights.iter().map(|(_, weight)| weight).sum();
        self.weights.iter().map(move |(opponent, weight)| (*opponent, weight / total))
    }

    /// The opponent of an episode.
    pub(crate) fn draw(&self, generator: &mut Generator) -> Opponent {
        if let [(opponent, _)] = *self.weights {
            return opponent; // nothing is drawn, so battles are those without other opponents
        }
        let total: f64 = self.weights.iter().map(|(_, weight)| weight).sum();
        let mut rest = generator.next_share() * total;
        let mut last = Opponent::AttackMove;
        for &(opponent, weight) in &self.weights {
            last = opponent;
            rest -= weight;
            if rest < 0.0 {
                break;
            }
        }
        last
    }
}

impl FromStr for Opponents {
    type Err = OpponentsError;

    fn from_str(text: &str) -> Result<Opponents, OpponentsError> {
        Opponents::new(Opponents::named_in(text)?)
    }
}

impl fmt::Display for Opponents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let [(opponent, _)] = *self.weights {
            return f.write_str(opponent.name());
        }
        let parts = self.weights.iter().map(|(opponent, weight)| format!("{}={weight}", opponent.name()));
        f.write_str(&parts.collect::<Vec<_>>().join(","))
    }
}

impl TryFrom<BTreeMap<String, f64>> for Opponents {
    type Error = OpponentsError;

    fn try_from(weights: BTreeMap<String, f64>) -> Result<Opponents, OpponentsError> {
        Opponents::new(weights)
    }
}

impl From<Opponents> for BTreeMap<String, f64> {
    fn from(opponents: Opponents) -> BTreeMap<String, f64> {
        let own = opponents.weights.into_iter();
        own.map(|(opponent, weight)| (opponent.name().to_owned(), weight)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opponents_are_drawn_by_their_weights() {
        let opponents: Opponents = "attack_move=1, kite=2,hold=5".parse().unwrap();
        let (mut generator, mut counts) = (Generator::new(7), [0; Opponent::ALL.len()]);
        (0..8000).for_each(|_| counts[opponents.draw(&mut generator).index()] += 1);
        let [attack_move, kite, hold] =
            ["attack_move", "kite", "hold"].map(|name| counts[Opponent::from_name(name).unwrap().index()]);
        assert_eq!(attack_move + kite + hold, 8000);
        // Six standard deviations.
        assert!((f64::from(attack_move) - 1000.0).abs() < 6.0 * (8000.0f64 * 0.125 * 0.875).sqrt());
        assert!((f64::from(kite) - 2000.0).abs() < 6.0 * (8000.0f64 * 0.25 * 0.75).sqrt());
    }

    /// A report called runs with opponents `1,1` and `0.5,0.5` runs of other battles.
    #[test]
    fn opponents_are_equal_by_their_shares() {
        let read = |text: &str| text.parse::<Opponents>().unwrap();
        assert_eq!(read("kite=0.1,hold=0.2"), read("hold=200,kite=100"));
        assert_eq!(read("attack_move=2"), Opponents::default());
        assert_ne!(read("kite=1,hold=2"), read("kite=1,hold=2.001"));
        assert_ne!(read("kite=1,hold=2"), read("kite=1,line=2"));
        assert_ne!(read("kite,hold"), read("kite"));
    }

    #[test]
    fn opponents_have_the_weights_that_they_are_given() {
        let opponents: Opponents = "kite=0.5,hold=1".parse().unwrap();
        let kite = Opponent::from_name("kite").unwrap();
        assert!(opponents.weights().contains(&(kite, 0.5)) && opponents.weights().len() == 2);
        let json = serde_json::to_value(&opponents).unwrap();
        assert_eq!(json, serde_json::json!({ "kite": 0.5, "hold": 1.0 }));
        assert!(!opponents.is_default() && Opponents::default().is_default());
    }

    #[test]
    fn an_index_is_the_place_among_all() {
        assert!(Opponent::ALL.iter().enumerate().all(|(i, opponent)| opponent.index() == i));
    }

    #[test]
    fn one_opponent_draws_nothing() {
        let mut generator = Generator::new(7);
        assert_eq!(Opponents::default().draw(&mut generator), Opponent::AttackMove);
        assert_eq!(generator, Generator::new(7));
    }

    #[test]
    fn what_names_no_opponents_is_an_error_that_says_what_is_accepted() {
        let error = |text: &str| text.parse::<Opponents>().unwrap_err().to_string();
        assert!(error("kites").starts_with("unknown opponent `kites`; the opponents are attack_move, "));
        assert!(error("kites").ends_with(" (did you mean `kite`?)"));
        assert!(error("focusfire").ends_with(", and learner with sides `both` (did you mean `focus_fire`?)"));
        assert!(error("zoo:3m").ends_with(", and learner with sides `both`"));
        assert!(error("").contains("at least one opponent"));
        assert_eq!(error("kite,kite=2"), "opponent `kite` is named twice");
        for weight in ["0", "-1", "nan", "inf", "1e308", "half"] {
            assert!(
                error(&format!("kite={weight}")).contains("must be a number above 0, at most 1000000"),
                "{weight}"
            );
        }
        let json = r#"{"hold": 1.0, "kite": 0.5}"#;
        let opponents: Opponents = serde_json::from_str(json).unwrap();
        assert_eq!(opponents.to_string(), "kite=0.5,hold=1");
        assert!(
            serde_json::from_str::<Opponents>(r#"{"holds": 1}"#).unwrap_err().to_string().contains("holds")
        );
    }

    /// With a script alone, the numbers for the enemies would have no effect, and a learner would see zeros.
    #[test]
    fn numbers_for_the_enemies_and_a_learner_who_gives_them_come_together() {
        let check = |text: &str, sides| {
            text.parse::<Opponents>().unwrap().check(sides).map_err(|error| error.to_string())
        };
        for (text, sides) in
            [("kite", Sides::Allies), ("learner", Sides::Both), ("learner=1,kite=3", Sides::Both)]
        {
            assert_eq!(check(text, sides), Ok(()), "{text}");
        }
        assert!(check("learner=1,kite=3", Sides::Allies).unwrap_err().contains("needs sides `both`"));
        let error = check("hold,kite=2", Sides::Both).unwrap_err();
        assert!(error.contains("must include `learner`"), "{error}");
        assert!(error.contains("got `kite=2,hold=1`"), "{error}");
    }
}
