//! A team that is trained on several maps.

use super::Train;
use crate::check::warn_of;
use smaclite_engine::BattleSetup;
use smaclite_learn::{Algorithm, Config, NetworkKind, RunDescription, resolve_scenario};
use smaclite_scenarios::Scenario;
use std::error::Error;

/// The fewest environments of a map by default, if a team is trained on several.
const ENVS_PER_MAP: usize = 8;

/// What a run is called: by its map, or the number of its maps.
pub(super) fn name_of(run: &RunDescription) -> String {
    if run.map_count() == 1 { run.name.clone() } else { in_words(run.map_count()) }
}

pub(super) fn in_words(maps: usize) -> String {
    format!("{maps} maps")
}

/// Names, and each with its weight: `MAP=WEIGHT`, or a `MAP`, whose weight is 1. What comes behind the last
/// `=` of a name and is no number is part of it.
fn weighted_maps(arguments: &[String]) -> Vec<(String, f64)> {
    let weighted = |argument: &String| match argument.rsplit_once('=') {
        Some((name, weight)) => weight.parse().ok().map(|weight| (name.to_owned(), weight)),
        None => None,
    };
    let arguments = arguments.iter().map(|argument| weighted(argument).unwrap_or((argument.clone(), 1.0)));
    let expanded = arguments.flat_map(|(name, weight)| {
        let names: Vec<String> = match name.as_str() {
            "all" => Scenario::standard_names().map(str::to_owned).collect(),
            "generated" => Scenario::generated_names().map(str::to_owned).collect(),
            _ => vec![name],
        };
        names.into_iter().map(move |name| (name, weight))
    });
    expanded.collect()
}

impl Train {
    /// What a team plays that is trained on these maps, and its hyperparameters, unless others are given.
    pub(super) fn maps_to_train(
        &self,
        names: &[String],
    ) -> Result<(Vec<BattleSetup>, Config), Box<dyn Error>> {
        let weighted = weighted_maps(names);
        if let Some((map, weight)) =
            weighted.iter().find(|(_, weight)| !(*weight > 0.0 && weight.is_finite()))
        {
            return Err(
                format!("--maps: the weight of `{map}` must be a number above 0, got {weight}").into()
            );
        }
        let (names, weights): (Vec<String>, Vec<f64>) = weighted.into_iter().unzip();
        let resolve = |name: &String| resolve_scenario(name, self.rules.unwrap_or_default());
        let setups = names.iter().map(resolve).collect::<Result<Vec<BattleSetup>, _>>()?;
        setups.iter().for_each(warn_of);
        let mut n_agents = 0;
        for setup in &setups {
            n_agents += setup.files.scenario()?.n_agents();
        }
        // Explores as the mean of its teams; the state says how strong drawn teams are.
        let config = Config::for_agents(n_agents / setups.len()).with_network(NetworkKind::Universal);
        let num_envs = config.num_envs.max(ENVS_PER_MAP * setups.len());
        let are_given = weights.iter().any(|weight| *weight != 1.0);
        let map_weights = if are_given { weights } else { Vec::new() };
        Ok((setups, Config { algorithm: Algorithm::Mappo, num_envs, map_weights, ..config }))
    }
}

#[cfg(test)]
mod tests {
    use super::weighted_maps;

    #[test]
    fn a_number_behind_the_last_equals_sign_is_a_weight() {
        let parse =
            |arguments: &[&str]| weighted_maps(&arguments.iter().map(|&a| a.to_owned()).collect::<Vec<_>>());
        let expected = [("3m", 1.0), ("runs/a=b.json", 1.0), ("runs/a=b.json", 2.5), ("8m", -1.0)];
        let found = parse(&["3m", "runs/a=b.json", "runs/a=b.json=2.5", "8m=-1"]);
        assert_eq!(found, expected.map(|(name, weight)| (name.to_owned(), weight)));
        let generated = parse(&["generated=0.5", "all"]);
        assert_eq!(generated.len(), 38);
        assert!(generated.iter().all(|(name, weight)| *weight
            == if name.contains("_5_vs_5") || name.contains("0_vs_") { 0.5 } else { 1.0 }));
    }
}
