//! The reward options of SMAC: the record, its keys in files with their ranges, and the reader. The engine's
//! `rewards` has the formula.

use serde::{Deserialize, Serialize};
use smaclite_units::file::{AnyKey, Flag, Key, Node, Object, Range, Reported};

/// SMAC's reward options. As JSON with SMAC's names, such as `reward_win`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Rewards {
    /// Rewards are 1, -1 or 0, at the end.
    #[serde(rename = "reward_sparse")]
    pub sparse: bool,
    /// Rewards count what the other side loses, and not what the own side loses.
    #[serde(rename = "reward_only_positive")]
    pub only_positive: bool,
    /// Points for a kill.
    #[serde(rename = "reward_death_value")]
    pub death_value: f64,
    /// Points for winning.
    #[serde(rename = "reward_win")]
    pub win: f64,
    /// Points for losing.
    #[serde(rename = "reward_defeat")]
    pub defeat: f64,
    /// What own losses are multiplied by.
    #[serde(rename = "reward_negative_scale")]
    pub negative_scale: f64,
    /// Rewards are scaled.
    #[serde(rename = "reward_scale")]
    pub scale: bool,
    /// The return that the greatest return is scaled to.
    #[serde(rename = "reward_scale_rate")]
    pub scale_rate: f64,
}

impl Rewards {
    /// The rewards of SMAClite, which are SMAC's defaults.
    pub const DEFAULT: Rewards = Rewards {
        sparse: false,
        only_positive: true,
        death_value: 10.0,
        win: 200.0,
        defeat: 0.0,
        negative_scale: 0.5,
        scale: true,
        scale_rate: 20.0,
    };

    /// Whether these are the defaults.
    pub fn is_default(&self) -> bool {
        *self == Rewards::DEFAULT
    }

    /// The unscaled return of a win over units with this health and shield in total, without their
    /// regeneration and own losses.
    pub fn greatest_return(&self, n_units: usize, health: f64) -> f64 {
        self.death_value * n_units as f64 + self.win + health
    }
}

impl Default for Rewards {
    fn default() -> Rewards {
        Rewards::DEFAULT
    }
}

/// No useful value comes near these limits.
const POINTS: Range = Range::closed(-1e6, 1e6);

const fn flag(name: &'static str, default: bool, meaning: &'static str) -> Key<Flag> {
    Key::with_default(name, Flag, default, meaning)
}

const fn points(name: &'static str, default: f64, meaning: &'static str) -> Key<Range> {
    Key::with_default(name, POINTS, default, meaning)
}

const DEFAULT: Rewards = Rewards::DEFAULT;

pub(crate) const SPARSE: Key<Flag> =
    flag("reward_sparse", DEFAULT.sparse, "Whether rewards are 1, -1 or 0, at the end of the episode.");
pub(crate) const ONLY_POSITIVE: Key<Flag> =
    flag("reward_only_positive", DEFAULT.only_positive, "Whether rewards leave out what agents lose.");
pub(crate) const DEATH_VALUE: Key<Range> =
    points("reward_death_value", DEFAULT.death_value, "Points for the death of an enemy.");
pub(crate) const WIN: Key<Range> = points("reward_win", DEFAULT.win, "Points for winning.");
pub(crate) const DEFEAT: Key<Range> = points("reward_defeat", DEFAULT.defeat, "Points for losing.");
pub(crate) const NEGATIVE_SCALE: Key<Range> =
    points("reward_negative_scale", DEFAULT.negative_scale, "What the losses of agents are multiplied by.");
pub(crate) const SCALE: Key<Flag> = flag("reward_scale", DEFAULT.scale, "Whether rewards are scaled.");
pub(crate) const SCALE_RATE: Key<Range> = Key::with_default(
    "reward_scale_rate",
    Range::left_open(0.0, 1e6),
    DEFAULT.scale_rate,
    "The return that the greatest return is scaled to.",
);

/// Every key of `rewards`; they are keys of `smacv2`, too.
pub(crate) const REWARD_KEYS: [&dyn AnyKey; 8] =
    [&SPARSE, &ONLY_POSITIVE, &DEATH_VALUE, &WIN, &DEFEAT, &NEGATIVE_SCALE, &SCALE, &SCALE_RATE];

/// Reads the value of the key `rewards`.
pub(crate) fn read(node: &Node) -> Result<Rewards, Reported> {
    let rewards = read_keys(&node.object(&REWARD_KEYS)?)?;
    check(node, &rewards)?;
    Ok(rewards)
}

/// What rewards are divided by must be above 0: otherwise scaling would change their sign.
pub(crate) fn check(node: &Node, rewards: &Rewards) -> Result<(), Reported> {
    let least = rewards.death_value.min(rewards.win);
    if rewards.scale && least < 0.0 {
        return Err(node.conflict(
            "scales by the greatest return, so `reward_death_value` and `reward_win` must be at least 0; or \
             `reward_scale` must be false",
        ));
    }
    Ok(())
}

/// Reads the options from an object that has them among its keys; the caller [checks](check) them.
pub(crate) fn read_keys(object: &Object) -> Result<Rewards, Reported> {
    Ok(Rewards {
        sparse: object.read(&SPARSE)?,
        only_positive: object.read(&ONLY_POSITIVE)?,
        death_value: object.read(&DEATH_VALUE)?,
        win: object.read(&WIN)?,
        defeat: object.read(&DEFEAT)?,
        negative_scale: object.read(&NEGATIVE_SCALE)?,
        scale: object.read(&SCALE)?,
        scale_rate: object.read(&SCALE_RATE)?,
    })
}
