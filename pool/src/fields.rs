//! The fields of a frame, declared once. Offsets, views, spaces, documentation and the layout hash derive
//! from [`FIELDS`]; no other place in the project states a field's type or shape.

mod set;

pub use set::{FieldSet, UnknownField};
pub use smaclite_engine::Dtype;

/// A dimension of a field after the slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// One per agent (`n_agents`).
    Agent,
    /// One per observation feature (`obs_size`).
    Obs,
    /// One per state feature (`state_size`).
    State,
    /// One per action (`n_actions`).
    Action,
    /// One per enemy (`n_enemies`).
    Enemy,
    /// One per feature of an enemy's observation (`enemy_obs_size`).
    EnemyObs,
    /// One per feature of the enemies' state (`enemy_state_size`).
    EnemyState,
    /// One per action of an enemy (`n_enemy_actions`).
    EnemyAction,
    /// One per byte of a snapshot (`snapshot_size`).
    Snapshot,
    /// One per unit, agents first (`n_agents + n_enemies`).
    Unit,
    /// One per column of a level ([`LEVEL_COLUMNS`](smaclite_engine::LEVEL_COLUMNS)).
    LevelColumn,
}

/// Name, type, shape and meaning of a field. Every field has one leading axis, the slot.
#[derive(Clone, Copy, Debug)]
pub struct FieldSpec {
    /// Which field this is.
    pub field: Field,
    /// The name used in Python, Rust, files and messages.
    pub name: &'static str,
    /// Element type.
    pub dtype: Dtype,
    /// The axes after the slot.
    pub axes: &'static [Axis],
    /// One line for documentation.
    pub meaning: &'static str,
}

/// Declares the fields: names in Rust and elsewhere, types, axes after the slot and meanings.
macro_rules! fields {
    ($($field:ident $name:literal: $dtype:ident [$($axis:ident),*] $meaning:literal,)*) => {
        /// A field of a frame; the discriminant is its index in [`FIELDS`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(usize)]
        #[allow(missing_docs)] // `FIELDS` says what each one means
        pub enum Field {
            $($field,)*
        }

        /// How many fields there are.
        pub const FIELD_COUNT: usize = [$($name),*].len();

        /// The table of fields, in their order in a frame.
        pub const FIELDS: [FieldSpec; FIELD_COUNT] = [$(FieldSpec {
            field: Field::$field,
            name: $name,
            dtype: Dtype::$dtype,
            axes: &[$(Axis::$axis),*],
            meaning: $meaning,
        },)*];
    };
}

fields! {
    EnvId "env_id": I32 [] "number of the environment",
    Obs "obs": F32 [Agent, Obs] "observation of each agent; zeros for dead agents",
    State "state": F32 [State] "global state, for training only",
    AvailActions "avail_actions": Bool [Agent, Action] "which actions are available in the next step",
    Alive "alive": Bool [Agent] "which agents are alive",
    Reward "reward": F32 [] "team reward of the step just made",
    Terminated "terminated": Bool []
        "the step ended the battle: all units of one side are dead, with SMACv2's interface all but healers",
    Truncated "truncated": Bool [] "the step reached the episode limit with both sides alive",
    BattleWon "battle_won": Bool []
        "all enemies are dead at its end; with SMACv2's interface all but healers, and not if all agents are",
    DeadAllies "dead_allies": I32 [] "agents that died so far in the episode, or that its level left out",
    DeadEnemies "dead_enemies": I32 []
        "enemies that died so far in the episode, or that its level left out",
    EpisodeReturn "episode_return": F32 [] "sum of rewards so far; on an episode's last step its total",
    EpisodeLength "episode_length": I32 [] "steps so far; on an episode's last step its total",
    WasReset "was_reset": Bool []
        "no step was made: the environment was reset, restored or only observed again; nothing to learn from",
    FinalObs "final_obs": F32 [Agent, Obs]
        "same-step autoreset: last obs of an episode that ended in this step; unspecified elsewhere",
    FinalState "final_state": F32 [State] "same-step autoreset: last state, as final_obs",
    FinalAvailActions "final_avail_actions": Bool [Agent, Action]
        "same-step autoreset: last avail_actions, as final_obs",
    Snapshot "snapshot": U8 [Snapshot]
        "the battle as bytes, to restore it later; only in lanes that name this field",
    Opponent "opponent": I32 []
        "what plays the enemies in the episode: index in `OPPONENTS`; only in lanes that name this field",
    Level "level": F32 [Unit, LevelColumn]
        "how the episode of `obs` began, or the state that was restored since: type, x, y, health and life \
         of each unit; only in lanes that name this field",
    RewardAgents "reward_agents": F32 [Agent]
        "share of each agent in reward: what its own hits earned, and an equal part of what nobody's did; \
         only in lanes that name this field",
    EnemyObs "enemy_obs": F32 [Enemy, EnemyObs]
        "both sides: observation of each enemy; zeros for dead ones and those that a script plays",
    EnemyState "enemy_state": F32 [EnemyState]
        "both sides: global state from the enemies' side, for training only",
    EnemyAvailActions "enemy_avail_actions": Bool [Enemy, EnemyAction]
        "both sides: which actions are available to the enemies in the next step",
    EnemyAlive "enemy_alive": Bool [Enemy] "both sides: which enemies are alive and played by actions",
    EnemyReward "enemy_reward": F32 [] "both sides: the enemies' reward of the step just made",
    EnemyRewardAgents "enemy_reward_agents": F32 [Enemy]
        "both sides: share of each enemy in enemy_reward, as reward_agents; lanes must name this field",
    FinalEnemyObs "final_enemy_obs": F32 [Enemy, EnemyObs]
        "both sides, same-step autoreset: last enemy_obs, as final_obs",
    FinalEnemyState "final_enemy_state": F32 [EnemyState]
        "both sides, same-step autoreset: last enemy_state, as final_obs",
    FinalEnemyAvailActions "final_enemy_avail_actions": Bool [Enemy, EnemyAction]
        "both sides, same-step autoreset: last enemy_avail_actions, as final_obs",
}

impl Field {
    /// The field's row of the table.
    pub const fn spec(self) -> &'static FieldSpec {
        &FIELDS[self as usize]
    }

    /// Whether the field exists only under same-step autoreset.
    pub const fn is_final(self) -> bool {
        use Field::{FinalAvailActions, FinalEnemyAvailActions, FinalEnemyObs, FinalEnemyState};
        use Field::{FinalObs, FinalState};
        matches!(self, FinalObs | FinalState | FinalAvailActions)
            || matches!(self, FinalEnemyObs | FinalEnemyState | FinalEnemyAvailActions)
    }

    /// Whether the field exists only in lanes whose joint actions play both sides.
    pub const fn is_of_enemies(self) -> bool {
        self as usize >= Field::EnemyObs as usize
    }

    /// Whether a lane can omit the field. A learner always needs to know which environment a slot is, when
    /// its episode ends, and whether a step was made.
    pub const fn is_optional(self) -> bool {
        use Field::{EnvId, Reward, Terminated, Truncated, WasReset};
        !matches!(self, EnvId | Reward | Terminated | Truncated | WasReset)
    }

    /// The field of that name.
    pub fn from_name(name: &str) -> Option<Field> {
        FIELDS.iter().find(|f| f.name == name).map(|f| f.field)
    }
}
