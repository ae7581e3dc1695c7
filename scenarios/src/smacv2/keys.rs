//! The keys of `smacv2`: each option once, with its range; the reader and the schema derive from them.

use super::{Capability, EnemyMask, Smacv2};
use crate::rewards;
use smaclite_units::file::{
    AnyKey, Flag, Key, Node, Object, Range, Reported, Schema, Shape, Whole, object_schema,
};

const SHARE: Range = Range::closed(0.0, 1.0);
const SQUARES: Range = Range::left_open(0.0, 1e3);

const fn flag(name: &'static str, default: bool, meaning: &'static str) -> Key<Flag> {
    Key::with_default(name, Flag, default, meaning)
}

const fn number(name: &'static str, range: Range, default: f64, meaning: &'static str) -> Key<Range> {
    Key::with_default(name, range, default, meaning)
}

const USE_UNIT_RANGES: Key<Flag> = flag(
    "use_unit_ranges",
    false,
    "Whether sight and targeting ranges are those of the unit type, instead of 9 and 6 squares.",
);
const MIN_ATTACK_RANGE: Key<Range> = number(
    "min_attack_range",
    Range::closed(0.0, 1e3),
    2.0,
    "The least targeting range where unit types have their own, in squares.",
);
const CONIC_FOV: Key<Flag> =
    flag("conic_fov", false, "Whether agents see only what is in a cone, which look actions turn.");
const NUM_FOV_ACTIONS: Key<Whole> = Key::with_default(
    "num_fov_actions",
    Whole { from: 1, to: 360 },
    12,
    "The number of look actions; a cone is 2 pi divided by it wide.",
);
const PROB_OBS_ENEMY: Key<Range> = number(
    "prob_obs_enemy",
    SHARE,
    1.0,
    "The probability that another agent than the first seer of an enemy sees it, too.",
);
const ACTION_MASK: Key<Flag> = flag(
    "action_mask",
    true,
    "Whether targets out of range are unavailable; if not, an action on them sends no order.",
);
const FULLY_OBSERVABLE: Key<Flag> =
    flag("fully_observable", false, "Whether observations show all living units.");
const OBS_ALL_HEALTH: Key<Flag> =
    flag("obs_all_health", true, "Whether observations have the health and shields of others.");
const OBS_OWN_HEALTH: Key<Flag> =
    flag("obs_own_health", true, "Whether observations have the agent's own health and shield.");
const OBS_LAST_ACTION: Key<Flag> =
    flag("obs_last_action", false, "Whether observations have the last actions of visible allies.");
const OBS_PATHING_GRID: Key<Flag> =
    flag("obs_pathing_grid", false, "Whether observations say which of eight points around are walkable.");
const OBS_TERRAIN_HEIGHT: Key<Flag> =
    flag("obs_terrain_height", false, "Whether observations have the height of nine points around.");
const OBS_OWN_POS: Key<Flag> = flag("obs_own_pos", false, "Whether observations have the agent's position.");
const OBS_TIMESTEP_NUMBER: Key<Flag> = flag(
    "obs_timestep_number",
    false,
    "Whether observations have the share of the episode limit that is over.",
);
const OBS_STARCRAFT: Key<Flag> = flag(
    "obs_starcraft",
    true,
    "Whether observations have what agents see; if not, only the time, for open-loop experiments.",
);
const OBS_INSTEAD_OF_STATE: Key<Flag> =
    flag("obs_instead_of_state", false, "Whether the state is all observations, one after the other.");
const STATE_LAST_ACTION: Key<Flag> =
    flag("state_last_action", true, "Whether the state has the last actions.");
const STATE_TIMESTEP_NUMBER: Key<Flag> = flag(
    "state_timestep_number",
    false,
    "Whether the state has the share of the episode limit that is over.",
);
const OBSERVE_TEAM: Key<Flag> =
    flag("observe_team", true, "Whether observations show the types of allies (`observe` of `team_gen`).");
const MOVE_AMOUNT: Key<Range> = number("move_amount", SQUARES, 2.0, "Length of a move, in squares.");
const KILL_UNIT_STEP_MUL: Key<Whole> = Key::with_default(
    "kill_unit_step_mul",
    Whole { from: 0, to: 8 },
    2,
    "With `health`: how many ticks before the end of a step agents below their level are killed.",
);
const ENEMY_MASK: Key<Shape> = Key::optional(
    "enemy_mask",
    Shape { schema: || object_schema(&MASK_KEYS), expected: "an object with `mask_probability`" },
    "Hides health, shield and type of enemies from agents, drawn for each episode.",
);
const ATTACK: Key<Shape> = Key::optional(
    "attack",
    Shape { schema: capability_schema, expected: "an object with `lower_bound` and `upper_bound`" },
    "Lets attack and heal orders of each agent succeed with a probability that is drawn for each episode.",
);
const HEALTH: Key<Shape> = Key::optional(
    "health",
    Shape { schema: capability_schema, expected: "an object with `lower_bound` and `upper_bound`" },
    "Lets each agent die below a share of its health that is drawn for each episode. `lower_bound` must be \
     below 1.",
);
const PUBLISHED: Key<Flag> =
    flag("published", false, "Whether the faults of SMACv2's published code are reproduced.");

const MASK_KEYS: [&dyn AnyKey; 1] = [&MASK_PROBABILITY];
const MASK_PROBABILITY: Key<Range> = Key::required(
    "mask_probability",
    SHARE,
    "The probability that an agent is shown everything of an enemy; SMACv2's name for it.",
);
const CAPABILITY_KEYS: [&dyn AnyKey; 3] = [&LOWER_BOUND, &UPPER_BOUND, &OBSERVE];
const LOWER_BOUND: Key<Range> = Key::required("lower_bound", SHARE, "The least value.");
const UPPER_BOUND: Key<Range> = Key::required("upper_bound", SHARE, "The greatest value.");
const OBSERVE: Key<Flag> = flag("observe", false, "Whether agents are shown the values of their allies.");

/// Every key of `smacv2`.
pub(crate) const SMACV2_KEYS: [&dyn AnyKey; 33] = [
    &USE_UNIT_RANGES,
    &MIN_ATTACK_RANGE,
    &CONIC_FOV,
    &NUM_FOV_ACTIONS,
    &PROB_OBS_ENEMY,
    &ACTION_MASK,
    &FULLY_OBSERVABLE,
    &OBS_ALL_HEALTH,
    &OBS_OWN_HEALTH,
    &OBS_LAST_ACTION,
    &OBS_PATHING_GRID,
    &OBS_TERRAIN_HEIGHT,
    &OBS_OWN_POS,
    &OBS_TIMESTEP_NUMBER,
    &OBS_STARCRAFT,
    &OBS_INSTEAD_OF_STATE,
    &STATE_LAST_ACTION,
    &STATE_TIMESTEP_NUMBER,
    &OBSERVE_TEAM,
    &MOVE_AMOUNT,
    &KILL_UNIT_STEP_MUL,
    &rewards::SPARSE,
    &rewards::ONLY_POSITIVE,
    &rewards::DEATH_VALUE,
    &rewards::WIN,
    &rewards::DEFEAT,
    &rewards::NEGATIVE_SCALE,
    &rewards::SCALE,
    &rewards::SCALE_RATE,
    &ENEMY_MASK,
    &ATTACK,
    &HEALTH,
    &PUBLISHED,
];

fn capability_schema() -> Schema {
    object_schema(&CAPABILITY_KEYS)
}

/// Reads the options.
pub(crate) fn read(node: &Node) -> Result<Smacv2, Reported> {
    let file = node.object(&SMACV2_KEYS)?;
    let flag = |key: &Key<Flag>| file.read(key);
    let number = |key: &Key<Range>| file.read(key);
    let options = Smacv2 {
        use_unit_ranges: flag(&USE_UNIT_RANGES)?,
        min_attack_range: number(&MIN_ATTACK_RANGE)?,
        conic_fov: flag(&CONIC_FOV)?,
        num_fov_actions: file.read(&NUM_FOV_ACTIONS)?,
        prob_obs_enemy: number(&PROB_OBS_ENEMY)?,
        action_mask: flag(&ACTION_MASK)?,
        fully_observable: flag(&FULLY_OBSERVABLE)?,
        obs_all_health: flag(&OBS_ALL_HEALTH)?,
        obs_own_health: flag(&OBS_OWN_HEALTH)?,
        obs_last_action: flag(&OBS_LAST_ACTION)?,
        obs_pathing_grid: flag(&OBS_PATHING_GRID)?,
        obs_terrain_height: flag(&OBS_TERRAIN_HEIGHT)?,
        obs_own_pos: flag(&OBS_OWN_POS)?,
        obs_timestep_number: flag(&OBS_TIMESTEP_NUMBER)?,
        obs_starcraft: flag(&OBS_STARCRAFT)?,
        obs_instead_of_state: flag(&OBS_INSTEAD_OF_STATE)?,
        state_last_action: flag(&STATE_LAST_ACTION)?,
        state_timestep_number: flag(&STATE_TIMESTEP_NUMBER)?,
        observe_team: flag(&OBSERVE_TEAM)?,
        move_amount: number(&MOVE_AMOUNT)?,
        kill_unit_step_mul: file.read(&KILL_UNIT_STEP_MUL)?,
        rewards: rewards::read_keys(&file)?,
        enemy_mask: file.get(&ENEMY_MASK).map(|node| mask(&node)).transpose()?,
        attack: capability(&file, &ATTACK)?,
        health: health(&file)?,
        published: flag(&PUBLISHED)?,
    };
    check(node, &options)?;
    Ok(options)
}

fn check(node: &Node, options: &Smacv2) -> Result<(), Reported> {
    if !options.obs_starcraft && !options.obs_timestep_number {
        return Err(node.conflict(
            "leaves nothing to observe: without `obs_starcraft`, `obs_timestep_number` must be true",
        ));
    }
    if options.health.is_some() && !options.rewards.only_positive {
        return Err(node.conflict("has `health`, so `reward_only_positive` must be true"));
    }
    // The published code scales by any number.
    if options.published { Ok(()) } else { rewards::check(node, &options.rewards) }
}

fn mask(node: &Node) -> Result<EnemyMask, Reported> {
    Ok(EnemyMask { mask_probability: node.object(&MASK_KEYS)?.read(&MASK_PROBABILITY)? })
}

fn capability(file: &Object, key: &Key<Shape>) -> Result<Option<Capability>, Reported> {
    let Some(node) = file.get(key) else { return Ok(None) };
    let object = node.object(&CAPABILITY_KEYS)?;
    let (lower_bound, upper_bound) = (object.read(&LOWER_BOUND)?, object.read(&UPPER_BOUND)?);
    if lower_bound > upper_bound {
        return Err(node.conflict("must have a `lower_bound` that is at most `upper_bound`"));
    }
    Ok(Some(Capability { lower_bound, upper_bound, observe: object.read(&OBSERVE)? }))
}

/// The bounds of health levels. Observations have the health above the level as a share of the greatest one,
/// and above a level of 1 there is none.
fn health(file: &Object) -> Result<Option<Capability>, Reported> {
    let levels = capability(file, &HEALTH)?;
    match file.get(&HEALTH).filter(|_| levels.is_some_and(|levels| levels.lower_bound >= 1.0)) {
        Some(node) => {
            Err(node.conflict("must have a `lower_bound` below 1: no agent has more health than all"))
        }
        None => Ok(levels),
    }
}
