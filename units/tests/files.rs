//! Custom unit files: what is accepted, and the message for everything that is refused.

use smaclite_units::{CombatType, Plane, Problems, Targeter, UnitType};

mod messages;

/// The valid file of the page with `changes`; an empty value leaves the key out.
fn file(changes: &[(&str, &str)]) -> String {
    messages::file(&messages::valid("Unit files"), changes)
}

fn read(changes: &[(&str, &str)]) -> Result<UnitType, Problems> {
    UnitType::from_json(&file(changes), "scout", "scout.json")
}

/// The messages of all problems, one per line, without their positions.
fn all(problems: &Problems) -> String {
    assert_eq!(problems.list().len(), problems.n_problems());
    let messages: Vec<_> = problems.list().iter().map(|problem| problem.message.as_str()).collect();
    messages.join("\n")
}

#[test]
fn what_a_file_leaves_out_has_defaults() {
    let scout = read(&[]).unwrap();
    assert_eq!((scout.shield, scout.hp_regen, scout.energy, scout.initial_energy), (0.0, 0.0, 0.0, 0.0));
    assert_eq!((scout.attacks, scout.minimum_scan_range, scout.bonuses.len()), (1, 5.0, 0));
    assert_eq!((scout.plane, scout.combat_type), (Plane::Ground, CombatType::Damage));
    assert_eq!((scout.targeter, scout.radius()), (Targeter::Standard, 1.5));
}

#[test]
fn starting_energy_is_initial_energy() {
    let energy = |changes: &[(&str, &str)]| {
        let changes = [&[("energy", "200")], changes].concat();
        read(&changes).map(|unit_type| unit_type.initial_energy).map_err(|error| all(&error))
    };
    assert_eq!(energy(&[("initial_energy", "50")]), Ok(50.0));
    assert_eq!(energy(&[("starting_energy", "50")]), Ok(50.0));
    assert_eq!(energy(&[("starting_energy", "50"), ("initial_energy", "50")]), Ok(50.0));
    let differing = "`starting_energy` is 50, but must be 60, the value of its alias `initial_energy`";
    assert_eq!(energy(&[("starting_energy", "50"), ("initial_energy", "60")]), Err(differing.into()));
}

#[test]
fn targeters_with_their_parameters() {
    let targeter = |word, kwargs| {
        read(&[("targeter", word), ("targeter_kwargs", kwargs)]).map(|unit_type| unit_type.targeter)
    };
    let kamikaze = targeter(r#""KAMIKAZE""#, r#"{"radius": 2}"#);
    assert_eq!(kamikaze, Ok(Targeter::Kamikaze { radius: 2.0 }));
    let laser = targeter(r#""LASER_BEAM""#, r#"{"height": 1, "width": 2}"#);
    assert_eq!(laser, Ok(Targeter::LaserBeam { width: 2.0, height: 1.0 }));
    assert_eq!(targeter(r#""STANDARD""#, "{}"), Ok(Targeter::Standard));
    let healer = read(&[("targeter", r#""HEAL""#), ("combat_type", r#""HEALING""#)]).unwrap();
    assert!(healer.is_healer());
}

#[test]
fn errors_say_what_is_accepted() {
    for row in messages::rows("Unit files") {
        let text = messages::file(&messages::valid("Unit files"), &messages::changes(&row[0]));
        let problems = UnitType::from_json(&text, "scout", "scout.json").expect_err(&row[1]);
        assert_eq!(all(&problems), row[1], "{}", row[0]);
    }
}

#[test]
fn all_problems_of_a_file_are_found() {
    let changes = [
        ("hpp", "45"),
        ("speed", ""),
        ("size", "0"),
        ("initial_energy", "1"),
        ("bonuses", r#"{"ARMOURED": 5, "LIGHT": -1}"#),
        ("attributes", r#"["LIGT", 3, "LIGHT"]"#),
        ("targeter", r#""LASER_BEAM""#),
        ("targeter_kwargs", r#"{"width": "wide"}"#),
        ("combat_type", r#""HEALING""#),
        ("$schema", "1"),
    ];
    let mut paths: Vec<String> =
        read(&changes).unwrap_err().list().iter().map(|problem| problem.path.clone()).collect();
    paths.sort();
    let expected = [
        "$schema",
        "attributes[0]",
        "attributes[1]",
        "bonuses.ARMOURED",
        "bonuses.LIGHT",
        "hpp",
        "initial_energy",
        "size",
        "speed",
        "targeter",
        "targeter_kwargs.height",
        "targeter_kwargs.width",
    ];
    assert_eq!(paths, expected);
}

#[test]
fn problems_are_where_the_mistake_is() {
    // A missing key is at its object, an unknown or duplicate one at the key, a wrong value at the value.
    // Columns are characters; a byte order mark is none.
    let text = r#"{
  "hp": 45,
  "ö": 1, "armor": -1,
  "damage": 6, "damage": 7,
  "cooldown": 3, "speed": 3, "attack_range": 3, "size": 3,
  "attributes": [
    "LIGHT",
    "HEAVY"
  ],
  "targeter": "KAMIKAZE", "targeter_kwargs":
    {}
}
"#;
    let text = &format!("\u{feff}{text}");
    let problems = UnitType::from_json(text, "scout", "scout.json").unwrap_err();
    let found: Vec<_> = problems
        .list()
        .iter()
        .map(|problem| (problem.line.unwrap(), problem.column.unwrap(), problem.path.as_str()))
        .collect();
    let expected = [
        (1, 1, "valid_targets"),
        (3, 3, "ö"),
        (3, 20, "armor"),
        (4, 16, "damage"),
        (8, 5, "attributes[1]"),
        (11, 5, "targeter_kwargs.radius"),
    ];
    assert_eq!(found, expected);
    let first = problems.to_string().lines().next().map(str::to_owned);
    let message = "scout.json:1:1: `valid_targets` is missing; it must be a list of keywords out of GROUND, \
                   AIR, COLOSSUS";
    assert_eq!(first.as_deref(), Some(message));
}

/// A file of 8 MiB can have a million problems.
#[test]
fn a_hundred_problems_are_enough() {
    let attributes = format!("[{}]", vec!["1"; 10_000].join(","));
    let problems = read(&[("attributes", &attributes)]).unwrap_err();
    assert_eq!((problems.list().len(), problems.n_problems()), (100, 10_000));
    let text = problems.to_string();
    assert_eq!(text.lines().count(), 101);
    assert!(text.ends_with("\nscout.json: and 9900 more problems"));
}

/// `{"hp": 45,}` was "key must be a string", a comment "expected value": the words of a parser, which never
/// name what people do wrong when they write JSON by hand.
#[test]
fn syntax_errors_say_what_to_change() {
    for row in messages::rows("What is no JSON") {
        let text = if row[0] == "nothing" { String::new() } else { messages::code(&row[0]) };
        let problems = UnitType::from_json(&text, "scout", "scout.json").expect_err(&row[1]);
        assert_eq!(problems.to_string(), format!("scout.json:{}", row[1]), "{}", row[0]);
    }
}

/// The stack of a reader that calls itself is limited.
#[test]
fn deep_nesting_is_refused() {
    let nested = |depth: usize| {
        let text = format!("{{\"hp\": {}{}}}", "[".repeat(depth), "]".repeat(depth));
        UnitType::from_json(&text, "deep", "deep.json").unwrap_err().to_string()
    };
    assert!(nested(127).starts_with("deep.json:1:1: `armor` is missing"));
    for depth in [128, 100_000] {
        assert_eq!(nested(depth), "deep.json:1:135: lists and objects are nested more than 128 deep");
    }
    let error = UnitType::from_json(&"[".repeat(100_000), "deep", "deep.json").unwrap_err().to_string();
    assert_eq!(error, "deep.json:1:100001: the file ends, but `[` of line 1 is not closed");
}

#[test]
fn a_file_names_its_type() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long_scout.json");
    // Some editors on Windows start a file with a byte order mark.
    std::fs::write(&path, format!("\u{feff}{}", file(&[]))).unwrap();
    assert_eq!(UnitType::load(&path).unwrap().name, "long_scout");

    let error = UnitType::load(folder.path()).unwrap_err().to_string();
    assert!(error.ends_with("cannot be read: it is a folder, not a file"), "{error}");
    let error = UnitType::load(&folder.path().join("missing.json")).unwrap_err().to_string();
    assert!(error.contains("missing.json: cannot be read: No such file"), "{error}");
}

/// A key of 3 MB once cost 1.8 s of edit distances and made a message of 3 MB; a value, a name or a path can
/// be as long.
#[test]
fn messages_are_short_lines_whatever_a_file_holds() {
    let long = "long\nkey".repeat(400_000);
    let escaped = long.replace('\n', "\\n");
    let shown = "long?key".repeat(400_000)[..60].to_owned() + "...";
    let quoted = format!("\"{escaped}\"");
    let cases: [(&[(&str, &str)], String); 3] = [
        (&[(&escaped, "45")], format!("unknown key `{shown}`; expected one of $schema, hp, ")),
        (&[("plane", &quoted)], format!("`plane` is \"{shown}\", but must be one of GROUND, ")),
        (&[(&escaped, "1"), (&escaped, "2"), (&escaped, "3")], format!("key `{shown}` is duplicate")),
    ];
    for (changes, message) in cases {
        let problems = read(changes).unwrap_err();
        let error = &problems.list().last().unwrap().message;
        let beginning: String = error.chars().take(200).collect();
        assert!(error.starts_with(&message), "{beginning}");
        assert!(error.len() < 800 && !error.contains('\n'), "{} bytes: {beginning}", error.len());
    }
    let path = format!("nowhere/{long}.json");
    let error = UnitType::load(path.as_ref()).unwrap_err().to_string();
    assert!(error.len() < 500 && error.contains("key.json: cannot be read: "), "{} bytes", error.len());
}

/// Files that are not regular were read to their end: `check /dev/zero` filled the memory, and a FIFO waited
/// for a writer.
#[test]
fn only_files_of_a_limited_size_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.json");
    std::fs::File::create(&path).unwrap().set_len(10 << 30).unwrap();
    let error = UnitType::load(&path).unwrap_err().to_string();
    assert!(error.ends_with("cannot be read: it is larger than 64 KiB"), "{error}");

    for device in ["/dev/zero", "/dev/full"] {
        let error = UnitType::load(device.as_ref()).unwrap_err().to_string();
        assert_eq!(error, format!("{device}: cannot be read: it is not a regular file"));
    }
}
