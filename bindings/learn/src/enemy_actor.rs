//! Actions of the enemies that teams play, and the joint actions of both sides. The environments of a lane
//! are divided by who plays their enemies, and each part is one pass through that team's network.

use crate::actor::{Actor, Chosen, Draw, Rows};
use crate::league::{League, Player};
use crate::policy::Choice;
use crate::team::Network;
use crate::view::View;
use smaclite_engine::{Faction, Opponent, Sizes};
use smaclite_ipc::Batch;
use smaclite_pool::fields::Field;

/// Who acts on a batch: the team that is trained, and the league.
#[derive(Clone, Copy)]
pub(crate) struct Teams<'a> {
    pub own: &'a Network,
    pub league: &'a League,
}

/// The memory of the actions on one lane.
#[derive(Debug, Default)]
pub(crate) struct BothActors {
    pub allies: Actor,
    pub enemies: EnemyActor,
    joint: Vec<i32>,
}

impl BothActors {
    /// Chooses the actions of the agents, and draws those of the enemies if teams play them, with the random
    /// numbers of either.
    pub fn act(
        &mut self,
        teams: Teams<'_>,
        batch: &Batch,
        sizes: Sizes,
        first_env: usize,
        choice: Choice,
        [of_allies, of_enemies]: [Draw; 2],
    ) {
        let BothActors { allies, enemies, joint } = self;
        joint.clear();
        let rows = View::of(batch, Faction::Ally, sizes).rows;
        allies.act(teams.own, rows, choice, of_allies, first_env..);
        let Some(enemy_sizes) = sizes.of(Faction::Enemy).filter(|_| teams.league.is_played()) else {
            return;
        };
        let rows = View::of(batch, Faction::Enemy, enemy_sizes).rows;
        enemies.act(teams, batch, rows, first_env, of_enemies);
        let of_enemies = enemies.chosen.actions.chunks(enemy_sizes.n_agents);
        for (allies, enemies) in allies.chosen.actions.chunks(sizes.n_agents).zip(of_enemies) {
            joint.extend_from_slice(allies);
            joint.extend_from_slice(enemies);
        }
    }

    /// What was chosen, `[environments, n_agents]` or `[environments, n_agents + n_enemies]`.
    pub fn actions(&self) -> &[i32] {
        if self.joint.is_empty() { &self.allies.chosen.actions } else { &self.joint }
    }
}

/// The memory of the enemies' actions on one lane.
#[derive(Debug, Default)]
pub(crate) struct EnemyActor {
    actor: Actor,
    obs: Vec<f32>,
    available: Vec<u8>,
    /// The environments of a part.
    envs: Vec<usize>,
    /// By environment of the lane.
    players: Vec<Option<Player>>,
    /// What the enemies do.
    pub chosen: Chosen,
}

/// Who plays the enemies in each environment of a batch, from `first_env` on; `None` for a script.
pub(crate) fn players<'a>(
    batch: &'a Batch,
    league: &'a League,
    first_env: usize,
) -> impl Iterator<Item = Option<Player>> + 'a {
    let opponents: &[i32] = batch.field(Field::Opponent).unwrap_or(&[]);
    let learner = Opponent::Learner.index() as i32;
    let of_lane = &league.players[first_env..];
    opponents.iter().zip(of_lane).map(move |(opponent, player)| (*opponent == learner).then_some(*player))
}

impl EnemyActor {
    /// Draws an action for every enemy that a team plays; the others have no-op.
    fn act(&mut self, teams: Teams<'_>, batch: &Batch, rows: Rows<'_>, first_env: usize, draw: Draw) {
        self.players.clear();
        self.players.extend(players(batch, teams.league, first_env));
        let n_rows = self.players.len() * rows.sizes.n_agents;
        self.chosen.clear(n_rows, teams.own.architecture.padded_out());
        let mut distinct: Vec<Player> = self.players.iter().copied().flatten().collect();
        distinct.sort_unstable();
        distinct.dedup();
        for player in distinct {
            self.gather(rows, player);
            let EnemyActor { actor, obs, available, envs, chosen, .. } = self;
            let numbers = envs.iter().map(|env| first_env + env);
            let rows = Rows { obs, available, ..rows };
            actor.act(teams.league.actor(player, teams.own), rows, Choice::Sampled, draw, numbers);
            for (i, env) in envs.iter().enumerate() {
                chosen.copy_env(*env, &actor.chosen, i, rows.sizes.n_agents);
            }
        }
    }

    /// Copies the rows of the environments that a player plays.
    fn gather(&mut self, rows: Rows<'_>, player: Player) {
        let EnemyActor { obs, available, envs, players, .. } = self;
        envs.clear();
        envs.extend((0..players.len()).filter(|env| players[*env] == Some(player)));
        let Sizes { n_agents, n_actions, obs_size, .. } = rows.sizes;
        let (obs_width, mask_width) = (n_agents * obs_size, n_agents * n_actions);
        obs.clear();
        available.clear();
        for env in envs {
            obs.extend_from_slice(&rows.obs[*env * obs_width..][..obs_width]);
            available.extend_from_slice(&rows.available[*env * mask_width..][..mask_width]);
        }
    }

    /// Whether the trained team plays the enemies of the environment.
    pub fn is_own(&self, env: usize) -> bool {
        self.players[env] == Some(Player::Own)
    }
}
