//! Which columns of an observation or of the state belong to which unit, and which unit an action targets:
//! for networks that read units one by one. Everything derives from the named features.

use super::features::{action_names, obs_features, state_features};
use crate::features::FeatureBlock;
use serde::Serialize;
use smaclite_scenarios::{Faction, Scenario};
use std::ops::Range;

/// The columns of an input, by unit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct UnitLayout {
    /// One row per enemy.
    pub enemies: UnitRows,
    /// One row per ally: in an observation without the agent itself, in the state all.
    pub allies: UnitRows,
    /// The columns that belong to no other unit, in their order.
    pub rest: Vec<Range<usize>>,
}

/// The rows of units of a kind. A row is made of parts, which may lie apart: in the state, the last actions
/// of agents stand behind all units.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct UnitRows {
    /// How many units there are.
    pub count: usize,
    /// Where the parts begin, and their widths: part (s, w) of row i has the columns from s + i w to
    /// s + (i + 1) w. The first part has zeros only if the unit is dead or not seen.
    pub parts: Vec<(usize, usize)>,
}

/// What the actions of agents are about.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TargetLayout {
    /// The first action with a target; action `first + i` targets enemy i, or ally i if the agent heals.
    pub first: usize,
    /// How many such actions there are.
    pub count: usize,
    /// The columns of an observation that are not 0 if the agent heals: those of its own type. Empty if no
    /// type heals, or observations have no types.
    pub heals: Vec<usize>,
    /// Where observations have no types, the agents that heal in every episode.
    pub healers: Vec<usize>,
}

impl UnitLayout {
    /// That of observations of `obs_size` numbers, which may end with more than the scenario's features, as
    /// with last actions. `None` if observations have no units (`obs_starcraft` of `smacv2` is false).
    pub fn of_obs(scenario: &Scenario, obs_size: usize) -> Option<UnitLayout> {
        let blocks = obs_features(scenario);
        has_units(&blocks).then(|| UnitLayout::new(&blocks, obs_size))
    }

    /// That of the state. A state that consists of observations (`obs_instead_of_state` of `smacv2`) has a
    /// row per ally, and no enemies.
    pub fn of_state(scenario: &Scenario, state_size: usize) -> UnitLayout {
        UnitLayout::new(&state_features(scenario), state_size)
    }

    fn new(blocks: &[FeatureBlock], size: usize) -> UnitLayout {
        let (mut enemies, mut allies, mut rest) = (UnitRows::default(), UnitRows::default(), Vec::new());
        for block in blocks {
            let part = (block.start, block.features.len());
            let rows = match block.name {
                "enemies" => &mut enemies,
                "allies" | "agents" => &mut allies,
                "last_action" if block.rows == Some(allies.count) => &mut allies,
                _ => {
                    rest.push(block.start..block.end());
                    continue;
                }
            };
            rows.count = block.rows.unwrap_or(1);
            rows.parts.push(part);
        }
        let end = blocks.last().map_or(0, FeatureBlock::end);
        rest.push(end..size.max(end));
        rest.retain(|columns| !columns.is_empty());
        UnitLayout { enemies, allies, rest }
    }

    /// How many columns belong to no other unit.
    pub fn rest_width(&self) -> usize {
        self.rest.iter().map(ExactSizeIterator::len).sum()
    }
}

impl UnitRows {
    /// The length of a row.
    pub fn width(&self) -> usize {
        self.parts.iter().map(|(_, width)| width).sum()
    }

    /// The parts of a row of an input.
    #[inline]
    pub fn row<'a>(&'a self, input: &'a [f32], unit: usize) -> impl Iterator<Item = &'a [f32]> {
        self.parts.iter().map(move |(start, width)| &input[start + unit * width..][..*width])
    }

    /// Whether the unit lives and is seen.
    #[inline]
    pub fn is_seen(&self, input: &[f32], unit: usize) -> bool {
        self.parts.first().is_some_and(|(start, width)| {
            input[start + unit * width..][..*width].iter().any(|value| *value != 0.0)
        })
    }
}

impl TargetLayout {
    /// That of the agents of a scenario. `None` if observations have no units.
    pub fn new(scenario: &Scenario) -> Option<TargetLayout> {
        let blocks = obs_features(scenario);
        let own = blocks.iter().find(|block| block.name == "own").filter(|_| has_units(&blocks))?;
        let actions = action_names(scenario);
        let first = actions.iter().position(|name| name.starts_with("target_")).unwrap_or(actions.len());
        let heals = |unit_type: &usize| scenario.unit_types[*unit_type].is_healer();
        let has_types = own.features.iter().any(|name| name.starts_with("type_"));
        let column = |unit_type: usize| {
            let name = format!("type_{}", scenario.type_ids[unit_type]);
            Some(own.start + own.features.iter().position(|feature| *feature == name)?)
        };
        let agents = scenario.units.iter().filter(|unit| unit.faction == Faction::Ally && !has_types);
        let healers = agents.filter(|unit| heals(&unit.unit_type)).map(|unit| unit.id_in_faction);
        Some(TargetLayout {
            first,
            count: actions.len() - first,
            heals: (0..scenario.unit_types.len()).filter(heals).filter_map(column).collect(),
            healers: if scenario.draws_teams() { Vec::new() } else { healers.collect() },
        })
    }

    /// Whether an agent heals, from its number and its observation.
    #[inline]
    pub fn heals(&self, agent: usize, obs: &[f32]) -> bool {
        self.heals.iter().any(|column| obs[*column] != 0.0) || self.healers.contains(&agent)
    }

    /// Whether any agent may heal.
    pub fn has_healers(&self) -> bool {
        !(self.heals.is_empty() && self.healers.is_empty())
    }

    /// The row among [`allies`](UnitLayout::allies) of an agent's observation that an ally has; the agent
    /// itself has none.
    #[inline]
    pub fn ally_row(agent: usize, ally: usize) -> Option<usize> {
        match ally.cmp(&agent) {
            std::cmp::Ordering::Less => Some(ally),
            std::cmp::Ordering::Equal => None,
            std::cmp::Ordering::Greater => Some(ally - 1),
        }
    }
}

fn has_units(blocks: &[FeatureBlock]) -> bool {
    blocks.iter().any(|block| block.name == "enemies")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Arena, Battle, Rules, Scratch, action};

    /// Every column belongs to one unit or to the rest.
    #[test]
    fn columns_are_divided() {
        for name in Scenario::standard_names().chain(Scenario::generated_names()) {
            let scenario = Scenario::standard(name).unwrap();
            let sizes = Arena::new(&scenario, Rules::Smaclite).sizes();
            let of_obs = UnitLayout::of_obs(&scenario, sizes.obs_size + 5).unwrap();
            let of_state = UnitLayout::of_state(&scenario, sizes.state_size);
            assert_eq!((of_obs.enemies.count, of_obs.allies.count), (sizes.n_enemies, sizes.n_agents - 1));
            assert_eq!((of_state.enemies.count, of_state.allies.count), (sizes.n_enemies, sizes.n_agents));
            for (layout, size) in [(of_obs, sizes.obs_size + 5), (of_state, sizes.state_size)] {
                let mut counts = vec![0; size];
                for rows in [&layout.enemies, &layout.allies] {
                    for (start, width) in &rows.parts {
                        counts[*start..start + rows.count * width].iter_mut().for_each(|count| *count += 1);
                    }
                }
                let rest: Vec<usize> = layout.rest.iter().cloned().flatten().collect();
                assert_eq!(rest.len(), layout.rest_width(), "{name}");
                rest.into_iter().for_each(|column| counts[column] += 1);
                assert!(counts.iter().all(|count| *count == 1), "{name}: {counts:?}");
            }
        }
    }

    /// The last actions of agents stand behind all units.
    #[test]
    fn rows_have_the_columns_of_their_unit() {
        let scenario = Scenario::standard("2s3z").unwrap();
        let size = Arena::new(&scenario, Rules::Smaclite).sizes().state_size;
        let UnitLayout { allies, enemies, .. } = UnitLayout::of_state(&scenario, size);
        let columns: Vec<f32> = (0..size).map(|column| column as f32).collect();
        let row = |rows: &UnitRows, unit| rows.row(&columns, unit).flatten().copied().collect::<Vec<_>>();
        let range = |from: u8, to: u8| (from..to).map(f32::from);
        assert_eq!((allies.width(), enemies.width()), (7 + 11, 6));
        assert_eq!(row(&allies, 2), range(14, 21).chain(range(65 + 22, 65 + 33)).collect::<Vec<_>>());
        assert_eq!(row(&enemies, 4), range(35 + 24, 35 + 30).collect::<Vec<_>>());

        let mut state = vec![0.0; size];
        (state[13], state[35 + 6], state[65]) = (1.0, 1.0, 1.0);
        let seen = |rows: &UnitRows| [0, 1, 2].map(|unit| rows.is_seen(&state, unit));
        assert_eq!(seen(&allies), [false, true, false], "an action makes no unit seen");
        assert_eq!(seen(&enemies), [false, true, false]);
        assert!(!UnitRows::default().is_seen(&state, 0));
    }

    #[test]
    fn healers_are_known_by_their_type_or_their_number() {
        let layout = |name: &str| TargetLayout::new(&Scenario::standard(name).unwrap()).unwrap();
        for (name, has_healers) in [("3m", false), ("2s3z", false), ("MMM", true), ("terran_5_vs_5", true)] {
            assert_eq!(layout(name).has_healers(), has_healers, "{name}");
        }
        let mut scenario = Scenario::standard("MMM").unwrap();
        let healers = |scenario: &Scenario| {
            let mut battle = Battle::new(std::sync::Arc::new(Arena::new(scenario, Rules::Smaclite)), 1);
            battle.reset();
            let sizes = battle.arena().sizes();
            let mut obs = vec![0.0; sizes.n_agents * sizes.obs_size];
            battle.write_obs(Faction::Ally, &mut obs, &mut Scratch::new());
            let layout = TargetLayout::new(scenario).unwrap();
            assert_eq!((layout.first, layout.count), (action::FIRST_TARGET, sizes.n_actions - 6));
            let rows = obs.chunks_exact(sizes.obs_size).enumerate();
            rows.filter(|(agent, row)| layout.heals(*agent, row)).map(|(agent, _)| agent).collect::<Vec<_>>()
        };
        let agents = scenario.units.iter().filter(|unit| unit.faction == Faction::Ally);
        let expected: Vec<usize> = agents
            .filter(|unit| scenario.unit_types[unit.unit_type].is_healer())
            .map(|unit| unit.id_in_faction)
            .collect();
        assert_eq!(expected.len(), 1);
        assert_eq!(healers(&scenario), expected);
        (scenario.num_unit_types, scenario.type_ids) = (0, vec![0; scenario.unit_types.len()]);
        assert_eq!(healers(&scenario), expected);
    }

    #[test]
    fn an_agent_has_no_row_of_itself() {
        assert_eq!(
            [0, 1, 2, 3].map(|ally| TargetLayout::ally_row(1, ally)),
            [Some(0), None, Some(1), Some(2)]
        );
    }
}
