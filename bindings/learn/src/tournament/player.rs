//! Who plays in a tournament: scripts, and teams that were trained.

use super::TournamentError;
use crate::trained_team::TrainedTeam;
use crate::zoo::names_team;
use smaclite_engine::Opponent;
use smaclite_engine::policy::Tactic;

/// Who plays a side.
#[derive(Debug)]
pub(crate) enum Player {
    /// A script that gives its units actions, as agents have them.
    Tactic(Tactic),
    /// A script that lets enemies march, for which there are no actions: attack_move or attack_nearest.
    March(Opponent),
    Team(Box<TrainedTeam>),
}

impl Player {
    /// The script of that name, or the team in the folder of a run.
    pub fn open(name: &str) -> Result<Player, TournamentError> {
        match Opponent::scripts().find(|script| script.name() == name) {
            Some(Opponent::Scripted(tactic)) => Ok(Player::Tactic(tactic)),
            Some(march) => Ok(Player::March(march)),
            None if names_team(name) => Ok(Player::Team(Box::new(TrainedTeam::open(name.as_ref())?))),
            None => Err(TournamentError::UnknownPlayer(name.to_owned())),
        }
    }

    /// What plays the enemies if this player does: a script, or joint actions.
    pub fn opponent(&self) -> Opponent {
        match self {
            Player::Tactic(tactic) => Opponent::Scripted(*tactic),
            Player::March(march) => *march,
            Player::Team(_) => Opponent::Learner,
        }
    }

    pub fn team(&self) -> Option<&TrainedTeam> {
        match self {
            Player::Team(team) => Some(team),
            _ => None,
        }
    }

    pub fn marches(&self) -> bool {
        matches!(self, Player::March(_))
    }
}
