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
        let n_actions = avail_actions.len() / actions.len();
        for (enemy, (&action, row)) in actions.iter().zip(avail_actions.chunks_exact(n_actions)).enumerate() {
            let is_available = usize::try_from(action).is_ok_and(|action| row.get(action) == Some(&1));
            assert!(
                is_available,
                "the team of the enemies chose action {action} for enemy {enemy}: unavailable"
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_engine::{Arena, Rules, Sides};
    use smaclite_scenarios::Scenario;
    use std::sync::Arc;

    struct Always(i32);

    impl EnemyPolicy for Always {
        fn act(&mut self, _: EnemyView<'_>, actions: &mut [i32]) {
            actions.fill(self.0);
        }
    }

    /// It was played as something else, and what was recorded of the battle could not be played again.
    #[test]
    #[should_panic = "chose action 99 for enemy 0: unavailable"]
    fn an_unavailable_action_of_a_team_is_its_fault() {
        let arena = Arena::new(&Scenario::standard("3m").unwrap(), Rules::default());
        let battle = Battle::new(Arc::new(arena.with_sides(Sides::Mirrored)), 0);
        let team =
            EnemyTeam { name: "own".to_owned(), last_actions: 0, make: Arc::new(|| Box::new(Always(99))) };
        let mut player = EnemyPlayer::new(&team, battle.arena().sizes());
        let agents = [const { AtomicI32::new(1) }; 3];
        player.join(&battle, None, JointAction::new(&agents), &mut Scratch::new());
    }
}
