//! Folders of runs where something else is to be, and those that are less than a run.

use crate::kit::{Place, error, output, program};
use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

const SMALL: &str = "--num-envs 8 --horizon 16 --hidden 8,8 --steps 128 --threads 1";

/// `train --seeds` in the folder of a run, and a run in that of seeds, were begun: all seeds were silently
/// overlooked from then on.
#[test]
fn a_run_and_seeds_are_not_begun_in_one_folder() {
    let folder = &Place::new();
    let evaluated = format!("{SMALL} --evaluate-every 128");
    output(folder, &format!("train 3m --seeds 2 --out seeds {evaluated}"));
    output(folder, &format!("train 3m --seed 9 --out one {evaluated}"));
    let seeds = "`seeds/seed-0` already holds a run; continue the runs in `seeds` with --resume";
    folder.fails(&format!("train 3m --seed 9 --out seeds {SMALL}"), 1, seeds);
    let one = "`one` already holds a run; resume it with --resume, or choose another folder";
    folder.fails(&format!("train 3m --seeds 2 --out one {SMALL}"), 1, one);
    folder.fails("zoo --export 3m seeds", 1, "`seeds/seed-0` already holds a run");
    folder.fails("zoo --export 3m one/run.json", 1, "--export must name a folder, but `one/run.json`");
    let evaluate = "it has no run.json, but runs in it; name one, such as `seeds/seed-0`";
    folder.fails("evaluate seeds", 1, evaluate);
    folder.fails("adapt zoo:all-maps 3m --out seeds", 1, "`seeds/seed-0` already holds a run");
    let exploit = |out: &str| format!("exploit one --steps 100 --seeds 1 --seed 5 --episodes 2 --out {out}");
    folder.fails(&exploit("seeds"), 1, "`seeds/seed-0` already holds a run, and `exploit` continues");
    folder.fails(&exploit("one"), 1, "`one` already holds a run, and `exploit` continues none");
    assert!(!folder.join("seeds/run.json").exists() && !folder.join("one/seed-5").exists());
    // What is called otherwise is no seed, as the report of a run.
    output(folder, "report one --skip-times --out one/report");
    output(folder, "train --resume one --steps 256");

    // Where both are in a folder already, none is overlooked.
    for entry in fs::read_dir(folder.join("one")).expect("a folder") {
        let path = entry.expect("an entry").path();
        fs::rename(&path, folder.join("seeds").join(path.file_name().expect("a name"))).expect("a move");
    }
    let both = "`seeds` holds a run, and `seeds/seed-0` in it another one, as `train --seeds` calls it";
    for command in [
        "report seeds --skip-times --out report",
        "verify-run seeds",
        "train --resume seeds",
        "train --resume seeds --seeds 3",
    ] {
        folder.fails(command, 1, both);
    }
}

/// "cannot read `adapted/checkpoint.safetensors`: No such file or directory" sounded like damage.
#[test]
fn a_team_that_was_written_without_a_training_is_not_resumed() {
    let folder = &Place::new();
    output(folder, "adapt zoo:all-maps 3m --out adapted");
    output(folder, "zoo --export 3m exported");
    for team in ["adapted", "exported"] {
        let expected = format!(
            "`{team}` has no checkpoint.safetensors: folders of `adapt` and `zoo --export` have none, and no \
             training continues from them"
        );
        folder.fails(&format!("train --resume {team} --threads 1"), 1, &expected);
    }
}

/// The files of a report were written among those of a run.
#[test]
fn results_are_not_written_into_the_folder_of_a_run() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --out run {SMALL} --evaluate-every 128"));
    let names = || fs::read_dir(folder.join("run")).expect("a folder").count();
    let before = names();
    let expected = "--out must not be the folder of a run, as `run` is; choose another one";
    folder.fails("report run --out run", 1, expected);
    folder.fails("tournament hold random --scenario 3m --episodes 2 --out run", 1, expected);
    assert_eq!(names(), before);
    output(folder, "report run --skip-times --out report");
    output(folder, "report run --skip-times --out report"); // those of an earlier one are replaced
}

/// `exploit` named a file of a temporary folder, with a good name; others named no argument at all.
#[test]
fn a_name_that_is_no_text_is_the_one_that_the_error_names() {
    let folder = &Place::new();
    let bad = OsStr::from_bytes(b"bad\xff");
    output(folder, &format!("train 3m --out run {SMALL}"));
    fs::create_dir(folder.join(bad)).expect("a folder");
    fs::rename(folder.join("run"), folder.join(bad).join("run")).expect("a move");
    let run = Path::new(bad).join("run");
    let check = |before: &str, after: &str, status: i32, expected: &str| {
        let mut command = program(folder, before);
        command.arg(&run).args(after.split(' ').filter(|argument| !argument.is_empty()));
        let done = command.output().expect("the program starts");
        let message = String::from_utf8_lossy(&done.stderr).replace("\n  ", " ");
        assert_eq!(done.status.code(), Some(status), "{before}: {message}");
        assert!(message.contains(expected), "{before}: {message}");
    };
    let of_exploit =
        "the folder of the team that is to play the enemies, `bad\u{fffd}/run`, must have a name";
    check("exploit", "--steps 100 --seeds 1 --episodes 2 --out kept", 1, of_exploit);
    assert!(!folder.join("kept").exists());
    let of_others = "this command accepts only arguments in UTF-8, got `bad\u{fffd}/run`";
    for command in ["report --out out", "tournament --scenario 3m", "train --out other", "show"] {
        check(command, "", 2, of_others);
    }
    check("train 3m --out other --opponent", "", 2, of_others);
    assert!(error(folder, "report", 2).contains("<[NAME=]FOLDER>"));
}
