//! Battles that are played here, without a pool: some episodes in lockstep, so that a team chooses the
//! actions of all of them at once. Either those of a pairing, or those of one player whose steps are shown.

mod pairing;
mod player;

use crate::actor::{Actor, Draw, Rows};
use crate::policy::Choice;
use crate::random::Purpose;
use crate::trained_team::TrainedTeam;
use smaclite_engine::policy::{Scripted, Tactic};
use smaclite_engine::{Arena, Battle, Faction, Scratch, Sizes, Step};
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;

pub use pairing::Pairing;
pub use player::Player;

/// Episodes in lockstep. Their number decides the last bits of a team's outputs, so it does not depend on the
/// number of threads.
pub const LOCKSTEP: usize = 32;

/// How an episode ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ended {
    /// The side whose opponents are all dead, if some of its own units are alive.
    pub winner: Option<Faction>,
    /// The agents won by the rules of the battle, as lanes say: also if the last units of both sides died.
    pub battle_won: bool,
    /// Of the agents and of the enemies.
    pub returns: [f64; 2],
    /// Number of steps.
    pub length: u32,
}

impl Ended {
    fn exchanged(self) -> Ended {
        let [agents, enemies] = self.returns;
        Ended { winner: self.winner.map(Faction::opponent), returns: [enemies, agents], ..self }
    }
}

/// How battles are played: what all of a tournament, or of a recording, have in common.
#[derive(Clone, Copy, Debug)]
pub struct Play {
    /// Episode `i` (of each pairing) is seeded with `seed + i`.
    pub seed: u64,
    /// How the team with the agents chooses actions, and how that with the enemies does.
    pub choices: [Choice; 2],
}

impl Play {
    /// The seed of an episode's battle, and of scripts that draw.
    pub fn seed_of(self, episode: usize) -> u64 {
        self.seed.wrapping_add(episode as u64)
    }

    /// What the actions of a step are drawn by.
    fn draw(self, purpose: Purpose, step: u64) -> Draw {
        Draw { seed: self.seed, purpose, step }
    }

    /// Plays the episodes from `first` on, as many as there is room for in `ended`.
    pub fn episodes(
        self,
        pairing: &Pairing,
        players: &[Player],
        first: usize,
        ended: &mut [Ended],
        scratch: &mut Scratch,
    ) {
        let rows = first..first + ended.len();
        let [agents, enemies] = pairing.seats().map(|player| &players[player]);
        // A script plays the enemies inside the engine.
        let players = Players { agents, enemies: enemies.team() };
        let battles = self.in_lockstep(&pairing.arena, players, rows, ended.len(), scratch, |_, _, _| {});
        for (ended, battle) in ended.iter_mut().zip(battles) {
            *ended = if pairing.is_exchanged { battle.exchanged() } else { battle };
        }
    }

    /// Plays the first `count` of some episodes to their ends, and shows every step of every battle: the
    /// number of the battle, from 0, its joint action and what came of it.
    ///
    /// The number of `rows` decides the last bits of a team's outputs, and `count` no bit: rows without a
    /// battle are as those whose battle is over.
    pub fn in_lockstep(
        self,
        arena: &Arc<Arena>,
        players: Players<'_>,
        rows: Range<usize>,
        count: usize,
        scratch: &mut Scratch,
        mut observe: impl FnMut(usize, &[i32], &Step),
    ) -> Vec<Ended> {
        let battle = |i| Running::new(Battle::new(Arc::clone(arena), self.seed_of(i)));
        let mut battles: Vec<Running> = rows.clone().take(count).map(battle).collect();
        let mut agents = Seat::new(players.agents, self, arena.sizes(), rows.clone());
        let mut enemies = players.enemies.map(|team| TeamSeat::new(team, Faction::Enemy, rows));
        let mut joint = Vec::new();
        for step in 0.. {
            if battles.iter().all(|running| running.battle.is_over()) {
                break;
            }
            let [of_agents, of_enemies] = self.choices;
            agents.act(&battles, self.draw(Purpose::Evaluation, step), of_agents, scratch);
            if let Some(enemies) = &mut enemies {
                enemies.act(&battles, self.draw(Purpose::EnemyEvaluation, step), of_enemies, scratch);
            }
            for (i, running) in battles.iter_mut().enumerate().filter(|(_, r)| !r.battle.is_over()) {
                joint.clear();
                joint.extend_from_slice(agents.actions_of(i));
                joint.extend_from_slice(enemies.as_ref().map_or(&[], |enemies| enemies.actions_of(i)));
                observe(i, &joint, &running.step(&joint, scratch));
            }
        }
        battles.iter().map(Running::ended).collect()
    }
}

/// Who chooses actions.
#[derive(Clone, Copy)]
pub struct Players<'a> {
    /// Those of the agents.
    pub agents: &'a Player,
    /// `None` if a script plays the enemies inside the engine.
    pub enemies: Option<&'a TrainedTeam>,
}

/// A battle in its only episode.
struct Running {
    battle: Battle,
    enemy_return: f64,
}

impl Running {
    fn new(battle: Battle) -> Running {
        Running { battle, enemy_return: 0.0 }
    }

    fn step(&mut self, actions: &[i32], scratch: &mut Scratch) -> Step {
        // Scripts and actors choose available actions only.
        let step = self.battle.step_checked(actions.iter().copied(), scratch);
        self.enemy_return += step.enemy_reward;
        step
    }

    fn ended(&self) -> Ended {
        let Running { battle, enemy_return } = self;
        let [agents, enemies] = [Faction::Ally, Faction::Enemy].map(|side| battle.is_won_by(side));
        let winner = match (agents, enemies) {
            (true, false) => Some(Faction::Ally),
            (false, true) => Some(Faction::Enemy),
            _ => None, // the time is over, or the last units of both sides died in one step
        };
        let returns = [battle.episode_return(), *enemy_return];
        Ended { winner, battle_won: agents, returns, length: battle.episode_length() }
    }
}

/// Who chooses the actions of the agents.
enum Seat<'a> {
    Scripts(ScriptSeat),
    Team(Box<TeamSeat<'a>>),
}

impl<'a> Seat<'a> {
    fn new(player: &'a Player, play: Play, sizes: Sizes, episodes: Range<usize>) -> Seat<'a> {
        match player {
            Player::Team(team) => Seat::Team(Box::new(TeamSeat::new(team, Faction::Ally, episodes))),
            Player::Tactic(tactic) => Seat::Scripts(ScriptSeat::new(*tactic, play, sizes.n_agents, episodes)),
            Player::March(_) => unreachable!("what marches plays the enemies"),
        }
    }

    fn act(&mut self, battles: &[Running], draw: Draw, choice: Choice, scratch: &mut Scratch) {
        match self {
            Seat::Scripts(seat) => seat.act(battles),
            Seat::Team(seat) => seat.act(battles, draw, choice, scratch),
        }
    }

    fn actions_of(&self, battle: usize) -> &[i32] {
        match self {
            Seat::Scripts(seat) => &seat.actions[battle],
            Seat::Team(seat) => seat.actions_of(battle),
        }
    }
}

/// A script on the side of the agents.
struct ScriptSeat {
    /// One per battle, so that what `random` draws does not depend on the others.
    scripts: Vec<Scripted>,
    /// By battle.
    actions: Vec<Vec<i32>>,
}

impl ScriptSeat {
    fn new(tactic: Tactic, play: Play, n_agents: usize, episodes: Range<usize>) -> ScriptSeat {
        let actions = vec![vec![0; n_agents]; episodes.len()];
        ScriptSeat { scripts: episodes.map(|i| Scripted::new(tactic, play.seed_of(i))).collect(), actions }
    }

    fn act(&mut self, battles: &[Running]) {
        for ((script, actions), running) in self.scripts.iter_mut().zip(&mut self.actions).zip(battles) {
            if !running.battle.is_over() {
                script.act(&running.battle, actions);
            }
        }
    }
}

/// A team on one side. Battles that are over keep their rows, with no available action.
struct TeamSeat<'a> {
    team: &'a TrainedTeam,
    side: Faction,
    /// By which its actions are drawn.
    episodes: Range<usize>,
    actor: Actor,
    obs: Vec<f32>,
    avail_actions: Vec<u8>,
    /// The actions of the last steps, as many as the team observes, each `[battles, n_agents]`; the newest
    /// first.
    past: VecDeque<Vec<i32>>,
}

impl<'a> TeamSeat<'a> {
    fn new(team: &'a TrainedTeam, side: Faction, episodes: Range<usize>) -> TeamSeat<'a> {
        let Sizes { n_agents, n_actions, obs_size, .. } = team.run.sizes;
        let rows = episodes.len() * n_agents;
        let (obs, avail_actions) = (vec![0.0; rows * obs_size], vec![0; rows * n_actions]);
        let (actor, past) = (Actor::default(), VecDeque::new());
        TeamSeat { team, side, episodes, actor, obs, avail_actions, past }
    }

    fn act(&mut self, battles: &[Running], draw: Draw, choice: Choice, scratch: &mut Scratch) {
        let sizes = self.team.run.sizes;
        let obs = self.obs.chunks_exact_mut(sizes.n_agents * sizes.obs_size);
        let avail_actions = self.avail_actions.chunks_exact_mut(sizes.n_agents * sizes.n_actions);
        for (i, ((running, obs), avail_actions)) in battles.iter().zip(obs).zip(avail_actions).enumerate() {
            if running.battle.is_over() {
                obs.fill(0.0);
                avail_actions.fill(0);
                continue;
            }
            let past = self.past.iter().map(|actions| &actions[i * sizes.n_agents..]);
            self.team.observe(&running.battle, self.side, past, scratch, obs, avail_actions);
        }
        let rows = Rows { sizes, obs: &self.obs, available: &self.avail_actions };
        self.actor.act(&self.team.network, rows, choice, draw, self.episodes.clone());
        self.past.push_front(self.actor.chosen.actions.clone());
        self.past.truncate(self.team.run.config.last_actions);
    }

    fn actions_of(&self, battle: usize) -> &[i32] {
        let n_agents = self.team.run.sizes.n_agents;
        &self.actor.chosen.actions[battle * n_agents..][..n_agents]
    }
}
