//! Completion in shells, and man pages.

use crate::kit::{Place, output, run};
use std::collections::BTreeSet;
use std::fs;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

/// What bash offers for the last of these words, with the script that the program prints.
fn offered(folder: &Path, words: &[&str]) -> Vec<String> {
    let script = r#"
        source <("$PROGRAM" completions bash)
        [[ $(complete -p smaclite-pool) =~ -F\ ([^ ]+) ]] || exit
        COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMP_TYPE=9
        "${BASH_REMATCH[1]}" smaclite-pool "${@: -1}" "${@: -2:1}"
        printf '%s\n' "${COMPREPLY[@]}""#;
    let mut command = Command::new("bash");
    command.args(["--norc", "-c", script, "bash", "smaclite-pool"]).args(words).current_dir(folder);
    command.env("PROGRAM", env!("CARGO_BIN_EXE_smaclite-pool"));
    command.env(smaclite_ipc::ROOT_VARIABLE, folder.join("pools"));
    let done = command.output().expect("bash");
    assert!(done.stderr.is_empty(), "{words:?}: {}", String::from_utf8_lossy(&done.stderr));
    String::from_utf8(done.stdout).expect("text").lines().map(str::to_owned).collect()
}

#[test]
fn bash_completes_commands_options_scenarios_and_files() {
    let folder = &Place::new();
    let file = |name: &str| folder.write(name, "");
    ["mine.json", "mine.txt", "3-notes.json"].into_iter().for_each(file);
    for (words, expected) in [
        (&["sch"][..], &["schema"][..]),
        (&["serve", "--auto"], &["--autoreset-mode"]),
        (&["bench", "--mode", "at"], &["attached"]),
        (&["show", "3s5"], &["3s5z", "3s5z_vs_3s6z"]),
        (&["show", "3"], &["3m", "3s5z", "3s5z_vs_3s6z", "3s_vs_3z", "3s_vs_4z", "3s_vs_5z", "3-notes.json"]),
        (&["train", "mi"], &["mine.json"]),
        (&["serve", "2s3z:8", "hard=MMM"], &["hard=MMM", "hard=MMM2"]),
        (&["check", "mine"], &["mine.json", "mine.txt"]),
        (&["completions", "f"], &["fish"]),
    ] {
        let mut offered = offered(folder, words);
        let mut expected: Vec<String> = expected.iter().map(|word| (*word).to_owned()).collect();
        offered.sort();
        expected.sort();
        assert_eq!(offered, expected, "{words:?}");
    }
}

#[test]
fn bash_completes_the_names_of_running_pools() {
    let place = &Place::new();
    let offered = |words: &[&str]| offered(place, words);
    assert!(offered(&["status", "tr"]).iter().all(String::is_empty));
    let _pool = place.serve("3m:2 --name train");
    for words in [&["status", "t"][..], &["watch", "tra"], &["record", "--pool", ""]] {
        assert_eq!(offered(words), ["train"], "{words:?}");
    }
}

/// The script of a program in another folder was to work in every folder. The program that is run by its name
/// alone, as for the scripts of a wheel, prints one that runs what PATH has.
#[test]
fn scripts_run_the_program_that_printed_them() {
    let folder = &Place::new();
    let program = env!("CARGO_BIN_EXE_smaclite-pool");
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = output(folder, &format!("completions {shell}"));
        assert!(script.contains(program) && script.contains("SMACLITE_POOL_COMPLETE"), "{shell}: {script}");
        let mut by_name = Command::new(program);
        by_name.arg0("smaclite-pool").args(["completions", shell]).current_dir(folder.as_os_str());
        let script = String::from_utf8(by_name.output().expect("the program").stdout).expect("text");
        assert!(script.contains("smaclite-pool") && !script.contains(program), "{shell}: {script}");
    }
}

#[test]
fn there_is_a_man_page_per_command() {
    let folder = &Place::new();
    output(folder, "man --out pages/man1");
    let pages = fs::read_dir(folder.join("pages/man1")).expect("a folder");
    let pages: BTreeSet<String> =
        pages.map(|page| page.expect("a page").file_name().into_string().expect("text")).collect();
    let help = output(folder, "--help");
    let commands =
        help.split("Commands:").nth(1).and_then(|text| text.split("Options:").next()).expect(&help);
    let commands = commands.lines().filter_map(|line| line.strip_prefix("  ")?.split(' ').next());
    let commands = commands.filter(|command| !["", "help"].contains(command));
    let mut expected: BTreeSet<String> =
        commands.map(|command| format!("smaclite-pool-{command}.1")).collect();
    let nested =
        ["new-scenario", "new-unit", "dataset-record", "dataset-show", "dataset-expand", "dataset-export"];
    expected.extend(nested.map(|command| format!("smaclite-pool-{command}.1")));
    expected.insert("smaclite-pool.1".to_owned());
    assert_eq!(pages, expected);
    for page in &pages {
        let text = fs::read_to_string(folder.join("pages/man1").join(page)).expect("text");
        let heads = ["\n.TH ", "\n.SH NAME\n", "\n.SH SYNOPSIS\n", "\n.SH DESCRIPTION\n", "\n.SH OPTIONS\n"];
        assert!(heads.iter().all(|head| text.contains(head)), "{page}: {text}");
    }
    let printed = output(folder, "man");
    assert_eq!(printed, folder.read("pages/man1/smaclite-pool.1"));
    let refused = run(folder, "man --out pages/man1/smaclite-pool.1");
    assert_eq!(refused.status.code(), Some(1));
}

#[test]
fn licences_names_the_crates_of_others() {
    let folder = &Place::new();
    let printed = output(folder, "licences");
    assert!(printed.contains("\niceoryx2 0."), "{printed}");
    assert!(printed.contains("Permission is hereby granted"), "{printed}");
}
