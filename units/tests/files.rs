//! Custom unit files: what is accepted, and the message for everything that is refused.

use smaclite_units::{CombatType, Plane, Problems, Targeter, UnitType};

/// A valid file; each case puts further lines before the required ones or replaces one of them.
const REQUIRED: [(&str, &str); 9] = [
    ("hp", "45"),
    ("armor", "0"),
    ("damage", "6"),
    ("cooldown", "3"),
    ("speed", "3.15"),
    ("attack_range", "3"),
    ("size", "3"),
    ("attributes", r#"["LIGHT"]"#),
    ("valid_targets", r#"["GROUND", "AIR"]"#),
];

/// The valid file with `changes`, lines of `"key": value`; an empty value leaves the key out.
fn file(changes: &[(&str, &str)]) -> String {
    let changed = |key: &str| changes.iter().any(|(name, _)| *name == key);
    let kept = REQUIRED.iter().filter(|(key, _)| !changed(key));
    let entries: Vec<String> = kept
        .chain(changes.iter().filter(|(_, value)| !value.is_empty()))
        .map(|(key, value)| format!("\"{key}\": {value}"))
        .collect();
    format!("{{{}}}", entries.join(", "))
}

fn read(changes: &[(&str, &str)]) -> Result<UnitType, Problems> {
    UnitType::from_json(&file(changes), "scout", "scout.json")
}

/// The messages of all problems, without their positions.
fn messages(problems: &Problems) -> Vec<&str> {
    assert_eq!(problems.list().len(), problems.n_problems());
    problems.list().iter().map(|problem| problem.message.as_str()).collect()
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
        read(&changes).map(|unit_type| unit_type.initial_energy).map_err(|error| messages(&error).join("; "))
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

/// Changes of the file, and the message of its problem.
type Case<'a> = (&'a [(&'a str, &'a str)], &'a str);

#[test]
fn errors_say_what_is_accepted() {
    let cases: &[Case] = &[
        (&[("hpp", "45")], "unknown key `hpp`; did you mean `hp`?"),
        (&[("attack_rnage", "3")], "unknown key `attack_rnage`; did you mean `attack_range`?"),
        (&[("hp", "")], "`hp` is missing; it must be a number from 0.001 to 1000000"),
        (
            &[("valid_targets", "")],
            "`valid_targets` is missing; it must be a list of keywords out of GROUND, AIR, COLOSSUS",
        ),
        (&[("hp", "0")], "`hp` is 0, but must be a number from 0.001 to 1000000"),
        (&[("hp", "\"45\"")], "`hp` is \"45\", but must be a number from 0.001 to 1000000"),
        (&[("hp", "null")], "`hp` is null, but must be a number from 0.001 to 1000000"),
        (&[("hp", "1e300")], "`hp` is 1e300, but must be a number from 0.001 to 1000000"),
        (&[("speed", "-3.15")], "`speed` is -3.15, but must be a number from 0 to 1000000"),
        (
            &[("explodes_when_killed", "true")],
            "`explodes_when_killed` is true, but must be false, because only units with targeter KAMIKAZE \
             explode",
        ),
        (
            &[("min_random_delay", "0.1")],
            "`max_random_delay` is missing; it must be at least `min_random_delay`, which is 0.1",
        ),
        (&[("size", "2000")], "`size` is 2000, but must be a number from 0.001 to 1024"),
        (&[("attacks", "1.5")], "`attacks` is 1.5, but must be a whole number from 1 to 1000"),
        (&[("attacks", "0")], "`attacks` is 0, but must be a whole number from 1 to 1000"),
        (
            &[("attack_range", "\"MELE\"")],
            "`attack_range` is \"MELE\", but must be a number from 0 to 1000000 or \"MELEE\"",
        ),
        (
            &[("energy", "10"), ("initial_energy", "20")],
            "`initial_energy` is 20, but must be at most `energy`, which is 10",
        ),
        (&[("plane", "\"WATER\"")], "`plane` is \"WATER\", but must be one of GROUND, AIR, COLOSSUS"),
        (
            &[("plane", "\"ground\"")],
            "`plane` is \"ground\", but must be one of GROUND, AIR, COLOSSUS; did you mean `GROUND`?",
        ),
        (&[("plane", "1")], "`plane` is 1, but must be one of GROUND, AIR, COLOSSUS"),
        (
            &[("valid_targets", r#"["GROUND", "ARI"]"#)],
            "`valid_targets[1]` is \"ARI\", but must be one of GROUND, AIR, COLOSSUS; did you mean `AIR`?",
        ),
        (&[("valid_targets", "\"AIR\"")], "`valid_targets` is \"AIR\", but must be a list"),
        (&[("bonuses", r#"{"ARMOURED": 5}"#)], "unknown key `bonuses.ARMOURED`; did you mean `ARMORED`?"),
        (
            &[("bonuses", r#"{"ARMORED": -5}"#)],
            "`bonuses.ARMORED` is -5, but must be a number from 0 to 1000000",
        ),
        (
            &[("targeter", "\"KAMIKAZI\"")],
            "`targeter` is \"KAMIKAZI\", but must be one of STANDARD, KAMIKAZE, LASER_BEAM, HEAL; \
             did you mean `KAMIKAZE`?",
        ),
        (
            &[("targeter", "\"LASER_BEAM\"")],
            "`targeter_kwargs` is missing; it must be an object with `width` and `height` for targeter \
             LASER_BEAM",
        ),
        (
            &[("targeter", "\"KAMIKAZE\""), ("targeter_kwargs", r#"{"radius": 2, "radus": 2}"#)],
            "unknown key `targeter_kwargs.radus`; did you mean `radius`?",
        ),
        (
            &[("targeter", "\"KAMIKAZE\""), ("targeter_kwargs", "{}")],
            "`targeter_kwargs.radius` is missing; it must be a number from 0 to 1000000",
        ),
        (
            &[("targeter_kwargs", r#"{"radius": 2}"#)],
            "`targeter_kwargs` is an object of size 1, but must be left out: \
             targeter STANDARD has no parameters",
        ),
        (
            &[("combat_type", "\"HEALING\"")],
            "`targeter` is missing; it must be HEAL, because `combat_type` is HEALING",
        ),
        (
            &[("targeter", "\"HEAL\"")],
            "`combat_type` is missing; it must be HEALING, because `targeter` is HEAL",
        ),
        (
            &[("combat_type", "\"HEALING\""), ("targeter", "\"STANDARD\"")],
            "`targeter` is \"STANDARD\", but must be HEAL, because `combat_type` is HEALING",
        ),
    ];
    for (changes, message) in cases {
        assert_eq!(messages(&read(changes).expect_err(message)), [*message]);
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

#[test]
fn text_that_is_not_a_unit() {
    let cases = [
        ("1", "1:1: the whole file is 1, but must be an object, { ... }"),
        (" []", "1:2: the whole file is a list of length 0, but must be an object, { ... }"),
        ("{\"hp\": 1e400}", "1:8: number out of range"),
        ("{\"hp\": \"\\ud800\"}", "1:8: unexpected end of hex escape"),
    ];
    check_texts(&cases);
}

fn check_texts(cases: &[(&str, &str)]) {
    let error = |text: &str| UnitType::from_json(text, "scout", "scout.json").unwrap_err().to_string();
    let wrong = cases.iter().filter(|(text, message)| error(text) != format!("scout.json:{message}"));
    let wrong: Vec<String> =
        wrong.map(|(text, message)| format!("{text}: expected {message}, got {}", error(text))).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// `{"hp": 45,}` was "key must be a string", a comment "expected value": the words of a parser, which never
/// name what people do wrong when they write JSON by hand.
#[test]
fn syntax_errors_say_what_to_change() {
    let double = "strings are written in double quotes, as \"name\"";
    let string = "a string must end in its line: `\"` is missing, or a line break must be written `\\n`";
    check_texts(&[
        ("{\"hp\": 45,\n}", "2:1: remove the comma before `}`"),
        ("{\"attributes\": [1, ]}", "1:20: remove the comma before `]`"),
        ("{\"hp\": 45 // health\n}", "1:11: JSON has no comments; remove this one"),
        ("{ /* health */ \"hp\": 45}", "1:3: JSON has no comments; remove this one"),
        ("{}\n// a marine", "2:1: JSON has no comments; remove this one"),
        ("# a marine\n{}", "1:1: JSON has no comments; remove this one"),
        ("{'hp': 45}", &format!("1:2: {double}")),
        ("{\"plane\": “AIR”}", &format!("1:11: {double}")),
        ("{\"ä\": NaN}", "1:7: JSON has no number `NaN`"),
        ("{\"hp\": -Infinity}", "1:9: JSON has no number `-Infinity`"),
        ("{\"hp\": nan}", "1:9: JSON has no number `nan`"),
        ("{\"hp\": True}", "1:8: write `true` instead of `True`"),
        ("{\"hp\": None}", "1:8: write `null` instead of `None`"),
        ("{\"hp\": .5}", "1:8: `.5` is no number of JSON; those are written as 12, -0.5 or 1e6"),
        ("{\"hp\": 0x1F}", "1:9: `0x1F` is no number of JSON; those are written as 12, -0.5 or 1e6"),
        ("{\"hp\": 1.}", "1:10: `1.` is no number of JSON; those are written as 12, -0.5 or 1e6"),
        ("{\"plane\": AIR}", "1:11: strings are written in double quotes, \"AIR\""),
        ("{hp: 45}", "1:2: keys are written in double quotes, \"hp\""),
        ("name: scout\nhp: 45\n", "1:2: keys are written in double quotes, \"name\""),
        ("{\"hp\": 45\n \"armor\": 0}", "2:2: a comma is missing before this"),
        ("{\"hp\" 45}", "1:7: `:` is missing between a key and its value"),
        ("{\"hp\": }", "1:8: expected a value, got `}`"),
        ("{\"hp\": 45)", "1:10: expected `,` or `}`, got `)`"),
        ("{\"plane\": \"AIR,\n\"hp\": 45}", &format!("1:15: {string}")),
        ("{\"path\": \"C:\\maps\"}", "1:14: after `\\` this is no escape; a backslash is written `\\\\`"),
        ("{\"hp\": 45}\n]", "2:1: the JSON value ends before this; a file holds only one"),
        ("", "1:1: the file is empty"),
        ("{\n", "2:1: the file ends, but `{` of line 1 is not closed"),
        ("{\n \"a\": [1,\n 2}", "3:3: expected `,` or `]`, got `}`"),
        ("{\"plane\": \"AI", "1:14: the file ends within the string that begins in line 1"),
    ]);
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
