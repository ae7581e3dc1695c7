//! The battle that a page shows: a team plays the agents, but for those that a person has taken over, and
//! scripts or another team play the enemies. Every step is recorded, and encoded for the page.

use crate::game::{Game, GameError};
use crate::protocol::{PlayedSteps, ReplayFile};
use crate::team::TeamOnScenario;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use smaclite_engine::policy::Scripted;
use smaclite_engine::{Battle, IllegalAction, Scratch, Snapshot};
use smaclite_scenarios::Faction;
use smaclite_view::page::{encode_moments, encode_step};
use smaclite_view::{AgentOrder, Moment, Observer, Order, OrderError, Orders, Recorder, ReplayError, SUFFIX};
use std::collections::BTreeSet;
use std::rc::Rc;

/// Who plays the agents that nobody has taken over.
#[derive(Clone)]
pub(crate) enum Player {
    Script(Box<Scripted>),
    Team(Rc<TeamOnScenario>),
}

/// Why a request about a battle is refused.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BattleError {
    #[error(transparent)]
    Game(#[from] GameError),
    #[error(transparent)]
    Order(#[from] OrderError),
    #[error("step {step} cannot be played: {error}")]
    Action { step: usize, error: IllegalAction },
    #[error("actions must be {per_step} per step, got {given} in all")]
    ActionCount { per_step: usize, given: usize },
    #[error("agent must be below {n_agents}, got {agent}")]
    NoSuchAgent { agent: usize, n_agents: usize },
    #[error("step must be at most {steps}, which is the next one, got {step}")]
    NoSuchStep { step: usize, steps: usize },
    #[error("actions play the enemies of this replay too, so that it is only shown")]
    NotPlayable,
    #[error("the battle has no step yet")]
    NoStep,
    #[error(transparent)]
    Replay(#[from] ReplayError),
}

/// A battle, as far as it was played.
pub(crate) struct PlayedBattle {
    game: Game,
    player: Player,
    /// The team that plays the enemies, if no script does.
    enemies: Option<Rc<TeamOnScenario>>,
    taken: BTreeSet<usize>,
    orders: Orders,
    recorder: Recorder,
    observer: Observer,
    /// The states before all steps, and now.
    states: Vec<Snapshot>,
}

/// What is to be encoded of some steps.
#[derive(Default)]
struct Seen {
    moments: Vec<Moment>,
    decisions: Vec<u8>,
}

impl PlayedBattle {
    /// The battle that begins with the state of a recorder without a step.
    pub fn new(
        game: Game,
        recorder: Recorder,
        player: Player,
        enemies: Option<Rc<TeamOnScenario>>,
    ) -> PlayedBattle {
        PlayedBattle {
            player,
            enemies,
            taken: BTreeSet::new(),
            orders: Orders::new(&game.scenario),
            states: vec![recorder.battle().save()],
            observer: Observer::new(&game.scenario, recorder.battle()),
            recorder,
            game,
        }
    }

    /// What it is played with.
    pub fn game(&self) -> &Game {
        &self.game
    }

    /// Number of steps that were played.
    pub fn steps(&self) -> usize {
        self.states.len() - 1
    }

    /// Whether it can be played on: not a replay in which actions play the enemies too.
    pub fn is_playable(&self) -> bool {
        !self.game.setup.sides.are_both() || self.enemies.is_some()
    }

    /// Lets these agents carry out orders, and no others.
    pub fn take(&mut self, agents: &[usize]) -> Result<(), BattleError> {
        let n_agents = self.game.arena.sizes().n_agents;
        if let Some(&agent) = agents.iter().find(|&&agent| agent >= n_agents) {
            return Err(BattleError::NoSuchAgent { agent, n_agents });
        }
        self.taken = agents.iter().copied().collect();
        // What an agent was told before it was given back is forgotten.
        let others = (0..n_agents).filter(|agent| !self.taken.contains(agent));
        let none: Vec<_> = others.map(|agent| AgentOrder { agent, order: Order::None }).collect();
        self.give(&none)?;
        Ok(())
    }

    /// Gives agents orders, all of them or none.
    pub fn give(&mut self, orders: &[AgentOrder]) -> Result<Vec<Order>, BattleError> {
        self.orders.give(&self.game.scenario, self.recorder.battle(), orders)?;
        Ok(self.orders.current())
    }

    /// Plays these joint actions; a team that plays the enemies chooses its own. Those from the start on come
    /// with the moment there.
    pub fn play_actions(&mut self, actions: &[u16]) -> Result<PlayedSteps, BattleError> {
        let sizes = self.game.arena.sizes();
        let per_step = if self.enemies.is_some() { sizes.n_agents } else { sizes.n_actors() };
        let given = actions.len();
        if !given.is_multiple_of(per_step) {
            return Err(BattleError::ActionCount { per_step, given });
        }
        let (first, mut seen) = (self.steps(), Seen::default());
        if first == 0 {
            seen.moments.push(self.observer.moment().clone());
        }
        for actions in actions.chunks_exact(per_step) {
            self.step(actions.to_vec(), &mut seen)?;
        }
        Ok(self.encode(first, seen))
    }

    /// Plays up to so many steps by orders and the team.
    pub fn play(&mut self, steps: usize) -> Result<PlayedSteps, BattleError> {
        let (first, mut seen) = (self.steps(), Seen::default());
        while self.steps() - first < steps && !self.recorder.battle().is_over() {
            let actions = self.choose()?;
            self.step(actions, &mut seen)?;
        }
        Ok(self.encode(first, seen))
    }

    /// The actions of the agents in the next step.
    fn choose(&mut self) -> Result<Vec<u16>, BattleError> {
        if !self.is_playable() {
            return Err(BattleError::NotPlayable);
        }
        let battle = self.recorder.battle();
        let chosen = match &mut self.player {
            Player::Script(script) => {
                let mut chosen = vec![0; battle.arena().sizes().n_agents];
                script.act(battle, &mut chosen);
                chosen
            }
            Player::Team(team) => {
                let team = Rc::clone(team);
                self.act(&team, Faction::Ally)
            }
        };
        let ordered = self.orders.actions(&self.game.scenario, battle);
        let own = |(agent, (ordered, chosen))| {
            // Legal actions are below the 6 + 360 + 1000 actions of the largest scenario.
            if self.taken.contains(&agent) { ordered } else { chosen as u16 }
        };
        Ok(ordered.into_iter().zip(chosen).enumerate().map(own).collect())
    }

    /// What a team chooses for a side.
    fn act(&self, team: &TeamOnScenario, side: Faction) -> Vec<i32> {
        let sizes = self.game.arena.sizes();
        let own = match side {
            Faction::Ally => 0..sizes.n_agents,
            Faction::Enemy => sizes.n_agents..sizes.n_actors(),
        };
        let past = self.recorder.actions().chunks_exact(sizes.n_actors()).rev();
        team.act(self.recorder.battle(), side, past.map(|joint| &joint[own.clone()]), self.game.seed)
    }

    /// Plays a joint action, which is that of the agents if a team plays the enemies.
    fn step(&mut self, mut joint: Vec<u16>, seen: &mut Seen) -> Result<(), BattleError> {
        let step = self.steps();
        if let Some(team) = &self.enemies {
            // As above, no action is larger than 16 bits.
            joint.extend(self.act(team, Faction::Enemy).into_iter().map(|action| action as u16));
        }
        let actions: Vec<i32> = joint.iter().map(|&action| action.into()).collect();
        self.recorder.battle().check(&actions).map_err(|error| BattleError::Action { step, error })?;
        encode_step(self.recorder.battle(), &joint, &mut seen.decisions);
        let observer = &mut self.observer;
        let observe = |units: &_| seen.moments.push(observer.observe(units).clone());
        let played = self.recorder.step_observed(&actions, observe);
        played.map_err(|error| BattleError::Action { step, error })?;
        self.states.push(self.recorder.battle().save());
        Ok(())
    }

    /// The steps from `first` on.
    fn encode(&self, first: usize, Seen { moments, decisions }: Seen) -> PlayedSteps {
        PlayedSteps {
            step: first,
            steps: self.steps() - first,
            n_moments: moments.len(),
            moments: STANDARD.encode(encode_moments(&moments)),
            decisions: STANDARD.encode(decisions),
            episode_return: self.recorder.battle().episode_return(),
            result: self.recorder.outcome().result(),
            orders: self.orders.current(),
        }
    }

    fn battle_before(&self, step: usize) -> Option<Battle> {
        let mut battle = Battle::new(self.game.arena.clone(), 0);
        battle.restore(self.states.get(step)?).ok()?;
        Some(battle)
    }

    /// What an agent observes before a step.
    pub fn observation(&self, step: usize, agent: usize) -> Result<Vec<f32>, BattleError> {
        let sizes = self.game.arena.sizes();
        let steps = self.steps();
        let battle = self.battle_before(step).ok_or(BattleError::NoSuchStep { step, steps })?;
        let mut all = vec![0.0; sizes.n_agents * sizes.obs_size];
        battle.write_obs(Faction::Ally, &mut all, &mut Scratch::new());
        let own = all.chunks_exact(sizes.obs_size).nth(agent);
        Ok(own.ok_or(BattleError::NoSuchAgent { agent, n_agents: sizes.n_agents })?.to_vec())
    }

    /// The source of its scenario with a unit that starts elsewhere.
    pub fn with_moved_unit(&self, unit: usize, x: f64, y: f64) -> Result<String, BattleError> {
        Ok(self.game.with_moved_unit(unit, x, y)?)
    }

    /// The source of its scenario with another map.
    pub fn with_terrain(&self, rows: &[String]) -> String {
        self.game.with_terrain(rows)
    }

    /// All steps so far, as the file of a replay.
    pub fn replay(&self) -> Result<ReplayFile, BattleError> {
        let replay = self.recorder.replay();
        let episode = replay.episodes().first().ok_or(BattleError::NoStep)?;
        Ok(ReplayFile {
            name: format!("{}-seed{}.{SUFFIX}", self.game.scenario.name, self.game.seed),
            checksum: format!("{:016x}", episode.checksum),
            replay: String::from_utf8_lossy(&replay.to_json()?).into_owned(),
        })
    }
}
