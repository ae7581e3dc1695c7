//! The least and the greatest value of every feature, for the spaces that environments declare.
//!
//! Most features are shares, between -1 and 1. The others follow from how far units get ([`Extent`]), and
//! from the options of SMACv2's interface.

use smaclite_scenarios::{Scenario, Smacv2};

use super::features::obs_features;
use crate::SIGHT_RANGE;
use crate::extent::Extent;
use crate::features::FeatureBlock;
use crate::smacv2::GREATEST_LEVEL;

/// The least and the greatest value.
type Bounds = [f64; 2];

/// The least and the greatest value of each feature of a block of
/// [`obs_features`](crate::obs_features) or [`state_features`](crate::state_features). Values that a lane
/// appends, as last actions, are 0 or 1. The unit types of the scenario are those of
/// [`Rules::figures`](crate::Rules::figures).
pub fn feature_bounds(scenario: &Scenario, block: &FeatureBlock) -> Vec<[f32; 2]> {
    let mut of_agents = None;
    let bounds = |name: &String| {
        // A state of all observations, one after the other.
        let [low, high] = match name.strip_prefix("obs_").and_then(|index| index.parse::<usize>().ok()) {
            Some(index) => of_agents.get_or_insert_with(|| obs_bounds(scenario))[index],
            None => bounds_of(scenario, name),
        };
        // As features are rounded.
        [low.min(-1.0) as f32, high.max(1.0) as f32]
    };
    block.features.iter().map(bounds).collect()
}

/// Of every float of an observation.
fn obs_bounds(scenario: &Scenario) -> Vec<Bounds> {
    let rows = |block: &FeatureBlock| {
        let row: Vec<Bounds> = block.features.iter().map(|name| bounds_of(scenario, name)).collect();
        row.repeat(block.rows.unwrap_or(1))
    };
    obs_features(scenario).iter().flat_map(rows).collect()
}

fn bounds_of(scenario: &Scenario, name: &str) -> Bounds {
    let Extent { low, high } = Extent::of(&scenario.terrain);
    let [low, high] = [low, high].map(|corner| corner.as_dvec2());
    let (width, height) = (f64::from(scenario.terrain.width()), f64::from(scenario.terrain.height()));
    let relative = |x: f64, side: f64| (x - side / 2.0) / side;
    match name {
        "x" => [low.x / width, high.x / width],
        "y" => [low.y / height, high.y / height],
        "rel_x" => [relative(low.x, width), relative(high.x, width)],
        "rel_y" => [relative(low.y, height), relative(high.y, height)],
        "distance" | "dx" | "dy" => {
            let farthest = shows_all(scenario).map_or(1.0, |sight| (high - low).length() / sight);
            [-farthest, farthest]
        }
        // SMACv2's interface divides by the cooldown alone, to which rules can add a random delay.
        "energy/cooldown" if scenario.smacv2.is_some() => {
            let types = scenario.unit_types.iter().filter(|unit_type| unit_type.cooldown > 0.0);
            let shares = types.map(|unit_type| unit_type.greatest_cooldown() / unit_type.cooldown);
            [-1.0, shares.fold(1.0, f64::max)]
        }
        // As a share of what is above the agent's level, which is negative below it.
        "health" => {
            let levels = scenario.smacv2.as_ref().and_then(|options| options.health);
            let highest = levels.map_or(0.0, |levels| levels.upper_bound.min(GREATEST_LEVEL));
            [1.0 / (1.0 - highest) * -highest, 1.0]
        }
        _ => [-1.0, 1.0],
    }
}

/// The least range by which agents see distances divided, where they see units at any distance.
fn shows_all(scenario: &Scenario) -> Option<f64> {
    let Smacv2 { fully_observable, use_unit_ranges, .. } = scenario.smacv2.as_ref()?;
    let ranges = scenario.unit_types.iter().map(|unit_type| unit_type.sight_range);
    let least = if *use_unit_ranges { ranges.fold(f64::INFINITY, f64::min) } else { SIGHT_RANGE };
    fully_observable.then_some(least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_scenarios::{Capability, Terrain};

    /// Units stop 16 squares off a map of 8 times 20.
    fn narrow(options: Option<Smacv2>) -> Scenario {
        let terrain = Terrain::from_fn(8, 20, |_, _| true).unwrap();
        Scenario { terrain, smacv2: options, ..Scenario::standard("MMM").unwrap() }
    }

    fn bounds(scenario: &Scenario, names: &[&str]) -> Vec<[f32; 2]> {
        let features = names.iter().map(|&name| name.to_owned()).collect();
        feature_bounds(scenario, &FeatureBlock { name: "own", start: 0, rows: None, features })
    }

    #[test]
    fn bounds_are_as_far_as_units_get() {
        let names =
            ["x", "y", "rel_x", "rel_y", "distance", "dx", "dy", "health", "energy/cooldown", "type_0"];
        let shares = [[-1.0, 1.0]; 6];
        let places = [[-2.0, 3.0], [-1.0, 1.8], [-2.5, 2.5], [-1.3, 1.3]];
        assert_eq!(bounds(&narrow(None), &names), [&places[..], &shares].concat());

        // Those who see everything see 40 times 52 squares, and divide by the sight of all units.
        let all = Smacv2 { fully_observable: true, use_unit_ranges: false, ..Smacv2::default() };
        let farthest = (f64::hypot(40.0, 52.0) / SIGHT_RANGE) as f32;
        let names = ["distance", "dx", "dy"];
        assert_eq!(bounds(&narrow(Some(all.clone())), &names), [[-farthest, farthest]; 3]);
        // Or by their own, of which that of marines is the least.
        let own = Smacv2 { use_unit_ranges: true, ..all };
        let farthest = (f64::hypot(40.0, 52.0) / 9.0) as f32;
        assert_eq!(bounds(&narrow(Some(own)), &names), [[-farthest, farthest]; 3]);
    }

    /// An agent at no health is a whole level below it, as a share of what is above: 0.75 of 0.25.
    #[test]
    fn health_below_a_level_is_negative() {
        let level = Capability { lower_bound: 0.5, upper_bound: 0.75, observe: true };
        let options = Smacv2 { health: Some(level), ..Smacv2::default() };
        assert_eq!(bounds(&narrow(Some(options)), &["health", "shield"]), [[-3.0, 1.0], [-1.0, 1.0]]);
    }

    #[test]
    fn a_cooldown_with_a_random_delay_is_more_than_a_share() {
        let with_delay = |options| {
            let mut scenario = narrow(options);
            for unit_type in &mut scenario.unit_types {
                unit_type.conduct.max_random_delay = 0.5 * unit_type.cooldown;
            }
            bounds(&scenario, &["energy/cooldown"])[0]
        };
        assert_eq!(with_delay(Some(Smacv2::default())), [-1.0, 1.5]);
        assert_eq!(with_delay(None), [-1.0, 1.0]);
    }

    /// A state that consists of observations has their bounds, agent after agent.
    #[test]
    fn a_state_of_observations_has_their_bounds() {
        let options = Smacv2 { obs_instead_of_state: true, obs_own_pos: true, ..Smacv2::default() };
        let scenario = narrow(Some(options));
        let of_obs: Vec<[f32; 2]> = obs_features(&scenario)
            .iter()
            .flat_map(|block| feature_bounds(&scenario, block).repeat(block.rows.unwrap_or(1)))
            .collect();
        let of_state = crate::state_features(&scenario);
        assert_eq!(feature_bounds(&scenario, &of_state[0]), of_obs);
        assert!(of_obs.contains(&[-2.0, 3.0]));
    }
}
