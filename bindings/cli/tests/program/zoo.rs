//! Teams of the zoo: listed, and played by name.

use crate::kit::{Place, json_lines, output};
use serde_json::Value;

#[test]
fn teams_of_the_zoo_play_by_name() {
    let folder = &Place::new();
    let listed = output(folder, "zoo --json");
    let cards = json_lines(&listed);
    let wins = |result: &Value| result["greedy"]["win_rate"].as_f64() >= Some(0.9);
    let (of_all, of_one): (Vec<&Value>, Vec<&Value>) =
        cards.iter().partition(|card| card["scenario"] == "all-maps");
    assert!(of_one.len() == 20 && of_one.into_iter().all(wins), "{listed}");
    let maps = of_all[0]["maps"].as_object().expect("results by map");
    assert!(maps.len() == 23 && maps.values().filter(|result| wins(result)).count() >= 15, "{maps:?}");
    assert_eq!(output(folder, "zoo").lines().count(), cards.len() + 1);

    let evaluated = output(folder, "evaluate zoo:3m --episodes 64 --seed 1 --greedy");
    assert!(evaluated.contains("win rate     100.0 %"), "{evaluated}");
    let evaluated = output(folder, "evaluate zoo:all-maps --map 8m --episodes 64 --seed 1 --greedy");
    assert!(evaluated.contains("win rate     100.0 %"), "{evaluated}");
    let tournament = output(folder, "tournament zoo:3m hold --episodes 10 --json");
    assert!(tournament.contains("zoo:3m"), "{tournament}");
    output(
        folder,
        "train 3m --opponent zoo:3m --steps 200 --num-envs 8 --horizon 16 --last-actions 4 --out run",
    );
    assert!(folder.join("run/opponent/weights.safetensors").exists(), "the run is complete without the zoo");
    let none = "the zoo has no team `4m`; it has 10m_vs_11m, ";
    folder.fails("evaluate zoo:4m", 1, none);
    folder.fails("tournament zoo:4m hold", 1, none);
    let best = "`zoo:3m` has no weights.safetensors: only the best weights were kept; choose those";
    folder.fails("evaluate zoo:3m --weights last", 1, best);
}

/// The weights of a team of the zoo were within the program alone: no page and no folder had them.
#[test]
fn an_exported_team_plays_as_in_the_zoo() {
    let folder = &Place::new();
    output(folder, "zoo --export 3m teams/3m");
    let play = |team: &str| output(folder, &format!("evaluate {team} --episodes 20 --seed 3"));
    assert_eq!(play("teams/3m").lines().nth(2), play("zoo:3m").lines().nth(2));
    let small = "--steps 200 --num-envs 8 --horizon 16 --last-actions 4";
    output(folder, &format!("train 3m --opponent teams/3m --out run {small}"));
    folder.fails("zoo --export zoo:3m teams/3m", 1, "`teams/3m` already holds a run");
    folder.fails("zoo --export 4m teams/4m", 1, "the zoo has no team `4m`");
    folder.fails("zoo --export 3m", 2, "2 values required");
}

/// The card named the file `best.safetensors` of any team: two datasets looked alike but for their hashes.
#[test]
fn a_dataset_says_whose_it_is() {
    let folder = &Place::new();
    let printed = output(folder, "dataset record zoo:3m --episodes 20 --out a.smdata");
    let row = printed.lines().find(|line| line.starts_with("zoo:3m ")).expect(&printed);
    assert!(row.contains(" steps ") && row.contains(" % "), "trained for, evaluated: {row}");
    output(folder, "zoo --export 3m teams/mine");
    let printed = output(folder, "dataset record teams/mine --episodes 20 --out b.smdata");
    assert!(printed.contains("\nmine/best.safetensors "), "{printed}");
}
