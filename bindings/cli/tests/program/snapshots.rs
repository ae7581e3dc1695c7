//! Files of snapshots: shown, and recorded from.

use crate::kit::{Place, output};
use smaclite_engine::{
    Arena, Battle, Column, Opponent, RecordLayout, RecordSizes, Rules, Scratch, Sides, policy,
};
use smaclite_scenarios::Scenario;
use smaclite_view::Replay;
use std::fs;
use std::path::Path;
use std::sync::Arc;

/// A battle after some steps, and its snapshot with so many past actions.
fn battle(scenario: &Scenario, rules: Rules, steps: usize, n_past: usize) -> (Battle, Vec<u8>) {
    let mut battle = Battle::new(Arc::new(Arena::new(scenario, rules)), 7);
    let mut actions = vec![0; scenario.n_agents()];
    let mut scratch = Scratch::new();
    for _ in 0..steps {
        policy::nearest(&battle, &mut actions);
        battle.step(&actions, &mut scratch).expect("a legal action");
    }
    let layout = RecordLayout::new(RecordSizes::new(&battle.arena().sizes(), n_past));
    let mut record = vec![0; layout.size()];
    battle.write_record(&layout, &[], &mut record);
    (battle, record)
}

fn standard(name: &str) -> Scenario {
    Scenario::standard(name).expect("a scenario")
}

#[test]
fn the_units_of_a_snapshot_are_shown() {
    let folder = &Place::new();
    let scenario = standard("2s3z");
    let (battle, record) = battle(&scenario, Rules::Paper, 25, 3);
    folder.write("a.snapshot", &record);
    let printed = output(folder, "show a.snapshot");
    let (steps, episode_return) = (battle.episode_length(), battle.episode_return());
    let head = format!("2s3z: rules paper, opponent attack_move\nstep {steps}, return {episode_return:.2}\n");
    assert!(printed.starts_with(&head), "{printed}");
    let units = battle.units();
    for (id, unit) in scenario.units.iter().enumerate() {
        let faction = if id < 5 { "agent" } else { "enemy" };
        let line = format!("{faction} {} ", unit.id_in_faction);
        let line = printed.lines().find(|printed| printed.starts_with(&line)).expect(&line);
        let unit_type = &scenario.unit_types[unit.unit_type];
        let health = format!("{:.1} of {}", units.hp[id], unit_type.hp);
        let expected = if units.alive[id] { health.as_str() } else { "dead" };
        assert!(line.contains(expected) && line.contains(&unit_type.name), "{line}: {expected}");
    }
    assert!(printed.contains("\n< agents: ") && printed.ends_with("##\n"), "{printed}");
    output(folder, "show a.snapshot --png a.png");
    assert!(fs::metadata(folder.join("a.png")).expect("a picture").len() > 1000);
}

#[test]
fn the_snapshot_of_a_scenario_file_names_it() {
    let folder = &Place::new();
    output(folder, "new scenario mine.json --agents 2xSTALKER");
    let scenario = Scenario::load(&folder.join("mine.json")).expect("a scenario");
    folder.write("a.snapshot", battle(&scenario, Rules::default(), 2, 0).1);
    folder.fails("show a.snapshot", 1, "`a.snapshot` is of no standard scenario: column 'scenario' is 0x");
    assert!(
        output(folder, "show a.snapshot --scenario mine.json")
            .starts_with("mine: rules smaclite, opponent attack_move\nstep 2,")
    );
    let other = "`a.snapshot`: the snapshot is of another scenario, or of the same with other keys";
    folder.fails("show a.snapshot --scenario 3m", 1, other);
    folder.fails("show mine.json --scenario 3m", 1, "--scenario is for snapshots");
    output(folder, "record mine.json --from a.snapshot --out a.smreplay");
    // Of both sides: the error was that of the first standard scenario which has agents alone.
    let arena = Arena::new(&scenario, Rules::default()).with_sides(Sides::Mirrored);
    folder.write("b.snapshot", Battle::new(Arc::new(arena), 7).record());
    folder.fails("show b.snapshot", 1, "`b.snapshot` is of no standard scenario: column 'scenario' is 0x");
    output(folder, "show b.snapshot --scenario mine.json");
}

#[test]
fn damaged_snapshots_are_errors_that_name_file_and_column() {
    let folder = &Place::new();
    let good = battle(&standard("3m"), Rules::default(), 3, 0).1;
    let check = |bytes: &[u8], expected: &str| {
        folder.write("a.snapshot", bytes);
        for command in ["show a.snapshot", "record --from a.snapshot --out a.smreplay"] {
            folder.fails(command, 1, expected);
        }
    };
    check(b"", "`a.snapshot`: these bytes are no snapshot");
    check(b"\x93NUMPY\x01\0", "`a.snapshot` is an array file of NumPy; write the bytes of one snapshot");
    check(&good[..good.len() - 8], "`a.snapshot`: the snapshot must have ");
    let mut flipped = good.clone();
    *flipped.last_mut().expect("a byte") ^= 1;
    check(&flipped, "`a.snapshot`: the snapshot is damaged: its checksum is that of other bytes");
    let mut edited = good.clone();
    let layout = RecordLayout::of(&edited).expect("a layout");
    layout.column_mut(&mut edited, Column::Hp)[8..16].copy_from_slice(&46.0_f64.to_le_bytes());
    layout.seal(&mut edited);
    check(&edited, "`a.snapshot`: snapshot column 'hp' must be between 0 and 45 for unit 1, got 46");
    folder.fails("show absent.snapshot", 1, "cannot read `absent.snapshot`: No such file or directory\n");
    fs::create_dir(folder.join("b.snapshot")).expect("a folder");
    folder.fails("show b.snapshot", 1, "`b.snapshot` is not a regular file");
}

fn recorded(folder: &Path, options: &str) -> Replay {
    output(folder, &format!("record --from a.snapshot --out a.smreplay {options}"));
    let replay = Replay::read(&folder.join("a.smreplay")).expect("a replay");
    replay.verify().expect("it is reproduced");
    replay
}

/// A battle that is recorded from a snapshot is the one that went on.
#[test]
fn episodes_begin_in_a_snapshot() {
    let folder = &Place::new();
    let scenario = standard("2s3z");
    let (mut battle, record) = battle(&scenario, Rules::Paper, 20, 0);
    folder.write("a.snapshot", &record);
    let mut actions = vec![0; scenario.n_agents()];
    let mut scratch = Scratch::new();
    while !battle.is_over() {
        policy::nearest(&battle, &mut actions);
        battle.step(&actions, &mut scratch).expect("a legal action");
    }
    let replay = recorded(folder, "--episodes 2");
    let [first, second] = replay.episodes() else { panic!("two episodes") };
    assert_eq!(replay.setup().rules, Rules::Paper);
    assert_eq!(first.outcome.steps, battle.episode_length());
    assert_eq!(first.outcome.episode_return, battle.episode_return());
    let start = |episode: &smaclite_view::Episode| episode.snapshot.clone().expect("a snapshot");
    assert_eq!(start(first).units, start(second).units);
    assert_ne!(first.start, second.start, "other execution orders");
    let seeded = recorded(folder, "--seed 3");
    assert_eq!(seeded.episodes()[0].start, smaclite_engine::StreamPosition::start(3));
    output(folder, "replay a.smreplay --to a.html");

    let (_, over) = self::battle(&scenario, Rules::Smaclite, 0, 0);
    let layout = RecordLayout::of(&over).expect("a layout");
    let mut over = over;
    layout.column_mut(&mut over, Column::EpisodeLength).copy_from_slice(&120_u32.to_le_bytes());
    layout.seal(&mut over);
    folder.write("a.snapshot", &over);
    let message = "`a.snapshot`: the battle is over; nothing can be recorded";
    folder.fails("record --from a.snapshot --out a.smreplay", 1, message);
    assert!(output(folder, "show a.snapshot").contains("step 120, return 0.00, the battle is over\n"));
    folder.fails("record --from a.snapshot --rules paper --out a.smreplay", 2, "cannot be used with");
}

/// Snapshots of battles of two learners, as `watch` and `replay` write them, could be neither shown nor
/// recorded from: "in the snapshot a learner plays the enemies, which needs sides `both`".
#[test]
fn a_battle_of_two_learners_is_shown_and_goes_on_against_a_script() {
    let folder = &Place::new();
    let scenario = standard("corridor");
    let arena = Arena::new(&scenario, Rules::Paper).with_sides(Sides::Both);
    let mut battle = Battle::new(Arc::new(arena), 3);
    let stop = vec![1; scenario.units.len()];
    battle.step(&stop, &mut Scratch::new()).expect("all can stop");
    folder.write("a.snapshot", battle.record());
    let shown = output(folder, "show a.snapshot");
    assert!(shown.starts_with("corridor: rules paper, opponent learner\nstep 1,"), "{shown}");
    // In the file of corridor the enemies are first.
    let (agents, enemies) = (shown.find("agent 5").expect("agents"), shown.find("enemy 0").expect("enemies"));
    assert!(agents < enemies, "{shown}");
    assert_eq!(recorded(folder, "--policy nearest").episodes()[0].opponent, Opponent::AttackMove);
    assert_eq!(recorded(folder, "--opponent kite").episodes()[0].opponent.name(), "kite");
    let several = "record --from a.snapshot --opponent kite=1,random=1 --out b.smreplay";
    folder.fails(several, 1, "--opponent must be one opponent beside --from");
    // Without actions of their own, its enemies would stand still.
    let to = "--out b.smreplay";
    let recorders = [
        format!("record --from a.snapshot {to}"),
        format!("record 3m {to}"),
        "dataset record hold --scenario 3m --out b.smdata".to_owned(),
    ];
    for record in recorders {
        folder.fails(&format!("{record} --opponent learner"), 2, "`learner` is for pools whose actions play");
    }
}
