//! A trained team is the same team in the playground, whose forward pass is its own.

use smaclite_engine::Rules;
use smaclite_ipc::RuntimeDir;
use smaclite_learn::{Algorithm, Config, Lanes, NetworkKind, Run, TrainedTeam, resolve_scenario};
use smaclite_playground::Team;
use std::path::Path;

/// The sums are added in another order.
const TOLERANCE: f32 = 1e-5;

#[test]
fn teams_of_the_zoo_have_the_outputs_that_the_learner_computes() {
    let zoo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bindings/learn/zoo");
    let entries = std::fs::read_dir(zoo).unwrap().map(|entry| entry.unwrap().path());
    let folders: Vec<_> = entries.filter(|path| path.join("run.json").is_file()).collect();
    assert!(!folders.is_empty(), "the zoo has no team");
    for folder in folders {
        check_outputs(&folder, "best.safetensors");
    }
}

/// Over units, of teams without healers, with a healer, and with types that each episode draws; also those
/// that fit every scenario.
#[test]
fn networks_over_units_have_the_outputs_that_the_learner_computes() {
    let place = tempfile::tempdir().unwrap();
    let runtime_dir = RuntimeDir::at(place.path().join("pools")).unwrap();
    let maps = ["3m", "MMM", "terran_5_vs_5"];
    let both = [NetworkKind::Units, NetworkKind::Universal];
    for (network, map) in both.into_iter().flat_map(|network| maps.map(|map| (network, map))) {
        let config = Config { hidden: vec![6, 10], num_envs: 4, horizon: 16, ..Config::for_agents(3) };
        let config = Config { network, algorithm: Algorithm::Mappo, ..config };
        let config = Config { steps: 64, actor_lr: 0.05, last_actions: 1, ..config };
        let scenario = resolve_scenario(map, Rules::Smaclite).unwrap();
        let lanes = Lanes::start(&scenario, 4, 1, 1, &runtime_dir).unwrap();
        let folder = place.path().join(format!("{map} {network}"));
        let mut run = Run::begin(&folder, config, &scenario, lanes, 1).unwrap();
        while run.update(&mut || false).unwrap().is_some() {}
        run.checkpoint().unwrap();
        check_outputs(&folder, "weights.safetensors");
    }
}

fn check_outputs(folder: &Path, weights: &str) {
    let name = folder.file_name().unwrap().to_str().unwrap();
    let text = std::fs::read_to_string(folder.join("run.json")).unwrap();
    let weights = std::fs::read(folder.join(weights)).unwrap();
    let here = Team::read(name, &text, &weights).unwrap_or_else(|error| panic!("{error}"));
    let there = TrainedTeam::open(folder).unwrap_or_else(|error| panic!("{error}"));
    let sizes = here.sizes();
    // As observations: between -1 and 1, and most of them 0.
    let number = |i: usize| ((i * 2_654_435_761) % 1999) as f32 / 999.0 - 1.0;
    let obs: Vec<f32> =
        (0..sizes.n_agents * sizes.obs_size).map(|i| if i % 3 == 0 { number(i) } else { 0.0 }).collect();
    let (ours, theirs) = (here.logits(&obs), there.logits(&obs));
    assert_eq!(ours.len(), sizes.n_agents * sizes.n_actions);
    assert_eq!(ours.len(), theirs.len());
    for (i, (a, b)) in ours.iter().zip(&theirs).enumerate() {
        assert!((a - b).abs() <= TOLERANCE * b.abs().max(1.0), "{name}, output {i}: {a} and {b}");
    }
    assert!(ours.iter().any(|logit| logit.abs() > 0.1), "{name} computes something");
}
