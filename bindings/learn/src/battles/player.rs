//! Who plays: scripts, and teams that were trained.

use crate::trained_team::TrainedTeam;
use smaclite_engine::Opponent;
use smaclite_engine::policy::Tactic;

/// Who plays a side.
#[derive(Debug)]
pub enum Player {
    /// A script that gives its units actions, as agents have them.
    Tactic(Tactic),
    /// A script that lets enemies march, for which there are no actions: attack_move or attack_nearest.
    March(Opponent),
    /// A team that was trained.
    Team(Box<TrainedTeam>),
}

impl Player {
    /// What plays the enemies if this player does: a script, or joint actions.
    pub fn opponent(&self) -> Opponent {
        match self {
            Player::Tactic(tactic) => Opponent::Scripted(*tactic),
            Player::March(march) => *march,
            Player::Team(_) => Opponent::Learner,
        }
    }

    /// The team, if it is one.
    pub fn team(&self) -> Option<&TrainedTeam> {
        match self {
            Player::Team(team) => Some(team),
            _ => None,
        }
    }

    /// Whether it has no actions of agents.
    pub fn marches(&self) -> bool {
        matches!(self, Player::March(_))
    }
}
