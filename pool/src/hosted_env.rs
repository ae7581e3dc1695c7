//! One environment of a lane: its tasks, autoreset, and how its slot of a frame is written.

use crate::autoreset::Autoreset;
use crate::environment::{Environment, JointAction};
use crate::episode_log::{EpisodeLog, EpisodePart, FollowerId, LogMemory};
use crate::fields::Field;
use crate::lane_settings::LaneSettings;
use crate::own_features::OwnFeatures;
use crate::slot::Slot;
use smaclite_engine::{Scratch, Sizes, Step};

/// What an accepted request wants of an environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Task {
    /// Step with the accepted actions.
    Step,
    /// Reset, after seeding if there is a seed.
    Reset { seed: Option<u64> },
    /// Write the present observation again, in a batch in which only other environments are reset.
    Observe,
}

/// An environment and its state as a member of a lane.
pub(crate) struct HostedEnv {
    pub(crate) env: Box<dyn Environment>,
    /// Working memory of the report of its available actions.
    pub(crate) available: Vec<u64>,
    /// The episode ended and the environment was not reset since.
    pub(crate) is_over: bool,
    /// What it did, if it has followers.
    log: Option<Box<EpisodeLog>>,
    /// What the lane appends to its observations.
    own: Option<Box<OwnFeatures>>,
}

impl HostedEnv {
    pub(crate) fn new(env: Box<dyn Environment>, settings: &LaneSettings) -> HostedEnv {
        let Sizes { n_agents, n_actions, .. } = env.sizes();
        let available = vec![0; n_agents * n_actions.div_ceil(64)];
        let own = OwnFeatures::new(settings, env.sizes());
        HostedEnv { env, available, is_over: false, log: None, own }
    }

    /// Carries a task out, up to the point where its slot is needed.
    // Inlined: an outcome that is returned through memory is read back across two stores, which waits for all
    // stores before them, those to frames included.
    #[inline(always)]
    pub(crate) fn run(
        &mut self,
        task: Task,
        actions: JointAction<'_>,
        autoreset: Autoreset,
        scratch: &mut Scratch,
    ) -> Option<Step> {
        match task {
            Task::Observe => None,
            Task::Step if self.is_over && autoreset == Autoreset::NextStep => {
                self.reset();
                None
            }
            Task::Step => {
                let step = self.env.step_checked(actions, scratch);
                self.is_over = step.terminated || step.truncated;
                if let Some(own) = &mut self.own {
                    own.step(actions);
                }
                if let Some(log) = &mut self.log {
                    log.step(actions.iter(), self.is_over);
                    if log.is_full() {
                        self.begin_log();
                    }
                }
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

    /// Writes the outcome of [`run`](HostedEnv::run) into the environment's slot; resets under same-step
    /// autoreset.
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
        if self.is_over && autoreset == Autoreset::SameStep {
            let last = [Field::FinalObs, Field::FinalState, Field::FinalAvailActions];
            self.write_view(last, slot, scratch);
            self.reset();
        }
        self.write_view([Field::Obs, Field::State, Field::AvailActions], slot, scratch);
        if let Some(alive) = slot.row(Field::Alive) {
            self.env.write_alive(alive);
        }
    }

    /// Discards the outcome of [`run`](HostedEnv::run), for an epoch that is over. The environment's next
    /// results are the same as if it had been written.
    pub(crate) fn discard(&mut self, autoreset: Autoreset) {
        if self.is_over && autoreset == Autoreset::SameStep {
            self.reset();
        }
    }

    fn reset(&mut self) {
        self.env.reset();
        self.is_over = false;
        if let Some(own) = &mut self.own {
            own.reset();
        }
        if self.log.is_some() {
            self.begin_log();
        }
    }

    /// Begins a new episode of the log with the present state.
    fn begin_log(&mut self) {
        if let (Some(log), Some(now)) = (&mut self.log, self.env.save()) {
            log.begin(now);
        }
    }

    /// Adds a follower; with the first one the log begins. An environment that is no battle has no log.
    pub(crate) fn follow(&mut self, follower: FollowerId, memory: &LogMemory) {
        if self.log.is_none()
            && let Some(now) = self.env.save()
        {
            self.log = Some(Box::new(EpisodeLog::new(self.env.sizes().n_agents, now, memory.clone())));
        }
        if let Some(log) = &mut self.log {
            log.add_reader(follower);
        }
    }

    /// Removes a follower; with the last one the log ends.
    pub(crate) fn unfollow(&mut self, follower: FollowerId) {
        if self.log.as_mut().is_some_and(|log| log.remove_reader(follower)) {
            self.log = None;
        }
    }

    /// What happened since a follower's last call, as far as the budget of bytes goes.
    pub(crate) fn read_log(&mut self, follower: FollowerId, budget: &mut usize) -> Vec<EpisodePart> {
        self.log.as_mut().map_or(Vec::new(), |log| log.read(follower, budget))
    }

    /// Drops what the log has no room for any more.
    pub(crate) fn trim_log(&mut self) {
        if let Some(log) = &mut self.log {
            log.trim();
        }
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

    fn write_view(&mut self, [obs, state, avail]: [Field; 3], slot: &mut Slot<'_>, scratch: &mut Scratch) {
        if let Some(out) = slot.row(obs) {
            self.env.write_obs(out, scratch);
            if let Some(own) = &mut self.own {
                own.write(&*self.env, out);
            }
        }
        if let Some(out) = slot.row(state) {
            self.env.write_state(out);
        }
        if let Some(out) = slot.row(avail) {
            self.env.write_avail_actions(out);
        }
    }
}
