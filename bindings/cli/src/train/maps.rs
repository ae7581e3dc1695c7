//! A team that is trained on several maps.

use super::{Opened, Train};
use crate::check::warn_of;
use smaclite_engine::BattleSetup;
use smaclite_ipc::RuntimeDir;
use smaclite_learn::{Algorithm, Config, LaneError, Lanes, NetworkKind, Run, resolve_scenario};
use smaclite_scenarios::Scenario;
use std::error::Error;
use std::path::Path;
/// The fewest environments of a map by default, if a team is trained on several.
const ENVS_PER_MAP: usize = 8;

pub(super) fn in_words(maps: &[BattleSetup]) -> String {
    format!("{} maps", maps.len())
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

/// Lanes of each map.
pub(super) fn lanes_of_maps(
    setups: &[BattleSetup],
    config: &Config,
    threads: usize,
    runtime_dir: &RuntimeDir,
) -> Result<Vec<Lanes>, LaneError> {
    let maps: Vec<_> = setups.iter().zip(config.envs_of_maps(setups.len())).collect();
    Lanes::start_maps(&maps, config.last_actions, (threads - 1).max(1), runtime_dir)
}

impl Train {
    pub(super) fn begin_on_maps(
        self,
        out: &Path,
        names: &[String],
        threads: usize,
        runtime_dir: &RuntimeDir,
    ) -> Result<Opened, Box<dyn Error>> {
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
        setups.iter().for_each(|setup| warn_of(&setup.files));
        let mut n_agents = 0;
        for setup in &setups {
            n_agents += setup.files.scenario()?.n_agents();
        }
        // Explores as the mean of its teams; the state says how strong drawn teams are.
        let config = Config::for_agents(n_agents / setups.len()).with_network(NetworkKind::Universal);
        let num_envs = config.num_envs.max(ENVS_PER_MAP * setups.len());
        let are_given = weights.iter().any(|weight| *weight != 1.0);
        let map_weights = if are_given { weights } else { Vec::new() };
        let mut config = Config { algorithm: Algorithm::Mappo, num_envs, map_weights, ..config };
        config.steps = self.steps.unwrap_or(config.steps);
        let config = self.hyperparameters.apply(config);
        config.check()?;
        config.check_maps(setups.len())?;
        let name = in_words(&setups);
        let lanes = lanes_of_maps(&setups, &config, threads, runtime_dir)?;
        let maps = setups.into_iter().zip(lanes).collect();
        Ok(Opened::One(Box::new(Run::begin_on_maps(out, config, maps, threads)?), name))
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
