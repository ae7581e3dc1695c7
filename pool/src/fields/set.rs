//! Sets of fields: what the frames of a lane have.

use super::{FIELD_COUNT, FIELDS, Field};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A set of fields; serialised as the list of their names.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "Vec<&'static str>", try_from = "Vec<String>")]
pub struct FieldSet(u32);

impl FieldSet {
    /// Every field.
    pub const ALL: FieldSet = FieldSet((1 << FIELD_COUNT) - 1);

    /// What every lane has.
    const REQUIRED: FieldSet = {
        let (mut set, mut i) = (FieldSet(0), 0);
        while i < FIELD_COUNT {
            if !FIELDS[i].field.is_optional() {
                set.0 |= 1 << FIELDS[i].field as usize;
            }
            i += 1;
        }
        set
    };

    /// What a lane has that names no fields: every field but the snapshot, the opponent, the level and the
    /// shares of single units. A lane leaves those out that it cannot have.
    pub const DEFAULT: FieldSet = {
        let mut fields = FieldSet::ALL;
        fields.0 &= !(1 << Field::Snapshot as usize | 1 << Field::Opponent as usize);
        fields.0 &= !(1 << Field::Level as usize | 1 << Field::RewardAgents as usize);
        fields.0 &= !(1 << Field::EnemyRewardAgents as usize);
        fields
    };

    /// The default fields but the `final_*` ones and those of the enemies.
    pub fn without_final() -> FieldSet {
        FieldSet::DEFAULT.iter().filter(|field| !field.is_final() && !field.is_of_enemies()).collect()
    }

    /// The fields of these names, and those that no lane can omit.
    ///
    /// # Errors
    /// If there is no field of a name.
    pub fn from_names<S: AsRef<str>>(names: impl IntoIterator<Item = S>) -> Result<FieldSet, UnknownField> {
        let mut set = FieldSet::REQUIRED;
        for name in names {
            let name = name.as_ref();
            let field = Field::from_name(name).ok_or_else(|| UnknownField(name.to_owned()))?;
            set.insert(field);
        }
        Ok(set)
    }

    /// Whether the set contains the field.
    pub const fn contains(self, field: Field) -> bool {
        self.0 & (1 << field as usize) != 0
    }

    /// Adds a field.
    pub fn insert(&mut self, field: Field) {
        self.0 |= 1 << field as usize;
    }

    /// The fields in table order.
    pub fn iter(self) -> impl Iterator<Item = Field> {
        FIELDS.iter().map(|f| f.field).filter(move |f| self.contains(*f))
    }
}

impl FromIterator<Field> for FieldSet {
    /// With those that no lane can omit.
    fn from_iter<I: IntoIterator<Item = Field>>(fields: I) -> Self {
        let mut set = FieldSet::REQUIRED;
        fields.into_iter().for_each(|f| set.insert(f));
        set
    }
}

impl fmt::Debug for FieldSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.iter().map(|f| f.spec().name)).finish()
    }
}

impl From<FieldSet> for Vec<&'static str> {
    fn from(set: FieldSet) -> Self {
        set.iter().map(|f| f.spec().name).collect()
    }
}

impl TryFrom<Vec<String>> for FieldSet {
    type Error = UnknownField;

    fn try_from(names: Vec<String>) -> Result<Self, UnknownField> {
        FieldSet::from_names(names)
    }
}

/// A field name that no frame has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown field `{0}`; the fields are {names}", names = FIELDS.map(|f| f.name).join(", "))]
pub struct UnknownField(pub String);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lane_always_has_the_fields_that_every_learner_needs() {
        let set = FieldSet::from_names(["obs"]).unwrap();
        let names: Vec<_> = set.iter().map(|f| f.spec().name).collect();
        assert_eq!(names, ["env_id", "obs", "reward", "terminated", "truncated", "was_reset"]);
        let error = FieldSet::from_names(["obz"]).unwrap_err().to_string();
        assert!(error.contains("`obz`") && error.contains("avail_actions"), "{error}");
    }

    #[test]
    fn a_lane_that_names_no_fields_has_all_but_those_that_must_be_named() {
        let names = |set: FieldSet| set.iter().map(|f| f.spec().name).collect::<Vec<_>>();
        let left_out =
            |set: FieldSet| names(FieldSet::ALL).into_iter().filter(move |name| !names(set).contains(name));
        assert_eq!(names(FieldSet::ALL), FIELDS.map(|f| f.name));
        let must_be_named = ["snapshot", "opponent", "level", "reward_agents", "enemy_reward_agents"];
        assert_eq!(left_out(FieldSet::DEFAULT).collect::<Vec<_>>(), must_be_named);
        let is_left_out = |name: &&str| name.starts_with("final_") || name.starts_with("enemy_");
        let without_final: Vec<_> =
            names(FieldSet::DEFAULT).into_iter().filter(|name| !is_left_out(name)).collect();
        assert_eq!(names(FieldSet::without_final()), without_final);
    }

    #[test]
    fn a_field_that_is_inserted_twice_is_there() {
        let mut set = FieldSet::from_iter([]);
        assert!(!set.contains(Field::Obs));
        (0..2).for_each(|_| set.insert(Field::Obs));
        assert_eq!(set, FieldSet::from_names(["obs"]).unwrap());
    }
}
