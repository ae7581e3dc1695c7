//! Who plays the enemies in a run, as its hyperparameters say.

use super::{ConfigError, ensure};
use serde::{Deserialize, Serialize};
use smaclite_engine::{BattleSetup, Opponent, Opponents, Sides};
use std::path::{Path, PathBuf};

/// Who plays the enemies.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Enemies {
    /// The scripts of the setup.
    #[default]
    Scripts,
    /// A trained team, which does not learn. The run keeps a copy of it.
    Team {
        /// The folder of its run.
        folder: PathBuf,
    },
    /// The team that is trained, and copies of it.
    SelfPlay(SelfPlay),
}

/// Shares of episodes, and the copies of a league.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SelfPlay {
    /// Share of the episodes in which the script `attack_move` plays the enemies, 0 to 0.9.
    pub script_share: f64,
    /// Share of the other episodes in which the present team plays both sides and learns from both, 0 to 1;
    /// in the rest, copies play the enemies.
    pub self_share: f64,
    /// A copy is made every that many updates, 1 to 1000000.
    pub league_every: u64,
    /// Most copies that are drawn from, 0 to 64.
    pub league_size: usize,
    /// A side learns from what it earns less what the other side earns. Returns are what it earns.
    #[serde(default)] // as runs that do not say it
    pub zero_sum: bool,
}

impl SelfPlay {
    /// The present team plays both sides of all episodes.
    pub const ALONE: SelfPlay =
        SelfPlay { script_share: 0.0, self_share: 1.0, league_every: 10, league_size: 0, zero_sum: false };

    /// Copies and the script play the enemies too.
    pub const LEAGUE: SelfPlay =
        SelfPlay { script_share: 0.2, self_share: 0.5, league_every: 10, league_size: 16, zero_sum: false };

    /// Whether a copy is made after that many updates.
    pub(crate) fn copies_after(&self, updates: u64) -> bool {
        self.league_size > 0 && updates.is_multiple_of(self.league_every)
    }

    fn check(&self) -> Result<(), ConfigError> {
        let SelfPlay { script_share, self_share, league_every, league_size, .. } = *self;
        ensure((0.0..=0.9).contains(&script_share), "script_share", "between 0 and 0.9", &script_share)?;
        ensure((0.0..=1.0).contains(&self_share), "self_share", "between 0 and 1", &self_share)?;
        let every = (1..=1_000_000).contains(&league_every);
        ensure(every, "league_every", "between 1 and 1000000", &league_every)?;
        ensure(league_size <= 64, "league_size", "between 0 and 64", &league_size)
    }
}

impl Enemies {
    /// Whether scripts play all episodes.
    pub fn are_scripts(&self) -> bool {
        *self == Enemies::Scripts
    }

    /// The setup of the lanes of a run: where a team plays the enemies, they are played by joint actions and
    /// see a mirror image, so that what was trained as allies can play them.
    pub fn setup(&self, setup: &BattleSetup) -> BattleSetup {
        let share = match *self {
            Enemies::Scripts => return setup.clone(),
            Enemies::Team { .. } => 0.0,
            Enemies::SelfPlay(SelfPlay { script_share, .. }) => script_share,
        };
        let mut setup = setup.clone().with_sides(Sides::Mirrored);
        let weights = [(Opponent::Learner.name(), 1.0 - share), (Opponent::AttackMove.name(), share)];
        // A share of 0 is no opponent.
        if let Ok(mixture) = Opponents::new(weights.into_iter().filter(|(_, weight)| *weight > 0.0)) {
            setup.opponents = mixture;
        }
        setup
    }

    /// The folder of the team that plays them.
    pub(crate) fn folder(&self) -> Option<&Path> {
        match self {
            Enemies::Team { folder } => Some(folder),
            Enemies::Scripts | Enemies::SelfPlay(_) => None,
        }
    }

    /// Share of the episodes without a script in which the present team plays both sides.
    pub(crate) fn self_share(&self) -> f64 {
        match self {
            Enemies::SelfPlay(SelfPlay { self_share, .. }) => *self_share,
            Enemies::Scripts | Enemies::Team { .. } => 0.0,
        }
    }

    /// Checks the ranges.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        match self {
            Enemies::SelfPlay(self_play) => self_play.check(),
            Enemies::Scripts | Enemies::Team { .. } => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setups::resolve_scenario;
    use smaclite_engine::Rules;

    #[test]
    fn teams_play_mirrored_enemies_beside_the_script() {
        let setup = resolve_scenario("3m", Rules::default()).unwrap();
        let check = |enemies: Enemies, opponents: &str| {
            let of_lanes = enemies.setup(&setup);
            assert_eq!(of_lanes.opponents.to_string(), opponents);
            assert_eq!(of_lanes.sides, Sides::Mirrored);
        };
        check(Enemies::Team { folder: "runs/3m".into() }, "learner");
        check(Enemies::SelfPlay(SelfPlay::ALONE), "learner");
        check(Enemies::SelfPlay(SelfPlay::LEAGUE), "attack_move=0.2,learner=0.8");
        assert_eq!(Enemies::Scripts.setup(&setup), setup);
    }

    #[test]
    fn shares_out_of_range_are_refused() {
        let check = |change: fn(&mut SelfPlay), expected: &str| {
            let mut self_play = SelfPlay::LEAGUE;
            change(&mut self_play);
            assert_eq!(Enemies::SelfPlay(self_play).check().unwrap_err().to_string(), expected);
        };
        check(|play| play.script_share = 1.0, "script_share must be between 0 and 0.9, got 1");
        check(|play| play.self_share = f64::NAN, "self_share must be between 0 and 1, got NaN");
        check(|play| play.league_every = 0, "league_every must be between 1 and 1000000, got 0");
        check(|play| play.league_size = 65, "league_size must be between 0 and 64, got 65");
        assert_eq!(Enemies::SelfPlay(SelfPlay::LEAGUE).check(), Ok(()));
    }
}
