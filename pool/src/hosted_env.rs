//! One environment's place in a lane: what it was asked to do, autoreset, and how its slot of a frame is written.

use crate::environment::Environment;
use crate::fields::Field;
use crate::slot::Slot;
use serde::{Deserialize, Serialize};
use smaclite_engine::{Scratch, Step};

/// What happens to an environment whose episode ended (Gymnasium's three modes).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Autoreset {
    /// The next step ignores the action, resets, and returns the first observation with reward 0.
    #[default]
    NextStep,
    /// The step that ends an episode already returns the next one's first observation; the last observation, state
    /// and mask are in `final_*`.
    SameStep,
    /// Nothing: stepping a finished environment is an error until it is reset.
    Disabled,
}

impl Autoreset {
    /// The word used in files, options and Python.
    pub fn name(self) -> &'static str {
        match self {
            Autoreset::NextStep => "next_step",
            Autoreset::SameStep => "same_step",
            Autoreset::Disabled => "disabled",
        }
    }
}

impl std::str::FromStr for Autoreset {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        [Autoreset::NextStep, Autoreset::SameStep, Autoreset::Disabled]
            .into_iter()
            .find(|mode| mode.name() == word)
            .ok_or_else(|| format!("autoreset is `next_step`, `same_step` or `disabled`, not `{word}`"))
    }
}

/// What a seat is asked to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Task {
    /// Step with the seat's actions.
    Step,
    /// Reset, with a new seed if there is one.
    Reset { seed: Option<u64> },
    /// Write the present observation again (the rest of a batch in which only some environments are reset).
    Observe,
}

/// An environment with what a lane keeps about it.
pub(crate) struct HostedEnv {
    pub(crate) env: Box<dyn Environment>,
    /// The accepted joint action, a private copy: a learner could rewrite its sample after the check.
    pub(crate) actions: Vec<i32>,
    /// The request that has a task for this seat, until that is carried out.
    pub(crate) busy: Option<u64>,
    /// The episode ended and the environment was not reset since.
    pub(crate) over: bool,
}

/// What an episode's end adds to a lane's figures.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StepCounts {
    pub(crate) steps: u64,
    pub(crate) episodes: u64,
    pub(crate) wins: u64,
}

impl HostedEnv {
    pub(crate) fn new(env: Box<dyn Environment>) -> HostedEnv {
        let actions = vec![0; env.sizes().n_agents];
        HostedEnv { env, actions, busy: None, over: false }
    }

    /// Carries a task out up to the point where its slot is needed.
    pub(crate) fn run(&mut self, task: Task, autoreset: Autoreset, scratch: &mut Scratch) -> Option<Step> {
        match task {
            Task::Observe => None,
            Task::Step if self.over && autoreset == Autoreset::NextStep => {
                self.reset();
                None
            }
            Task::Step => {
                let step = self.env.step(&self.actions, scratch).expect("the lane checked these actions");
                self.over = step.terminated || step.truncated;
                Some(step)
            }
            Task::Reset { seed } => {
                if let Some(seed) = seed {
                    self.env.reseed(seed);
                }
                self.reset();
                None
            }
        }
    }

    /// Writes the outcome of [`run`](HostedEnv::run) into the environment's slot, resetting under same-step autoreset.
    pub(crate) fn write(
        &mut self,
        env_id: usize,
        step: Option<Step>,
        autoreset: Autoreset,
        slot: &mut Slot<'_>,
        scratch: &mut Scratch,
    ) {
        slot.set(Field::EnvId, env_id as i32);
        self.write_outcome(step, slot);
        if self.over && autoreset == Autoreset::SameStep {
            let last = [Field::FinalObs, Field::FinalState, Field::FinalAvailActions];
            self.write_view(last, slot, scratch);
            self.reset();
        }
        self.write_view([Field::Obs, Field::State, Field::AvailActions], slot, scratch);
        if let Some(alive) = slot.row(Field::Alive) {
            self.env.write_alive(alive);
        }
    }

    /// Leaves the outcome of [`run`](HostedEnv::run) unwritten, for a round that is over; the game goes on as if it were written.
    pub(crate) fn discard(&mut self, autoreset: Autoreset) {
        if self.over && autoreset == Autoreset::SameStep {
            self.reset();
        }
    }

    fn reset(&mut self) {
        self.env.reset();
        self.over = false;
    }

    fn write_outcome(&self, step: Option<Step>, slot: &mut Slot<'_>) {
        let (reward, terminated, truncated, won) = match step {
            Some(s) => (s.reward, s.terminated, s.truncated, s.battle_won),
            None => (0.0, false, false, false),
        };
        slot.set(Field::Reward, reward as f32);
        slot.set(Field::Terminated, u8::from(terminated));
        slot.set(Field::Truncated, u8::from(truncated));
        slot.set(Field::BattleWon, u8::from(won));
        slot.set(Field::DeadAllies, self.env.dead_allies() as i32);
        slot.set(Field::DeadEnemies, self.env.dead_enemies() as i32);
        slot.set(Field::EpisodeReturn, self.env.episode_return() as f32);
        slot.set(Field::EpisodeLength, self.env.episode_length() as i32);
    }

    fn write_view(&self, [obs, state, avail]: [Field; 3], slot: &mut Slot<'_>, scratch: &mut Scratch) {
        if let Some(out) = slot.row(obs) {
            self.env.write_obs(out, scratch);
        }
        if let Some(out) = slot.row(state) {
            self.env.write_state(out);
        }
        if let Some(out) = slot.row(avail) {
            self.env.write_avail_actions(out);
        }
    }
}

impl StepCounts {
    pub(crate) fn count(&mut self, step: Option<Step>) {
        if let Some(step) = step {
            self.steps += 1;
            self.episodes += u64::from(step.terminated || step.truncated);
            self.wins += u64::from(step.battle_won);
        }
    }
}
