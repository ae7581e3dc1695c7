//! The settings of a lane that its pool, its transport and its learner share.

use crate::autoreset::Autoreset;
use crate::enemy_team::EnemyTeam;
use crate::fields::{Field, FieldSet};
use crate::joint_action::MakeHook;
use crate::layout::Layout;
use serde::{Deserialize, Serialize};
use smaclite_engine::{Arena, EnemySizes, MAX_LAST_ACTIONS, RecordLayout, RecordSizes, Sizes};
use std::sync::Arc;

/// The most environments that a lane can have. Ids travel as i32, and a frame must fit into memory.
pub const MAX_ENVS: usize = 1_000_000;

/// How many environments a lane has, and how they are stepped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LaneSettings {
    /// Environments (N), 1 to [`MAX_ENVS`].
    pub num_envs: usize,
    /// Slots of a frame (M), 1 to N: N for synchronous stepping, fewer for asynchronous.
    pub batch_size: usize,
    /// Environment `i` starts with seed `seed + i` in every session.
    pub seed: u64,
    /// What happens at the end of an episode.
    #[serde(rename = "autoreset_mode")]
    pub autoreset: Autoreset,
    /// The fields of a frame; the `final_*` ones are kept only under same-step autoreset.
    pub fields: FieldSet,
    /// How many of its own last actions an agent observes, 0 to [`MAX_LAST_ACTIONS`]: after the features of
    /// the environment, as one-hot vectors of `n_actions`, the newest first; zeros where the episode is
    /// younger.
    pub obs_last_actions: usize,
    /// Whether an agent observes its own number: as a one-hot vector of `n_agents` at the end.
    pub obs_agent_id: bool,
    /// How many of its own last actions a unit of the team observes that plays the enemies; 0 without one.
    pub team_last_actions: usize,
}

/// A setting of a lane that is out of range.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum LaneSettingsError {
    #[error("the number of environments must be between 1 and {MAX_ENVS}, got {0}")]
    NumEnvs(usize),
    #[error("the batch size must be between 1 and {num_envs} (the number of environments), got {batch_size}")]
    BatchSize { batch_size: usize, num_envs: usize },
    #[error("{0} must be between 0 and {MAX_LAST_ACTIONS}, got {1}")]
    LastActions(&'static str, usize),
}

impl LaneSettings {
    /// `num_envs` synchronous environments; every other setting has its default.
    pub fn new(num_envs: usize) -> LaneSettings {
        let (autoreset, fields) = (Autoreset::default(), FieldSet::DEFAULT);
        LaneSettings {
            num_envs,
            batch_size: num_envs,
            seed: 0,
            autoreset,
            fields,
            obs_last_actions: 0,
            obs_agent_id: false,
            team_last_actions: 0,
        }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the first setting that is out of its range.
    pub fn check(&self) -> Result<(), LaneSettingsError> {
        let LaneSettings { num_envs, batch_size, .. } = *self;
        if num_envs == 0 || num_envs > MAX_ENVS {
            return Err(LaneSettingsError::NumEnvs(num_envs));
        }
        if batch_size == 0 || batch_size > num_envs {
            return Err(LaneSettingsError::BatchSize { batch_size, num_envs });
        }
        let last_actions =
            [("obs_last_actions", self.obs_last_actions), ("team_last_actions", self.team_last_actions)];
        let wrong = last_actions.into_iter().find(|(_, given)| *given > MAX_LAST_ACTIONS);
        wrong.map_or(Ok(()), |(name, given)| Err(LaneSettingsError::LastActions(name, given)))
    }

    /// How many joint actions environments and their snapshots keep, because observations have them.
    pub fn n_past(&self) -> usize {
        self.obs_last_actions.max(self.team_last_actions)
    }

    /// Is every environment stepped in every batch?
    pub fn is_synchronous(&self) -> bool {
        self.batch_size == self.num_envs
    }

    /// The fields that a frame has under this autoreset mode, in environments of these sizes.
    pub fn frame_fields(&self, sizes: Sizes) -> FieldSet {
        let (same_step, both_sides) = (self.autoreset == Autoreset::SameStep, sizes.enemies.is_some());
        let is_had =
            |field: &Field| (same_step || !field.is_final()) && (both_sides || !field.is_of_enemies());
        self.fields.iter().filter(is_had).collect()
    }

    /// The sizes of the lane's frames, for environments of these sizes: observations are longer by what the
    /// lane appends to them.
    pub fn frame_sizes(&self, of_env: Sizes) -> Sizes {
        let appended = |n_units, n_actions| {
            self.obs_last_actions * n_actions + if self.obs_agent_id { n_units } else { 0 }
        };
        let obs_size = of_env.obs_size + appended(of_env.n_agents, of_env.n_actions);
        let enemies = of_env.enemies.map(|enemies| {
            let obs_size = enemies.obs_size + appended(of_env.n_enemies, enemies.n_actions);
            EnemySizes { obs_size, ..enemies }
        });
        Sizes { obs_size, enemies, ..of_env }
    }

    /// The layout of the lane's frames, which have these [sizes](LaneSettings::frame_sizes).
    pub fn layout(&self, sizes: Sizes) -> Layout {
        let snapshot_size = self.record_layout(sizes).map_or(0, |layout| layout.size());
        Layout::new(sizes, snapshot_size, self.batch_size, self.frame_fields(sizes))
    }

    /// Where the columns of the lane's snapshots are, if its frames have them.
    pub fn record_layout(&self, sizes: Sizes) -> Option<RecordLayout> {
        let sizes = RecordSizes::new(&sizes, self.n_past());
        self.fields.contains(Field::Snapshot).then(|| RecordLayout::new(sizes))
    }
}

/// How to build a lane.
pub struct LaneSpec {
    /// The name learners attach by.
    pub name: String,
    /// Number of environments, batches, seed, autoreset, fields, and what is appended to observations.
    pub settings: LaneSettings,
    /// What the battles of all environments share.
    pub arena: Arc<Arena>,
    /// What plays the enemies, if that is a team.
    pub team: Option<EnemyTeam>,
    /// For tests and benchmarks: what environments do in place of a battle's step.
    pub hook: Option<MakeHook>,
}

impl LaneSpec {
    /// Sizes of every environment as its learner sees them: without a second side that a team plays.
    pub fn sizes(&self) -> Sizes {
        let sizes = self.arena.sizes();
        Sizes { enemies: sizes.enemies.filter(|_| self.team.is_none()), ..sizes }
    }

    /// The layout of this lane's frames.
    pub fn layout(&self) -> Layout {
        self.settings.layout(self.settings.frame_sizes(self.sizes()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_accepted_up_to_their_limits() {
        let error = |change: &dyn Fn(&mut LaneSettings)| {
            let mut settings = LaneSettings::new(4);
            change(&mut settings);
            settings.check().err()
        };
        for num_envs in [1, MAX_ENVS] {
            assert_eq!(LaneSettings::new(num_envs).check(), Ok(()));
        }
        for num_envs in [0, MAX_ENVS + 1] {
            let wrong = LaneSettings { batch_size: 1, ..LaneSettings::new(num_envs) };
            assert_eq!(wrong.check(), Err(LaneSettingsError::NumEnvs(num_envs)));
        }
        for batch_size in 0..6 {
            let wrong = Some(LaneSettingsError::BatchSize { batch_size, num_envs: 4 });
            let expected = wrong.filter(|_| !(1..=4).contains(&batch_size));
            assert_eq!(error(&|settings| settings.batch_size = batch_size), expected);
        }
        let too_many = MAX_LAST_ACTIONS + 1;
        assert_eq!(error(&|settings| settings.obs_last_actions = MAX_LAST_ACTIONS), None);
        assert_eq!(error(&|settings| settings.team_last_actions = MAX_LAST_ACTIONS), None);
        let wrong = |name| Some(LaneSettingsError::LastActions(name, too_many));
        assert_eq!(error(&|settings| settings.obs_last_actions = too_many), wrong("obs_last_actions"));
        assert_eq!(error(&|settings| settings.team_last_actions = too_many), wrong("team_last_actions"));
    }
}
