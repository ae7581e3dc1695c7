//! Datasets by the program: record, show, expand, export, errors.

use crate::kit::{Place, SMALL, json, output, parsed, send_signal, spawn, wait_until_caught};
use rustix::process::Signal;

#[test]
fn a_script_is_recorded_described_and_expanded() {
    let folder = &Place::new();
    let record = "dataset record kite --scenario 3m --steps 500 --seed 3";
    let printed = output(folder, &format!("{record} --threads 1 --out kite.smdata"));
    assert!(printed.starts_with("kite.smdata: 3m, rules smaclite, opponent attack_move\n"), "{printed}");
    assert_eq!(output(folder, "dataset show kite.smdata"), printed);
    output(folder, &format!("{record} --threads 3 --out again.smdata"));
    assert!(folder.bytes("kite.smdata") == folder.bytes("again.smdata"), "threads change no bit");

    let card = json(folder, "dataset show kite.smdata --json");
    let hash = card["hash"].as_str().expect("a hash");
    assert!(printed.contains(&format!("\nhash       {hash}\n")), "{printed}");
    let steps = card["steps"].as_u64().expect("a number") as usize;
    assert!((500..620).contains(&steps) && card["policies"][0]["name"] == "kite", "{card}");
    assert_eq!(card["file_bytes"].as_u64(), Some(folder.bytes("kite.smdata").len() as u64));

    let printed = output(folder, "dataset expand kite.smdata --out all");
    assert!(printed.starts_with(&format!("all: {steps} steps with the recorded bits, ")), "{printed}");
    assert_eq!(parsed(&folder.read("all/card.json"))["hash"], hash);
    assert_eq!(folder.names_in("all").len(), 13, "12 arrays and the card");
    assert_eq!(folder.bytes("all/reward.npy").len(), 128 + 4 * steps);

    output(folder, "dataset expand kite.smdata --out some --fields reward,actions");
    assert_eq!(folder.names_in("some"), ["actions.npy", "card.json", "reward.npy"]);
    assert!(folder.bytes("some/actions.npy") == folder.bytes("all/actions.npy"));
    folder.fails("dataset expand kite.smdata --out all", 1, "all: exists; the arrays must be written");
}

#[test]
fn a_run_is_recorded_by_its_qualities() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --steps 512 --evaluate-every 256 {SMALL} --out run"));
    output(folder, "dataset record run --quality replay --episodes 10 --out replay.smdata");
    let card = json(folder, "dataset show replay.smdata --json");
    let policies = card["policies"].as_array().expect("policies");
    let counts: Vec<u64> = policies.iter().filter_map(|policy| policy["episodes"].as_u64()).collect();
    assert!(counts.len() > 1 && counts.iter().sum::<u64>() == 10, "{counts:?}");
    output(folder, "dataset record run --episodes 10 --out best.smdata");
    let printed = output(folder, "dataset show best.smdata");
    let best = printed.lines().find(|line| line.starts_with("run/best.safetensors "));
    assert!(best.is_some_and(|row| row.contains(" steps ")), "it says for how long it trained: {printed}");

    let record = "dataset record run --episodes 10";
    folder.fails(&format!("{record} --quality best --out a.smdata"), 2, "quality must be `good`, `medium`");
    folder.fails(&format!("{record} --out a.npy"), 2, "'a.npy' for '--out <FILE>': must end in .smdata");
    folder.fails(&format!("{record} --scenario 3m --out a.smdata"), 1, "has no effect on a run");
    output(folder, &format!("train 3m --steps 256 {SMALL} --out plain"));
    let record = "dataset record plain --episodes 10 --quality good --out a.smdata";
    folder.fails(record, 1, "the run has no evaluations in evaluations.csv");
}

#[test]
fn errors_say_what_is_accepted() {
    let folder = &Place::new();
    let record = "dataset record kite --scenario 3m --episodes 2 --out a.smdata";
    output(folder, record);
    folder.write("damaged.smdata", &folder.bytes("a.smdata")[..99]);
    for command in ["show damaged.smdata", "expand damaged.smdata --out arrays"] {
        let expected = "damaged.smdata: expected a dataset of `smaclite-pool dataset record`: the file ends";
        folder.fails(&format!("dataset {command}"), 1, expected);
    }
    assert!(!folder.join("arrays").exists());
    folder.fails("dataset show nowhere.smdata", 1, "nowhere.smdata: No such file");
    let fields = "dataset expand a.smdata --out b --fields obs,rewards";
    folder.fails(fields, 1, "unknown array `rewards`; the arrays are obs, state,");
    folder.fails("dataset record kite --episodes 2 --out b.smdata", 1, "--scenario must name");
    folder.fails(&format!("{record} --quality good"), 1, "--quality has no effect on a scripted");
    folder.fails("dataset record kite --scenario 3m --out b.smdata", 2, "--steps <N>");
    folder.fails("dataset record kit --scenario 3m --steps 9 --out b.smdata", 1, "neither a scripted");
    let export = "dataset export a.smdata --to vault --out v.vlt --uid Good --python nothing";
    folder.fails(export, 1, "the Python interpreter nothing cannot be started");
}

/// Ctrl-C ends a recording and an expansion, and leaves no part of their files.
#[test]
fn an_interruption_leaves_no_files() {
    let folder = &Place::new();
    output(folder, "dataset record random --scenario 3m --episodes 20000 --out a.smdata");
    for command in [
        "dataset record random --scenario 27m_vs_30m --episodes 100000000 --threads 1 --out b.smdata",
        "dataset expand a.smdata --threads 1 --out arrays",
    ] {
        let child = spawn(folder, command);
        wait_until_caught(&child);
        send_signal(&child, Signal::INT);
        let done = child.wait_with_output().expect("it ends");
        let message = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.code() == Some(130) && message.contains("interrupted"), "{command}: {message}");
    }
    let left = folder.names_in("").into_iter().filter(|name| name != "pools"); // of the commands' pools
    assert_eq!(left.collect::<Vec<_>>(), ["a.smdata"]);
}
