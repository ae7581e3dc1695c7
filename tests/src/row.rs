//! One slot of a frame: what one environment wrote.

use crate::own_features::OwnFeatures;
use smaclite_engine::{Battle, Faction, RecordLayout, RecordSizes, Scratch, Sizes, Step};
use smaclite_pool::fields::{Dtype, FIELDS, Field};
use smaclite_pool::layout::Layout;
use std::hash::{DefaultHasher, Hash, Hasher};

/// The values of a slot as bytes, by field. A field that the lane leaves out is `None`, and so is what a
/// reference cannot know: the `final_*` fields of an episode that has not ended.
#[derive(Clone, Debug)]
pub struct Row {
    values: Vec<Option<Vec<u8>>>,
    sizes: Sizes,
}

impl Row {
    /// Reads a slot of a frame.
    pub fn read(frame: &[u8], layout: &Layout, slot: usize) -> Row {
        let value = |field: Field| {
            let start = layout.offset(field)?;
            let len = layout.row_len(field) * field.spec().dtype.size();
            Some(frame[start + slot * len..][..len].to_vec())
        };
        Row { values: FIELDS.iter().map(|f| value(f.field)).collect(), sizes: layout.sizes() }
    }

    /// What environment `index` must write as it is now; `step` is the step just made, if any.
    pub(crate) fn of(
        battle: &Battle,
        index: usize,
        step: Option<Step>,
        own: &OwnFeatures,
        scratch: &mut Scratch,
    ) -> Row {
        let mut row = Row { values: vec![None; FIELDS.len()], sizes: battle.arena().sizes() };
        let flag = |is_set: fn(&Step) -> bool| vec![u8::from(step.as_ref().is_some_and(is_set))];
        row.set(Field::EnvId, int(index));
        row.set(Field::WasReset, vec![u8::from(step.is_none())]);
        row.set(Field::Reward, floats(&[step.as_ref().map_or(0.0, |s| s.reward as f32)]));
        if row.sizes.enemies.is_some() {
            row.set(Field::EnemyReward, floats(&[step.as_ref().map_or(0.0, |s| s.enemy_reward as f32)]));
        }
        row.set_shares(battle, step);
        row.set(Field::Terminated, flag(|s| s.terminated));
        row.set(Field::Truncated, flag(|s| s.truncated));
        row.set(Field::BattleWon, flag(|s| s.battle_won));
        row.set(Field::DeadAllies, int(battle.dead_allies()));
        row.set(Field::DeadEnemies, int(battle.dead_enemies()));
        row.set(Field::EpisodeReturn, floats(&[battle.episode_return() as f32]));
        row.set(Field::EpisodeLength, int(battle.episode_length() as usize));
        row.set(Field::Opponent, int(battle.opponent().index()));
        row.set_view(battle, own, scratch);
        row
    }

    /// A hash of what the environment would show its agents, whatever fields the lane has.
    fn hash(&self) -> u64 {
        hash((&self.values[Field::Obs as usize], &self.values[Field::State as usize]))
    }

    /// Turns the row of an episode's last step into that of same-step autoreset: the last observation, state
    /// and mask move to the `final_*` fields, and those of `battle`, which was reset, replace them.
    pub(crate) fn append_reset(&mut self, battle: &Battle, own: &OwnFeatures, scratch: &mut Scratch) {
        let finals = [
            (Field::Obs, Field::FinalObs),
            (Field::State, Field::FinalState),
            (Field::AvailActions, Field::FinalAvailActions),
            (Field::EnemyObs, Field::FinalEnemyObs),
            (Field::EnemyState, Field::FinalEnemyState),
            (Field::EnemyAvailActions, Field::FinalEnemyAvailActions),
        ];
        finals.into_iter().for_each(|(last, of)| self.values.swap(last as usize, of as usize));
        self.set_view(battle, own, scratch);
    }

    fn set(&mut self, field: Field, value: Vec<u8>) {
        self.values[field as usize] = Some(value);
    }

    /// The shares of all units in the rewards of the step just made.
    fn set_shares(&mut self, battle: &Battle, step: Option<Step>) {
        let Sizes { n_agents, n_enemies, enemies, .. } = self.sizes;
        let shares = |side: Faction, n_units: usize| {
            let mut shares = vec![0.0; n_units];
            if step.is_some() {
                battle.write_shares_of(side, &mut shares);
            }
            floats(&shares)
        };
        self.set(Field::RewardAgents, shares(Faction::Ally, n_agents));
        if enemies.is_some() {
            self.set(Field::EnemyRewardAgents, shares(Faction::Enemy, n_enemies));
        }
    }

    fn set_view(&mut self, battle: &Battle, own: &OwnFeatures, scratch: &mut Scratch) {
        let Sizes { n_agents, n_actions, obs_size, state_size, .. } = battle.arena().sizes();
        let mut alive = vec![0; n_agents];
        battle.write_alive(Faction::Ally, &mut alive);
        let mut obs = vec![0.0; n_agents * obs_size];
        battle.write_obs(Faction::Ally, &mut obs, scratch);
        self.set(Field::Obs, floats(&own.append_to(&obs, &alive, n_actions, 0)));
        self.set(Field::Alive, alive);
        let mut out = vec![0.0; state_size];
        battle.write_state(Faction::Ally, &mut out);
        self.set(Field::State, floats(&out));
        let mut out = vec![0; n_agents * n_actions];
        battle.write_avail_actions(Faction::Ally, &mut out);
        self.set(Field::AvailActions, out);
        let layout = RecordLayout::new(RecordSizes::new(&battle.arena().sizes(), own.n_past()));
        let mut record = vec![0; layout.size()];
        battle.write_record(&layout, &own.past_actions(), &mut record);
        self.set(Field::Snapshot, record);
        self.set_enemy_view(battle, own, scratch);
    }

    fn set_enemy_view(&mut self, battle: &Battle, own: &OwnFeatures, scratch: &mut Scratch) {
        let (first, side) = (battle.arena().sizes().n_agents, Faction::Enemy);
        let Some(sizes) = battle.arena().sizes().of(side) else { return };
        let Sizes { n_agents, n_actions, obs_size, state_size, .. } = sizes;
        let mut alive = vec![0; n_agents];
        battle.write_alive(side, &mut alive);
        let mut obs = vec![0.0; n_agents * obs_size];
        battle.write_obs(side, &mut obs, scratch);
        self.set(Field::EnemyObs, floats(&own.append_to(&obs, &alive, n_actions, first)));
        self.set(Field::EnemyAlive, alive);
        let mut out = vec![0.0; state_size];
        battle.write_state(side, &mut out);
        self.set(Field::EnemyState, floats(&out));
        let mut out = vec![0; n_agents * n_actions];
        battle.write_avail_actions(side, &mut out);
        self.set(Field::EnemyAvailActions, out);
    }

    /// The bytes of a field.
    ///
    /// # Panics
    /// If the lane leaves the field out.
    pub fn value(&self, field: Field) -> &[u8] {
        let value = &self.values[field as usize];
        value.as_deref().unwrap_or_else(|| panic!("the row has no {}", field.spec().name))
    }

    /// The number of the environment.
    pub fn env(&self) -> i32 {
        i32::from_ne_bytes(self.value(Field::EnvId).try_into().expect("an i32"))
    }

    /// Whether the step ended the episode.
    pub fn ended(&self) -> bool {
        [Field::Terminated, Field::Truncated].iter().any(|field| self.value(*field) == [1])
    }

    /// The masks of available actions, agent by agent and then, if actions play both sides, enemy by enemy.
    pub fn masks(&self) -> impl Iterator<Item = &[u8]> {
        let enemies =
            self.sizes.enemies.map(|sizes| self.value(Field::EnemyAvailActions).chunks(sizes.n_actions));
        let agents = self.value(Field::AvailActions).chunks(self.sizes.n_actions);
        agents.chain(enemies.into_iter().flatten())
    }

    /// A legal joint action, the same for the same row.
    pub fn legal_actions(&self) -> Vec<i32> {
        let seed = self.hash();
        let pick = |(agent, mask): (usize, &[u8])| {
            let legal: Vec<_> = (0..mask.len()).filter(|action| mask[*action] == 1).collect();
            legal[hash((seed, agent)) as usize % legal.len()] as i32
        };
        self.masks().enumerate().map(pick).collect()
    }

    /// The first value that differs from what was expected. Fields are compared that both rows have.
    pub fn difference(&self, expected: &Row) -> Option<String> {
        FIELDS.iter().find_map(|spec| {
            let [found, expected] = [self, expected].map(|row| row.values[spec.field as usize].as_deref());
            let (found, expected) = (found?, expected?);
            if found == expected {
                return None;
            }
            let elements = |bytes: &[u8]| -> Vec<String> {
                bytes.chunks(spec.dtype.size()).map(|bytes| shown(bytes, spec.dtype)).collect()
            };
            let (found, expected) = (elements(found), elements(expected));
            let differs = |i: &usize| found.get(*i) != expected.get(*i);
            let i = (0..found.len().max(expected.len())).find(differs).unwrap_or(0);
            let [found, expected] =
                [&found, &expected].map(|values| values.get(i).map_or("missing", String::as_str));
            Some(format!("{}[{i}] is {found}, expected {expected}", spec.name))
        })
    }
}

/// The same number for the same value in every run of one build.
fn hash(value: impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    value.hash(&mut hasher);
    hasher.finish()
}

fn int(value: usize) -> Vec<u8> {
    (value as i32).to_ne_bytes().to_vec()
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_ne_bytes()).collect()
}

fn shown(bytes: &[u8], dtype: Dtype) -> String {
    match (dtype, <[u8; 4]>::try_from(bytes)) {
        (Dtype::F32, Ok(bytes)) => format!("{:?}", f32::from_ne_bytes(bytes)),
        (Dtype::I32, Ok(bytes)) => i32::from_ne_bytes(bytes).to_string(),
        _ => bytes[0].to_string(),
    }
}
