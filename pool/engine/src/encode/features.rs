//! The layout of observations and of the state: the name and the position of every feature.
//!
//! This describes what `obs` and `state` write, for readers that pick single features by name. Sizes do not
//! derive from it; the tests compare the two.

use smaclite_scenarios::{Faction, Scenario};

use crate::arena::n_actions;
use crate::features::{self, FeatureBlock, in_sequence, names};
use crate::smacv2::Interface;

/// The blocks of the observation of one agent: `moves` (whether a move in each direction is available),
/// `enemies`, `allies` (all but the agent itself) and `own`.
///
/// A unit out of sight has zeros only. Distances are divided by the sight range, `health` and `shield` by
/// their maximum, and `type_i` is 1 for the unit's type.
pub fn obs_features(scenario: &Scenario) -> Vec<FeatureBlock> {
    if let Some(options) = &scenario.smacv2 {
        return Interface::new(scenario, options).obs_features();
    }
    let others = scenario.n_agents().saturating_sub(1);
    let seen = |mark| [mark, "distance", "dx", "dy"];
    in_sequence([
        ("moves", None, names(&["north", "south", "east", "west"])),
        ("enemies", Some(scenario.n_enemies()), unit(scenario, &seen("targetable"), Faction::Enemy)),
        ("allies", Some(others), unit(scenario, &seen("visible"), Faction::Ally)),
        ("own", None, unit(scenario, &[], Faction::Ally)),
    ])
}

/// The blocks of the state: `allies`, `enemies`, and `last_action`, one-hot per agent.
///
/// `energy/cooldown` is the energy of healers and the cooldown of other agents, divided by its maximum;
/// `rel_x` and `rel_y` are the offset from the centre of the map, divided by its width and height. The dead
/// have zeros only.
pub fn state_features(scenario: &Scenario) -> Vec<FeatureBlock> {
    if let Some(options) = &scenario.smacv2 {
        return Interface::new(scenario, options).state_features();
    }
    // Health is the first feature of a unit in the state, and the others follow what stands between.
    let in_state = |between: &[&str], faction| {
        let mut features = unit(scenario, &[], faction);
        features.splice(1..1, names(between));
        features
    };
    let (n_agents, n_enemies) = (scenario.n_agents(), scenario.n_enemies());
    let allies = in_state(&["energy/cooldown", "rel_x", "rel_y"], Faction::Ally);
    let enemies = in_state(&["rel_x", "rel_y"], Faction::Enemy);
    in_sequence([
        ("allies", Some(n_agents), allies),
        ("enemies", Some(n_enemies), enemies),
        ("last_action", Some(n_agents), action_names(scenario)),
    ])
}

/// The names of the actions of an agent, by their numbers: `no_op`, `stop`, `north`, ..., with SMACv2's
/// interface `look_i`, and `target_i`: the enemy of that number, and for healers the ally.
pub fn action_names(scenario: &Scenario) -> Vec<String> {
    match &scenario.smacv2 {
        Some(options) => Interface::new(scenario, options).action_names(),
        None => features::action_names(0, n_actions(scenario, Faction::Ally)),
    }
}

/// `first`, then health, \[shield\], \[type\].
fn unit(scenario: &Scenario, first: &[&str], faction: Faction) -> Vec<String> {
    let has_shield = match faction {
        Faction::Ally => scenario.ally_has_shields,
        Faction::Enemy => scenario.enemy_has_shields,
    };
    let shield = if has_shield { &["shield"][..] } else { &[] };
    let types = (0..scenario.num_unit_types).map(|i| format!("type_{i}"));
    names(first).into_iter().chain(names(&["health"])).chain(names(shield)).chain(types).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Arena, Rules};

    fn end(blocks: &[FeatureBlock]) -> usize {
        blocks.last().map_or(0, FeatureBlock::end)
    }

    #[test]
    fn there_are_as_many_features_as_obs_size_and_state_size() {
        for name in Scenario::standard_names() {
            let mut scenario = Scenario::standard(name).unwrap();
            for (ally, enemy) in [(false, false), (true, false), (false, true), (true, true)] {
                (scenario.ally_has_shields, scenario.enemy_has_shields) = (ally, enemy);
                let sizes = Arena::new(&scenario, Rules::Smaclite).sizes();
                assert_eq!(end(&obs_features(&scenario)), sizes.obs_size, "{name}");
                assert_eq!(end(&state_features(&scenario)), sizes.state_size, "{name}");
            }
        }
    }

    /// With all options of SMACv2's interface off and on, one after the other.
    #[test]
    fn there_are_as_many_features_with_each_option() {
        let with = |name: &str, options: &serde_json::Value| {
            let mut scenario = Scenario::standard(name).unwrap();
            scenario.smacv2 = Some(serde_json::from_value(options.clone()).unwrap());
            let sizes = Arena::new(&scenario, Rules::Smaclite).sizes();
            assert_eq!(end(&obs_features(&scenario)), sizes.obs_size, "{name} {options}");
            assert_eq!(end(&state_features(&scenario)), sizes.state_size, "{name} {options}");
        };
        let mut options = serde_json::to_value(smaclite_scenarios::Smacv2::default()).unwrap();
        let capability = serde_json::json!({"lower_bound": 0.1, "upper_bound": 0.4, "observe": true});
        let keys: Vec<String> = options.as_object().unwrap().keys().cloned().collect();
        for key in keys {
            match &options[&key] {
                serde_json::Value::Bool(on) => options[&key] = (!on).into(),
                serde_json::Value::Null if key != "enemy_mask" => options[&key] = capability.clone(),
                _ => {}
            }
            Scenario::standard_names()
                .chain(Scenario::generated_names())
                .for_each(|name| with(name, &options));
        }
    }
}
