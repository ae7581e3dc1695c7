//! The enemies of one environment, played by a team: the learner's actions of the agents become the joint
//! action of both sides.

use crate::enemy_team::{EnemyPolicy, EnemyTeam, EnemyView};
use crate::joint_action::JointAction;
use crate::own_features::{Appended, OwnFeatures};
use smaclite_engine::{Battle, Faction, Opponent, Scratch, Sizes, action};
use std::sync::atomic::AtomicI32;

pub(crate) struct EnemyPlayer {
    policy: Box<dyn EnemyPolicy>,
    appended: Appended,
    /// `[n_agents + n_enemies]`.
    joint: Vec<AtomicI32>,
    // What the team sees and chooses, row by row of the enemies.
    obs: Vec<f32>,
    avail_actions: Vec<u8>,
    alive: Vec<u8>,
    actions: Vec<i32>,
}

impl EnemyPlayer {
    /// `sizes` are those of the battle, which has both sides.
    pub(crate) fn new(team: &EnemyTeam, sizes: Sizes) -> EnemyPlayer {
        let Sizes { n_agents: n_enemies, n_actions, obs_size, .. } =
            sizes.of(Faction::Enemy).unwrap_or_default();
        EnemyPlayer {
            policy: (team.make)(),
            appended: Appended { last_actions: team.last_actions, agent_id: false },
            joint: (0..sizes.n_actors()).map(|_| AtomicI32::new(0)).collect(),
            obs: vec![0.0; n_enemies * (obs_size + team.last_actions * n_actions)],
            avail_actions: vec![0; n_enemies * n_actions],
            alive: vec![0; n_enemies],
            actions: vec![0; n_enemies],
        }
    }

    /// Chooses the enemies' actions and puts them behind those of the agents. `past` has the actions before.
    pub(crate) fn join(
        &mut self,
        battle: &Battle,
        past: Option<&OwnFeatures>,
        agents: JointAction<'_>,
        scratch: &mut Scratch,
    ) -> JointAction<'_> {
        match battle.opponent() {
            Opponent::Learner => self.act(battle, past, scratch),
            _ => self.actions.fill(action::NO_OP as i32), // a script plays this episode
        }
        let joint = JointAction::new(&self.joint);
        let actions = agents.iter().chain(self.actions.iter().copied());
        actions.enumerate().for_each(|(place, action)| joint.set(place, action));
        joint
    }

    fn act(&mut self, battle: &Battle, past: Option<&OwnFeatures>, scratch: &mut Scratch) {
        let EnemyPlayer { policy, appended, obs, avail_actions, alive, actions, .. } = self;
        battle.write_obs(Faction::Enemy, obs, scratch);
        battle.write_avail_actions(Faction::Enemy, avail_actions);
        battle.write_alive(Faction::Enemy, alive);
        if let Some(past) = past {
            past.write(*appended, Faction::Enemy, alive, obs);
        }
        let (position, episode_length) = (battle.generator().position(), battle.episode_length());
        policy.act(EnemyView { obs, avail_actions, position, episode_length }, actions);
    }
}
