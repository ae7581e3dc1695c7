//! Tournaments by the program: tables, files, errors.

use crate::kit::{Place, SMALL, json, output, parsed, program};
use serde_json::Value;
use std::fs;
use std::process::{Command, Stdio};

const SCRIPTS: &str = "tournament attack_move nearest focus_fire --scenario 3m --episodes 40 --seed 1";

#[test]
fn scripts_and_teams_play_a_tournament() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --steps 256 --out runs/3m {SMALL}"));
    let printed = output(folder, "tournament runs/3m/ attack_move kite --episodes 40 --out all --threads 1");
    assert!(printed.starts_with("3m: 3 players, 8 pairings of 40 episodes, seed 0\n\nplayer "), "{printed}");
    let again = output(folder, "tournament runs/3m attack_move kite --episodes 40 --out again --threads 3");
    assert_eq!(printed, again);
    for name in ["matrix.csv", "matrix.svg", "tournament.json", "tournament.md"] {
        let read = |out: &str| folder.read(&format!("{out}/{name}"));
        assert_eq!(read("all"), read("again"), "{name}");
    }
    let printed = json(folder, "tournament runs/3m attack_move kite --episodes 40 --json");
    let written = parsed(&folder.read("all/tournament.json"));
    assert_eq!(printed, written);
    assert_eq!(written["players"][0]["player"], "runs/3m");
}

/// Every battle is in the rows of both players, with one's wins as the other's losses.
#[test]
fn the_files_agree() {
    let folder = &Place::new();
    let printed = output(folder, &format!("{SCRIPTS} --out t"));
    let read = |name: &str| folder.read(&format!("t/{name}"));
    let csv = read("matrix.csv");
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let head = "player,opponent,side,episodes,wins,draws,losses,return,opponent_return,length";
    assert_eq!((rows[0].join(","), rows.len()), (head.to_owned(), 1 + 2 * 8));
    for pair in rows[1..].chunks_exact(2) {
        let [agents, enemies] = pair else { panic!("two rows per pairing") };
        assert_eq!((agents[2], enemies[2]), ("agents", "enemies"));
        assert_eq!((agents[0], agents[4], agents[7]), (enemies[1], enemies[6], enemies[8]));
        let count = |column: usize| agents[column].parse::<usize>().expect("a number");
        assert_eq!((count(3), count(4) + count(5) + count(6)), (40, 40));
        let cell = format!("{}-{}-{}", agents[4], agents[5], agents[6]);
        assert!(printed.contains(&cell) && read("tournament.md").contains(&cell), "{cell}");
    }
    let svg = read("matrix.svg");
    assert_eq!((svg.matches("<rect ").count(), svg.matches("rotate(-45)").count()), (8, 3), "{svg}");
    assert!(svg.contains("<title>nearest against attack_move: 40-0-0</title>"), "{svg}");
}

/// They were written after the output, whose reader decided whether there were any.
#[test]
fn an_output_that_is_closed_or_full_loses_no_files() {
    let folder = &Place::new();
    let files = |out: &str| -> Vec<(String, Vec<u8>)> {
        let with_bytes = |name: String| (name.clone(), folder.bytes(&format!("{out}/{name}")));
        folder.names_in(out).into_iter().map(with_bytes).collect()
    };
    output(folder, &format!("train 3m --steps 256 --evaluate-every 256 --out run {SMALL}"));
    for (name, command) in [("t", SCRIPTS), ("r", "report run --skip-times")] {
        output(folder, &format!("{command} --out {name}-read"));
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let full = fs::OpenOptions::new().write(true).open("/dev/full").expect("a file");
        for (end, stdout, status) in [("closed", Stdio::from(writer), 0), ("full", Stdio::from(full), 1)] {
            let out = format!("{name}-{end}");
            let mut command = program(folder, &format!("{command} --out {out}"));
            let done = command.stdout(stdout).output().expect("the program starts");
            assert_eq!(done.status.code(), Some(status), "{out}: {done:?}");
            assert!(files(&out) == files(&format!("{name}-read")), "{out}");
        }
    }
}

/// A full disk left some of the new files among the old ones.
#[test]
fn a_full_disk_leaves_the_old_files() {
    let folder = &Place::new();
    output(folder, &format!("{SCRIPTS} --out t"));
    let files = || folder.names_in("t").into_iter().map(|name| folder.read(&format!("t/{name}")));
    let before: Vec<String> = files().collect();
    // The CSV file fits into what files may grow to, and the picture does not.
    let limited = format!(
        "ulimit -f 4; trap '' XFSZ; exec {} {} --out t",
        env!("CARGO_BIN_EXE_smaclite-pool"),
        SCRIPTS.replace("--seed 1", "--seed 2")
    );
    let done = Command::new("sh").args(["-c", &limited]).current_dir(folder.as_os_str()).output();
    let message = String::from_utf8(done.expect("a shell").stderr).expect("text");
    assert!(message.contains("t/matrix.svg: File too large"), "{message}");
    assert!(files().eq(before));
}

#[test]
fn a_team_is_exploited() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --steps 256 --out runs/3m {SMALL}"));
    let exploit = "exploit runs/3m --steps 1000 --seeds 2 --seed 4 --episodes 20";
    let printed = output(folder, &format!("{exploit} --out responses"));
    let head =
        "3m: best responses to runs/3m, 2 seeds, 1000 steps\n\nWins-draws-losses of the best response:\n";
    assert!(printed.starts_with(head), "{printed}");
    assert!(
        folder.join("responses/seed-4/run.json").exists()
            && folder.join("responses/seed-5/run.json").exists()
    );
    let result: Value = json(folder, &format!("{exploit} --json"));
    let points = result["best"]["points"].as_f64().expect("a number");
    assert_eq!(result["exploitability"].as_f64(), Some(points));
    let share = format!("{:.1} %", 100.0 * points);
    let again = format!("\n{} again ", result["best"]["seed"]);
    let row = printed.split_once(&again).expect("a row").1.lines().next().expect("a line");
    assert!(row.ends_with(&share), "{printed}");
    assert!(printed.ends_with(&format!("\nexploitability  {share} of the points\n")), "{printed}");
    let taken = "`responses/seed-4` already holds a run, and `exploit` continues none; choose another folder";
    folder.fails(&format!("{exploit} --out responses"), 1, taken); // it named --resume
    folder.fails("exploit nowhere", 1, "`nowhere` is not the folder of a run");
    // The response was trained against the team, and then played against the script of that name.
    std::fs::rename(folder.join("runs/3m"), folder.join("hold")).expect("a run");
    let by_name = output(folder, "exploit hold --steps 1000 --seeds 2 --seed 4 --episodes 20");
    let table = |printed: &str| printed.split_once("\n\n").expect("a table").1.replace("runs/3m", "./hold");
    assert_eq!(table(&by_name), table(&printed));
    output(folder, &format!("train 5m_vs_6m --steps 256 --out runs/5m {SMALL}"));
    folder.fails("exploit runs/5m", 1, "5m");
    // It named a lane of its own.
    output(folder, &format!("train zerg_5_vs_5 --steps 256 --out runs/zerg {SMALL}"));
    folder.fails("exploit runs/zerg", 1, "a trained team plays the enemies, too: ");
}

#[test]
fn errors_say_what_is_accepted() {
    let folder = &Place::new();
    folder.fails("tournament", 2, "<PLAYER>");
    folder.fails("tournament kite hold --rules paper", 2, "--scenario <MAP>");
    folder.fails("tournament kite hold --scenario 3n", 1, "did you mean `3m`");
    let greedy = "tournament kite hold --scenario 3m --greedy --out none";
    folder.fails(greedy, 1, "--greedy has no effect on scripts; leave it out");
    assert!(!folder.join("none").exists(), "a command that fails leaves no folder");
    folder.fails("tournament kite hold --scenario 3m --episodes 0", 2, "number between 1 and 1000000");
    folder.write("file", "");
    for command in ["tournament kite hold --scenario 3m", "report none", "exploit none --steps 9"] {
        let command = format!("{command} --out file");
        folder.fails(&command, 1, "--out must name a folder, but `file` is a file");
    }
}
