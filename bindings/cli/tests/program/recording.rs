//! Recording and watching battles by the program: record, replay, show.

use crate::kit::{Place, make_pipe, output};
use std::fs;
use std::path::Path;

/// The size of a PNG file, which is decoded to its end.
fn png_size(file: &Path) -> (u32, u32) {
    let file = fs::File::open(file).expect("the file");
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG file");
    let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
    let frame = reader.next_frame(&mut pixels).expect("a picture");
    (frame.width, frame.height)
}

fn gif_frames(file: &Path) -> (u16, u16, usize) {
    let file = fs::File::open(file).expect("the file");
    let mut decoder = gif::DecodeOptions::new().read_info(file).expect("a GIF file");
    let mut n_frames = 0;
    while decoder.read_next_frame().expect("a frame").is_some() {
        n_frames += 1;
    }
    (decoder.width(), decoder.height(), n_frames)
}

/// A folder with `3m.smreplay`, two episodes of the policy `focus_fire`.
fn recorded() -> (Place, String) {
    let folder = Place::new();
    let record = "record 3m --policy focus_fire --episodes 2 --seed 5 --out 3m.smreplay";
    let printed = output(&folder, record);
    (folder, printed)
}

#[test]
fn a_recording_is_reproduced() {
    let (folder, recorded) = &recorded();
    let outcomes: Vec<&str> = recorded.lines().filter(|line| line.starts_with("episode ")).collect();
    assert_eq!(outcomes.len(), 2, "{recorded}");
    let printed = output(folder, "replay 3m.smreplay");
    assert!(printed.starts_with("scenario: 3m\nrules: smaclite\nrecorded by: smaclite-pool "), "{printed}");
    for outcome in outcomes {
        assert!(outcome.contains("won after ") && outcome.contains("3 of 3 enemies"), "{outcome}");
        assert!(printed.contains(&format!("{outcome}; reproduced\n")), "{printed}");
    }
}

/// A pipe was opened, and the program waited for whoever would write to it.
#[test]
fn a_pipe_is_no_replay() {
    let folder = &Place::new();
    make_pipe(&folder.join("pipe"));
    folder.fails("replay pipe", 1, "it is not a regular file");
}

/// Escapes in names reach no terminal, and a failed export leaves what was there.
#[test]
fn errors_are_printable_and_leave_old_files() {
    let (folder, _) = &recorded();
    let printed = crate::kit::error(folder, "show \u{1b}[31mred\u{202e}", 1);
    assert!(printed.contains("?[31mred?"), "{printed:?}");
    let printed = crate::kit::error(folder, "serve \u{1b}[2Jx=3m:1=", 2);
    assert!(!printed.contains('\u{1b}'), "{printed:?}");
    for name in ["a.gif", "a.html"] {
        folder.write(name, "old");
        // Files of this process may not grow, as on a full disk.
        let limited = format!(
            "ulimit -f 1; trap '' XFSZ; exec {} replay 3m.smreplay --to {name}",
            env!("CARGO_BIN_EXE_smaclite-pool")
        );
        let done =
            std::process::Command::new("sh").args(["-c", &limited]).current_dir(folder.as_os_str()).output();
        assert!(!done.expect("a shell").status.success(), "{name}");
        assert_eq!(folder.read(name), "old");
    }
    assert!(!folder.names_in("").iter().any(|name| name.starts_with(".tmp")), "a half file is left");
}

#[test]
fn a_replay_becomes_pages_animations_and_pictures() {
    let (folder, _) = &recorded();
    output(folder, "replay 3m.smreplay --to page.html");
    let page = folder.read("page.html");
    assert!(page.starts_with("<!doctype html>") && page.contains("3m replay"));

    let options = "--episode 1 --size 80x64 --theme light";
    output(folder, &format!("replay 3m.smreplay --to frames {options}"));
    let n_frames = fs::read_dir(folder.join("frames")).expect("a folder").count();
    assert!(n_frames > 8 && n_frames % 8 == 1, "the start and 8 ticks per step, got {n_frames}");
    assert_eq!(png_size(&folder.join("frames/000.png")), (80, 64));

    // The last frame stays for one second.
    output(folder, &format!("replay 3m.smreplay --to battle.gif --fps 4 {options}"));
    assert_eq!(gif_frames(&folder.join("battle.gif")), (80, 64, n_frames + 4));
}

#[test]
fn a_step_of_a_replay_is_saved_as_a_snapshot() {
    let (folder, _) = &recorded();
    for (options, shown) in
        [("--episode 0", "step 0, return 0.00"), ("--episode 1 --step 5", "step 5, return ")]
    {
        output(folder, &format!("replay 3m.smreplay --to 3m.snapshot {options}"));
        let printed = output(folder, "show 3m.snapshot");
        assert!(printed.contains(shown), "{printed}");
    }
    let again = output(folder, "record --from 3m.snapshot --policy nearest --out again.smreplay");
    assert!(again.starts_with("episode 0: "), "{again}");
    assert!(output(folder, "replay again.smreplay").contains("reproduced"));
}

/// A program named ffmpeg that keeps its input and its arguments.
const FFMPEG: &str = "for last; do :; done\necho \"$@\" > arguments\n/bin/cat > \"${last#file:}\"\n";

#[test]
fn ffmpeg_gets_every_frame() {
    let (folder, _) = &recorded();
    let sourced = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scripts/sourced");
    std::os::unix::fs::symlink(sourced, folder.join("ffmpeg")).expect("a link");
    let install = |script: &str| folder.write("ffmpeg.script", script);
    install(FFMPEG);
    output(folder, "replay 3m.smreplay --to battle.mp4 --size 33x16 --fps 4");
    let arguments = folder.read("arguments");
    assert!(arguments.contains("-pix_fmt rgb24 -s 33x16 -r 4 "), "{arguments}");
    let bytes = fs::metadata(folder.join("battle.mp4")).expect("a file").len();
    output(folder, "replay 3m.smreplay --to frames --size 33x16");
    let n_frames = fs::read_dir(folder.join("frames")).expect("a folder").count() as u64 + 4;
    assert_eq!(bytes, n_frames * 33 * 16 * 3);

    install("exit 3\n");
    let expected = "battle.mp4: ffmpeg failed (exit status: 3); it says above why";
    folder.fails("replay 3m.smreplay --to battle.mp4", 1, expected);
}

#[test]
fn what_cannot_be_recorded_is_an_error() {
    let (folder, _) = &recorded();
    let error = |arguments, status, expected| folder.fails(arguments, status, expected);
    let policies = "unknown policy `greedy`; the policies are random, nearest, focus_fire, kite, hold";
    error("record 3m --policy greedy --out a.smreplay", 2, policies);
    error("record 3m --out a.json", 2, "'a.json' for '--out <FILE>': must end in .smreplay");
    error("record 3m --episodes 0 --out a.smreplay", 2, "number between 1 and 10000");
    error("record 3mm --out a.smreplay", 1, "did you mean `3m`?");
    error("record 3m --rules chess --out a.smreplay", 2, "chess");
}

#[test]
fn what_cannot_be_replayed_is_an_error() {
    let (folder, _) = &recorded();
    let error = |arguments, status, expected| folder.fails(arguments, status, expected);
    let suffixes = "'--to <OUT>': must end in .html, .gif, .mp4 or .snapshot, or be a new folder without";
    error("replay 3m.smreplay --to battle.avi", 2, suffixes);
    error("replay 3m.smreplay --to ..", 2, suffixes);
    error("replay 3m.smreplay --to battle.mp4", 1, "needs the program ffmpeg, which is not installed");
    error("replay 3m.smreplay --to a.gif --episode 2", 1, "episode must be below 2");
    error("replay 3m.smreplay --to a.gif --fps 0", 1, "--fps must be between 0.01 and 50 for a GIF, got 0");
    error("replay 3m.smreplay --to a.mp4 --fps nan", 1, "between 0.01 and 1000 for an MP4 file, got NaN");
    error("replay 3m.smreplay --to a.gif --size 9x9", 2, "must be WIDTHxHEIGHT, each between 16 and 4096");
    error("replay 3m.smreplay --to a.html --episode 1", 1, "--episode has no effect on a page");
    error("replay 3m.smreplay --to frames --fps 8", 1, "--fps has no effect on a folder");
    error("replay 3m.smreplay --to a.snapshot --fps 8", 1, "--fps has no effect on a snapshot");
    error("replay 3m.smreplay --to a.gif --step 8", 1, "--step has no effect on a GIF");
    error("replay 3m.smreplay --to a.snapshot --step 999", 1, "got 999");
    error("replay 3m.smreplay --fps 8", 2, "--to");
    error("replay absent.smreplay", 1, "absent.smreplay: No such file or directory");

    fs::create_dir(folder.join("full")).expect("a folder");
    error("replay 3m.smreplay --to full", 1, "full: exists; --to must be a new folder");
    fs::create_dir(folder.join("folder.gif")).expect("a folder");
    error("replay 3m.smreplay --to folder.gif", 1, "--to folder.gif: is a directory");

    let bytes = folder.bytes("3m.smreplay");
    folder.write("short.smreplay", &bytes[..bytes.len() / 2]);
    error("replay short.smreplay --to short.html", 1, "short.smreplay: expected a replay");
    assert!(!folder.join("short.html").exists() && !folder.join("a.gif").exists());
}

/// Two marines, and an obstacle between them and a zergling.
const CUSTOM: &str = r#"{
    "name": "wall", "num_allied_units": 2, "num_enemy_units": 1,
    "groups": [
        { "x": 2, "y": 2, "faction": "ALLY", "units": { "MARINE": 2 } },
        { "x": 10, "y": 2, "faction": "ENEMY", "units": { "ZERGLING": 1 } }
    ],
    "attack_point": [6, 4], "width": 12, "height": 6,
    "terrain": [
        "____________", "____________", "_____XX_____",
        "____________", "____________", "XXXXXXXXXXXX"
    ],
    "num_unit_types": 0, "ally_has_shields": false, "enemy_has_shields": false
}"#;

#[test]
fn a_custom_scenario_is_shown() {
    let folder = &Place::new();
    folder.write("wall.json", CUSTOM);
    let printed = output(folder, "show wall.json");
    let expected = "\
wall: 12 x 6 squares, episode limit none
< agents: 2 MARINE (M)
> enemies: 1 ZERGLING (G)

########################
. . . . . . x . . . . .
. . . . . . . . . . . .
. . . . . ####. . . G>.
. M<M<. . . . . . . . .
. . . . . . . . . . . .
";
    assert_eq!(printed, expected);
    output(folder, "show wall.json --png wall.png --size 96x48 --sight --range --ids --theme light");
    assert_eq!(png_size(&folder.join("wall.png")), (96, 48));
}

#[test]
fn a_scenario_without_a_limit_is_recorded_with_one() {
    let folder = &Place::new();
    folder.write("wall.json", CUSTOM.replace("[6, 4]", "[10, 2]"));
    let printed = output(folder, "record wall.json --policy hold --out wall.smreplay");
    assert!(printed.starts_with("episode 0: truncated after 1000 steps"), "{printed}");
    assert!(output(folder, "replay wall.smreplay").contains("; reproduced"));
}

#[test]
fn a_standard_scenario_is_shown() {
    let folder = &Place::new();
    let printed = output(folder, "show 2s3z");
    let count = |text: &str| printed.matches(text).count();
    assert_eq!((count("S<"), count("Z<"), count("S>"), count("Z>")), (2, 3, 2, 3), "{printed}");
    output(folder, "show 2s3z --png map.png");
    assert_eq!(png_size(&folder.join("map.png")), (512, 512));
    folder.fails("show 2s3z --png map.jpg", 2, "'map.jpg' for '--png <OUT>': must end in .png");
    folder.fails("show 2s3z --sight", 2, "--png");
    folder.fails("show absent.json", 1, "absent.json");
}

#[test]
fn all_standard_scenarios_are_shown_on_one_sheet() {
    let folder = &Place::new();
    output(folder, "show --all --png maps.png --size 64x48");
    let (width, height) = png_size(&folder.join("maps.png"));
    assert!(width > 6 * 64 && width < 7 * 64 && height > 4 * 48 && height < 8 * 48, "{width} x {height}");
    folder.fails("show --all", 2, "--png");
    folder.fails("show", 2, "SCENARIO");
    folder.fails("show 3m --all --png maps.png", 2, "--all");
    folder.fails("show --all --png huge.png --size 4096x4096", 1, "16384 pixels");
}
