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
