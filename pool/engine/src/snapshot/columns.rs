//! The columns of a snapshot's record, declared once: the code that writes and reads them, Python's view of
//! them and the page `docs/reference/snapshots.md` derive from [`COLUMNS`].

use crate::dtype::Dtype;

/// An axis of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnAxis {
    /// One per agent, and then one per enemy, by their numbers in their faction (`n_units`).
    Unit,
    /// One per joint action that is kept (`n_past`).
    Past,
    /// As many as SMACv2's interface needs (`n_perception`); 0 without it.
    Perception,
    /// One per unit as `Unit`, under rules `starcraft` (`n_phases`); none under the others.
    Phase,
    /// x and y.
    Xy,
}

/// Name, type, shape and meaning of a column.
#[derive(Clone, Copy, Debug)]
pub struct ColumnSpec {
    /// Which column this is.
    pub column: Column,
    /// The name used in Python and messages.
    pub name: &'static str,
    /// Element type; little-endian.
    pub dtype: Dtype,
    /// The axes; none for a single number.
    pub axes: &'static [ColumnAxis],
    /// One line for documentation.
    pub meaning: &'static str,
}

/// Declares the columns: names in Rust and elsewhere, types, axes and meanings.
macro_rules! columns {
    ($($column:ident $name:literal: $dtype:ident [$($axis:ident),*] $meaning:literal,)*) => {
        /// A column; the discriminant is its index in [`COLUMNS`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(usize)]
        #[allow(missing_docs)] // `COLUMNS` says what each one means
        pub enum Column {
            $($column,)*
        }

        /// How many columns there are.
        pub const COLUMN_COUNT: usize = [$($name),*].len();

        /// The table of columns, in their order in a record.
        pub const COLUMNS: [ColumnSpec; COLUMN_COUNT] = [$(ColumnSpec {
            column: Column::$column,
            name: $name,
            dtype: Dtype::$dtype,
            axes: &[$(ColumnAxis::$axis),*],
            meaning: $meaning,
        },)*];
    };
}

columns! {
    Magic "magic": U32 [] "0x4e534d53, the letters SMSN",
    Checksum "checksum": U32 [] "CRC-32C of all bytes after it",
    Version "version": U32 [] "version of this table",
    NAgents "n_agents": U32 [] "number of agents",
    NEnemies "n_enemies": U32 [] "number of enemies",
    NPast "n_past": U32 []
        "joint actions kept for observations: the lane's obs_last_actions, or those of a team as its enemies",
    NPerception "n_perception": U32 [] "entries of perception; 0 without SMACv2's interface",
    NPhases "n_phases": U32 [] "units whose attacks have phases: all under rules `starcraft`, else 0",
    Rules "rules": U32 [] "rule set: 0 `smaclite`, 1 `paper`, 2 `starcraft`",
    NKnown "n_known": U32 [] "how many of past_actions are of this episode, the first ones",
    Scenario "scenario": U64 [] "hash of the scenario, its unit types and the rule set",
    Seed "seed": U64 [] "seed of the generator",
    Draws "draws": U64 [] "32-bit words that were drawn from it since seeding",
    EpisodeReturn "episode_return": F64 [] "sum of the episode's rewards",
    EpisodeLength "episode_length": U32 [] "steps of the episode",
    Opponent "opponent": U32 [] "what plays the enemies: index in `OPPONENTS`",
    Hp "hp": F64 [Unit] "health, 0 to the type's maximum",
    Shield "shield": F64 [Unit] "shield, 0 to the type's maximum",
    Energy "energy": F64 [Unit] "energy, 0 to the type's maximum",
    Cooldown "cooldown": F64 [Unit] "seconds until the unit can act again",
    ShieldCooldown "shield_cooldown": F64 [Unit] "seconds until the shield regenerates",
    Healing "healing": F64 [Unit] "healing that was paid for and not used yet, in health",
    Perception "perception": U64 [Perception]
        "what agents perceived and were ordered through SMACv2's interface; words without a promised meaning",
    Pos "pos": F32 [Unit, Xy] "position in squares; x grows east, y north",
    Vel "vel": F32 [Unit, Xy] "velocity of the last move, in squares per second",
    PlannedVel "planned_vel": F32 [Unit, Xy] "velocity planned in the last tick",
    Target "target": I32 [Unit] "place of the unit's target in these columns, -1 for none",
    NeighbourRank "neighbour_rank": I32 [Unit]
        "place in the order of equally near neighbours of its plane, -1 for the dead",
    NeighbourNumber "neighbour_number": I32 [Unit]
        "number in the order of removal of its plane, -1 for the dead",
    LastAction "last_action": I32 [Unit]
        "last action of each agent and enemy, with the map's directions also where sides are mirrored; -1 \
         after a reset and for enemies that no joint action plays",
    PastActions "past_actions": I32 [Past, Unit]
        "the last joint actions as in `last_action`, the newest first; -1 for enemies that they do not play",
    UnitType "unit_type": U32 [Unit]
        "type of the unit, as an index into the scenario's types; drawn anew in generated scenarios",
    Alive "alive": Bool [Unit] "whether the unit is in the battle",
    Declared "declared": Bool [Unit] "whether it holds a declared attack (rule R4)",
    Windup "windup": F64 [Phase] "seconds until the damage point of the attack that has begun; 0 if none has",
    Backswing "backswing": F64 [Phase] "seconds until the unit walks again without a new order",
    Look "look": F64 [Phase] "seconds until the unit looks for targets again",
    HitTime "hit_time": F64 [Phase] "seconds until the next of its hits in flight arrives",
    HitAt "hit_at": F32 [Phase, Xy] "where the target of these hits was",
    Goal "goal": F32 [Phase, Xy]
        "where the unit marches to while it attack-moves; set in the first step of an episode",
    Facing "facing": F32 [Phase, Xy]
        "where the unit faces, as a direction; 0 before it first walks or attacks",
    AttackTarget "attack_target": I32 [Phase] "place of the target of the attack that has begun, -1 for none",
    LastAttacked "last_attacked": I32 [Phase] "place of the target of the last attack, -1 for none",
    HitTarget "hit_target": I32 [Phase] "place of the target of the hits in flight, -1 for none",
    Hits "hits": U32 [Phase] "hits in flight",
    IsAlarmed "is_alarmed": Bool [Phase]
        "whether it looks for targets at once, since a unit of its side near it was hit",
}

impl Column {
    /// The column's row of the table.
    pub const fn spec(self) -> &'static ColumnSpec {
        &COLUMNS[self as usize]
    }

    pub(super) fn name(self) -> &'static str {
        self.spec().name
    }
}
