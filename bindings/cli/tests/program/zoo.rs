//! Teams of the zoo: listed, and played by name.

use crate::kit::{check_error, output};
use serde_json::Value;

#[test]
fn teams_of_the_zoo_play_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let listed = output(folder, "zoo --json");
    let cards: Vec<Value> =
        listed.lines().map(|line| serde_json::from_str(line).expect("a JSON object")).collect();
    assert!(cards.iter().all(|card| card["greedy"]["win_rate"].as_f64() >= Some(0.9)), "{listed}");
    assert_eq!(output(folder, "zoo").lines().count(), cards.len() + 1);

    let evaluated = output(folder, "evaluate zoo:3m --episodes 64 --seed 1 --greedy");
    assert!(evaluated.contains("win rate     100.0 %"), "{evaluated}");
    let tournament = output(folder, "tournament zoo:3m hold --episodes 10 --json");
    assert!(tournament.contains("zoo:3m"), "{tournament}");
    output(
        folder,
        "train 3m --opponent zoo:3m --steps 200 --num-envs 8 --horizon 16 --last-actions 4 --out run",
    );
    assert!(folder.join("run/opponent/weights.safetensors").exists(), "the run is complete without the zoo");
    let none = "the zoo has no team `4m`; it has 10m_vs_11m, ";
    check_error(folder, "evaluate zoo:4m", 1, none);
    check_error(folder, "tournament zoo:4m hold", 1, none);
    let best = "`zoo:3m` has no weights.safetensors: only the best weights were kept; choose those";
    check_error(folder, "evaluate zoo:3m --weights last", 1, best);
}
