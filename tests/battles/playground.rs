//! A trained team is the same team in the playground, whose forward pass is its own.

use smaclite_learn::TrainedTeam;
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
        let name = folder.file_name().unwrap().to_str().unwrap();
        let text = std::fs::read_to_string(folder.join("run.json")).unwrap();
        let weights = std::fs::read(folder.join("best.safetensors")).unwrap();
        let here = Team::read(name, &text, &weights).unwrap_or_else(|error| panic!("{error}"));
        let there = TrainedTeam::open(&folder).unwrap_or_else(|error| panic!("{error}"));
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
}
