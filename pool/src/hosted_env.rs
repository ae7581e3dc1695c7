//! One environment of a lane: its tasks, autoreset, and how its slot of a frame is written.

use crate::autoreset::Autoreset;
use crate::enemy_player::EnemyPlayer;
use crate::episode_log::EpisodeLog;
use crate::fields::Field;
use crate::joint_action::{JointAction, StepHook};
use crate::lane_settings::LaneSpec;
use crate::own_features::OwnFeatures;
use crate::slot::Slot;
use smaclite_engine::{Battle, Faction, Generator, RecordLayout, Scratch, Sizes, Snapshot, Step};
use std::sync::Arc;

/// What an accepted request wants of an environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Task {
    /// Step with the accepted actions.
    Step,
    /// Begin a new episode.
    Reset,
    /// Begin a new episode with the level that waits.
    ResetTo,
    /// Take the state that waits.
    Restore,
    /// Write the present observation again, in a batch in which only other environments are reset.
    Observe,
}

/// Observations, state and available actions of each side.
type ViewFields = [(Faction, [Field; 3]); 2];

const PRESENT: ViewFields = [
    (Faction::Ally, [Field::Obs, Field::State, Field::AvailActions]),
    (Faction::Enemy, [Field::EnemyObs, Field::EnemyState, Field::EnemyAvailActions]),
];

const FINAL: ViewFields = [
    (Faction::Ally, [Field::FinalObs, Field::FinalState, Field::FinalAvailActions]),
    (Faction::Enemy, [Field::FinalEnemyObs, Field::FinalEnemyState, Field::FinalEnemyAvailActions]),
];

/// Words of bits that the available actions of an actor have.
pub(crate) fn words_per_actor(sizes: Sizes) -> usize {
    sizes.n_actions.max(sizes.enemies.map_or(0, |enemies| enemies.n_actions)).div_ceil(64)
}

/// A battle and its state as a member of a lane.
pub(crate) struct HostedEnv {
    pub(crate) battle: Battle,
    /// What a step does instead, in tests and benchmarks.
    hook: Option<StepHook>,
    /// As its learner sees it.
    sizes: Sizes,
    /// Working memory of the report of available actions, `[n_actors, words]`, if actions play both sides.
    available: Vec<u64>,
    /// Working memory of the completion of observations: which units of a side are alive.
    alive: Vec<u8>,
    /// The episode ended and the environment was not reset since.
    pub(crate) is_over: bool,
    /// What it did, if it has followers.
    pub(crate) log: Option<Box<EpisodeLog>>,
    /// What the lane appends to its observations.
    own: Option<Box<OwnFeatures>>,
    /// Where the columns of its snapshots are, if the lane's frames have them.
    record: Option<Arc<RecordLayout>>,
    /// The state that it takes at the next [`Task::Restore`]. Its memory is kept.
    staged: Option<Box<State>>,
    /// The level with which it begins at the next [`Task::ResetTo`]. Its memory is kept.
    level: Vec<f32>,
    /// The enemies, if a team plays them.
    enemies: Option<Box<EnemyPlayer>>,
}

/// A state of an environment.
#[derive(Default)]
pub(crate) struct State {
    snapshot: Snapshot,
    /// The last joint actions, as [`OwnFeatures`] keeps them.
    past_actions: Vec<i32>,
}

impl HostedEnv {
    /// Environment `index` of a lane.
    pub(crate) fn new(index: usize, spec: &LaneSpec, record: Option<Arc<RecordLayout>>) -> HostedEnv {
        let sizes = spec.sizes();
        let mut battle = Battle::new(Arc::clone(&spec.arena), spec.settings.seed.wrapping_add(index as u64));
        let fields = spec.settings.frame_fields(sizes);
        if fields.contains(Field::RewardAgents) || fields.contains(Field::EnemyRewardAgents) {
            battle.keep_shares();
        }
        HostedEnv {
            hook: spec.hook.as_ref().and_then(|make| make(index)),
            sizes,
            available: sizes
                .enemies
                .map_or(Vec::new(), |_| vec![0; sizes.n_actors() * words_per_actor(sizes)]),
            alive: Vec::new(),
            is_over: false,
            log: None,
            own: OwnFeatures::new(&spec.settings, spec.arena.sizes()),
            record,
            staged: None,
            level: Vec::new(),
            enemies: spec.team.as_ref().map(|team| Box::new(EnemyPlayer::new(team, spec.arena.sizes()))),
            battle,
        }
    }

    /// The actions that are available to its actors, `[n_actors, words]`.
    pub(crate) fn available(&mut self) -> &[u64] {
        if self.sizes.enemies.is_none() {
            return self.battle.available_bits(Faction::Ally);
        }
        // The rows of the two sides may differ in length.
        let mut rows = self.available.chunks_exact_mut(words_per_actor(self.sizes));
        for side in [Faction::Ally, Faction::Enemy] {
            let words = self.sizes.of(side).map_or(1, |sizes| sizes.n_actions.div_ceil(64));
            for (bits, row) in self.battle.available_bits(side).chunks_exact(words).zip(&mut rows) {
                row[..words].copy_from_slice(bits);
            }
        }
        &self.available
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
                let actions = match &mut self.enemies {
                    Some(enemies) => enemies.join(&self.battle, self.own.as_deref(), actions, scratch),
                    None => actions,
                };
                let step = match &mut self.hook {
                    Some(hook) => hook(&mut self.battle, actions, scratch),
                    None => self.battle.step_checked(actions.iter(), scratch),
                };
                self.is_over = step.terminated || step.truncated;
                if let Some(own) = &mut self.own {
                    own.step(actions);
                }
                if let Some(log) = &mut self.log {
                    log.step(actions.iter(), self.is_over);
                    if log.is_full() {
                        log.begin_again(self.battle.record());
                    }
                }
                Some(step)
            }
            Task::Reset => {
                self.reset();
                None
            }
            Task::ResetTo => {
                self.reset_to();
                None
            }
            Task::Restore => {
                self.restore();
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
        slot.set(Field::WasReset, u8::from(step.is_none()));
        self.write_outcome(step, slot);
        if self.is_over && autoreset == Autoreset::SameStep {
            self.write_views(&FINAL, slot, scratch);
            self.reset();
        }
        self.write_views(&PRESENT, slot, scratch);
        for (side, field) in [(Faction::Ally, Field::Alive), (Faction::Enemy, Field::EnemyAlive)] {
            if let Some(alive) = slot.row(field) {
                self.battle.write_alive(side, alive);
            }
        }
        if let Some(layout) = &self.record
            && let Some(out) = slot.row(Field::Snapshot)
        {
            self.battle.write_record(layout, self.past_actions(), out);
        }
        if let Some(out) = slot.row(Field::Level) {
            self.battle.write_level(out);
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
        self.battle.reset();
        self.begin_episode();
    }

    /// Takes the level with which it begins at the next [`Task::ResetTo`]; the reason if it cannot.
    pub(crate) fn stage_level(&mut self, level: impl Iterator<Item = f32>) -> Result<(), String> {
        self.level.clear();
        self.level.extend(level);
        self.battle.arena().check_level(&self.level).map_err(|error| error.to_string())
    }

    /// Begins with the level that waits.
    fn reset_to(&mut self) {
        self.battle.reset_to_checked(&self.level);
        self.begin_episode();
    }

    fn begin_episode(&mut self) {
        self.is_over = false;
        if let Some(own) = &mut self.own {
            own.reset();
        }
        if self.log.is_some() {
            self.begin_log();
        }
    }

    /// The last joint actions that the lane appends to observations, the newest first.
    fn past_actions(&self) -> &[i32] {
        self.own.as_ref().map_or(&[], |own| own.past_actions())
    }

    /// Writes its state to `state`.
    pub(crate) fn save_into(&self, state: &mut State) {
        self.battle.save_into(&mut state.snapshot);
        state.past_actions.clear();
        state.past_actions.extend_from_slice(self.past_actions());
    }

    /// Exchanges the state that it takes at the next [`Task::Restore`].
    pub(crate) fn exchange_staged(&mut self, state: Option<Box<State>>) -> Option<Box<State>> {
        std::mem::replace(&mut self.staged, state)
    }

    /// From the next [`Task::Restore`] on its generator is seeded with this.
    pub(crate) fn reseed_staged(&mut self, seed: u64) {
        if let Some(state) = &mut self.staged {
            state.snapshot.generator = Generator::new(seed);
        }
    }

    /// Reads the state that it takes at the next [`Task::Restore`]; the reason if it cannot have that state.
    pub(crate) fn stage(&mut self, record: &[u8], autoreset: Autoreset) -> Result<(), String> {
        let layout = self.record.as_ref().expect("the lane refuses snapshots where frames have none");
        let State { snapshot, past_actions } = &mut **self.staged.get_or_insert_default();
        let arena = self.battle.arena();
        let read = snapshot.read_record(arena, layout.sizes().n_past, record, past_actions);
        read.map_err(|error| error.to_string())?;
        if autoreset == Autoreset::SameStep && snapshot.is_over(arena) {
            return Err(
                "the episode of the snapshot is over, and with same-step autoreset none ever is".into()
            );
        }
        Ok(())
    }

    /// Takes the state that waits.
    fn restore(&mut self) {
        let Some(state) = &self.staged else { return };
        self.battle.restore_checked(&state.snapshot);
        self.is_over = self.battle.is_over();
        if let Some(own) = &mut self.own {
            own.set_past_actions(&state.past_actions);
        }
        if self.log.is_some() {
            self.begin_log();
        }
    }

    /// Begins a new episode of the log with the present state.
    fn begin_log(&mut self) {
        if let Some(log) = &mut self.log {
            log.begin(self.battle.record());
        }
    }

    fn write_outcome(&self, step: Option<Step>, slot: &mut Slot<'_>) {
        self.write_shares(step, slot);
        let step = step.unwrap_or_default();
        slot.set(Field::Reward, step.reward as f32);
        slot.set(Field::EnemyReward, step.enemy_reward as f32);
        slot.set(Field::Terminated, u8::from(step.terminated));
        slot.set(Field::Truncated, u8::from(step.truncated));
        slot.set(Field::BattleWon, u8::from(step.battle_won));
        slot.set(Field::DeadAllies, self.battle.dead_allies() as i32);
        slot.set(Field::DeadEnemies, self.battle.dead_enemies() as i32);
        slot.set(Field::EpisodeReturn, self.battle.episode_return() as f32);
        slot.set(Field::EpisodeLength, self.battle.episode_length() as i32);
        slot.set(Field::Opponent, self.battle.opponent().index() as i32);
    }

    /// The shares of single units in the rewards of a step.
    fn write_shares(&self, step: Option<Step>, slot: &mut Slot<'_>) {
        let sides = [(Faction::Ally, Field::RewardAgents), (Faction::Enemy, Field::EnemyRewardAgents)];
        for (side, field) in sides {
            let Some(out) = slot.row::<f32>(field) else { continue };
            match step {
                None => out.fill(0.0),
                Some(_) => self.battle.write_shares_of(side, out),
            }
        }
    }

    fn write_views(&mut self, fields: &ViewFields, slot: &mut Slot<'_>, scratch: &mut Scratch) {
        let battle = &self.battle;
        for &(side, [obs, state, avail]) in fields {
            let Some(Sizes { n_agents: n_units, .. }) = self.sizes.of(side) else { continue };
            if let Some(out) = slot.row(obs) {
                battle.write_obs(side, out, scratch);
                if let Some(own) = &self.own {
                    self.alive.resize(n_units, 0);
                    battle.write_alive(side, &mut self.alive);
                    own.write(own.appended, side, &self.alive, out);
                }
            }
            if let Some(out) = slot.row(state) {
                battle.write_state(side, out);
            }
            if let Some(out) = slot.row(avail) {
                battle.write_avail_actions(side, out);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lane_settings::LaneSettings;
    use smaclite_engine::{Arena, Rules};
    use smaclite_scenarios::Scenario;
    use std::sync::atomic::AtomicI32;

    /// An environment whose second step ends its episode.
    fn env(autoreset: Autoreset) -> HostedEnv {
        let arena = Arc::new(Arena::new(&Scenario::resolve("3m").unwrap(), Rules::Smaclite));
        let settings = LaneSettings { autoreset, ..LaneSettings::new(1) };
        let hook = |_| {
            let end_of_second: StepHook = Box::new(|battle, actions, scratch| {
                let step = battle.step_checked(actions.iter(), scratch);
                Step { truncated: battle.episode_length() == 2, ..step }
            });
            Some(end_of_second)
        };
        let spec = LaneSpec { name: String::new(), settings, arena, team: None, hook: Some(Box::new(hook)) };
        HostedEnv::new(0, &spec, None)
    }

    /// Else episodes would depend on how far the threads had come when a learner reset its environments.
    #[test]
    fn an_episode_whose_end_nobody_sees_is_followed_by_the_next_as_if_it_were_seen() {
        for autoreset in [Autoreset::SameStep, Autoreset::NextStep, Autoreset::Disabled] {
            let (mut env, mut scratch) = (env(autoreset), Scratch::new());
            let stop = [1; 3].map(AtomicI32::new);
            let mut length_after_step = || {
                env.run(Task::Step, JointAction::new(&stop), autoreset, &mut scratch);
                env.discard(autoreset);
                (env.battle.episode_length(), env.is_over)
            };
            assert_eq!(length_after_step(), (1, false));
            let is_kept = autoreset != Autoreset::SameStep;
            assert_eq!(length_after_step(), (if is_kept { 2 } else { 0 }, is_kept));
        }
    }
}
