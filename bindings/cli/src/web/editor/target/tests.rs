//! Saving: which files are written, and which are not.

use super::*;
use std::fs;
use tempfile::TempDir;

const SCOUT: &str = r#"{"hp": 45, "armor": 0, "damage": 6, "cooldown": 1, "speed": 3, "attack_range": 3,
    "size": 1, "attributes": [], "valid_targets": ["GROUND"]}"#;

/// A folder with s.json and its unit file scout.json.
fn folder() -> (TempDir, Start) {
    let folder = tempfile::tempdir().unwrap();
    let (_, files) = ScenarioFiles::resolve("2s3z").unwrap();
    let text = files.text.replace("\"STALKER\": 2", "\"scout\": 2").replace("\"STALKER\": 0", "\"scout\": 0");
    fs::write(folder.path().join("s.json"), text).unwrap();
    fs::write(folder.path().join("scout.json"), SCOUT).unwrap();
    let start = Start::of(folder.path().join("s.json").to_str().unwrap()).unwrap();
    (folder, start)
}

/// What a page that has just opened the files sends to save them.
fn opened(start: &Start) -> SaveFiles {
    let OpenedFiles { files, base, .. } = start.open().unwrap();
    SaveFiles { files, base, replace: false }
}

/// The files that are written, and what the page knows of them then.
fn saved(start: &Start, save: SaveFiles) -> (Vec<String>, Base) {
    match start.save(save).unwrap() {
        SavedFiles::Saved { files, base } => (files, base),
        SavedFiles::Conflicts(files) => panic!("{files:?} were changed"),
    }
}

/// The names of files that were changed since.
fn conflicts(start: &Start, save: SaveFiles) -> Vec<String> {
    match start.save(save).unwrap() {
        SavedFiles::Conflicts(files) => {
            files.iter().map(|file| file.rsplit('/').next().unwrap().to_owned()).collect()
        }
        SavedFiles::Saved { files, .. } => panic!("{files:?} were written"),
    }
}

fn unit(name: &str) -> UnitFile {
    UnitFile { name: name.into(), keys: vec![name.into()], text: SCOUT.into() }
}

fn names(folder: &TempDir) -> Vec<String> {
    let entries = fs::read_dir(folder.path()).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().to_str().unwrap().to_owned()).collect();
    names.sort();
    names
}

/// It was named after the file, and not valid.
#[test]
fn a_new_scenario_whose_file_has_a_long_name_is_valid() {
    let folder = tempfile::tempdir().unwrap();
    for (stem, name) in [("mine", "mine"), (&"x".repeat(101)[..], "new_scenario")] {
        let start = Start::of(folder.path().join(format!("{stem}.json")).to_str().unwrap()).unwrap();
        assert_eq!(opened(&start).files.scenario().unwrap().name, name);
    }
}

#[test]
fn only_what_changed_is_written() {
    let (folder, start) = folder();
    let mut save = opened(&start);
    let files = &mut save.files;
    assert_eq!((files.unit_files.len(), files.unit_files[0].text.as_str()), (1, SCOUT));
    assert_eq!(files.unit_files[0].keys, ["scout"]);
    files.text += "\n";
    files.unit_files.push(unit("medic"));
    let text = files.text.clone();
    assert_eq!(saved(&start, save).0.len(), 2);
    assert_eq!(names(&folder), ["medic.json", "s.json", "scout.json"]);
    assert_eq!(fs::read_to_string(folder.path().join("s.json")).unwrap(), text);
    assert_eq!(saved(&start, opened(&start)).0, [""; 0]);
}

#[test]
fn an_invalid_file_is_opened_and_saved() {
    let (folder, start) = folder();
    fs::write(folder.path().join("s.json"), "{ \"groups\": [").unwrap();
    let mut save = opened(&start);
    assert_eq!((save.files.text.as_str(), save.files.unit_files.len()), ("{ \"groups\": [", 0));
    save.files.text += "]";
    saved(&start, save);
    fs::write(folder.path().join("scout.json"), "{").unwrap();
    fs::write(folder.path().join("s.json"), r#"{"groups": [3, {"units": {"scout": 1}}]}"#).unwrap();
    assert_eq!(opened(&start).files.unit_files[0].text, "{");
}

#[test]
fn a_file_that_another_program_changed_is_not_replaced_unasked() {
    let (folder, start) = folder();
    let edited = || {
        let mut save = opened(&start);
        save.files.text += "\n";
        save
    };
    let save = edited();
    fs::write(folder.path().join("s.json"), "{}").unwrap();
    assert_eq!(conflicts(&start, save), ["s.json"]);
    assert_eq!(fs::read_to_string(folder.path().join("s.json")).unwrap(), "{}");
    let mut save = opened(&start);
    save.files.text = "{ }".into();
    fs::write(folder.path().join("s.json"), "{  }").unwrap();
    saved(&start, SaveFiles { replace: true, ..save });
    assert_eq!(fs::read_to_string(folder.path().join("s.json")).unwrap(), "{ }");

    // A file that exists but is not of this scenario.
    fs::write(folder.path().join("medic.json"), "mine").unwrap();
    let mut save = edited();
    save.files.unit_files.push(unit("medic"));
    assert_eq!(conflicts(&start, save), ["medic.json"]);
}

/// What one page saved was known to the whole program, so that another page replaced it unasked; so did a
/// page that was open when the files were opened again, and one of an earlier run of the program.
#[test]
fn a_page_does_not_replace_what_was_saved_since_it_opened_the_files() {
    let (folder, start) = folder();
    let path = folder.path().join("s.json");
    let edited = |save: &SaveFiles, by: &str| {
        let files = ScenarioFiles { text: save.files.text.clone() + by, ..save.files.clone() };
        SaveFiles { files, base: save.base.clone(), replace: false }
    };
    let (one, other) = (opened(&start), opened(&start));
    let (_, base) = saved(&start, edited(&other, "\n"));
    assert_eq!(conflicts(&start, edited(&one, " ")), ["s.json"]);
    let again = SaveFiles { base, ..edited(&other, "\n\n") };
    let (_, base) = saved(&start, again); // the page knows what it has saved itself

    fs::write(&path, "{}").unwrap();
    opened(&start);
    assert_eq!(conflicts(&start, SaveFiles { base: base.clone(), ..edited(&other, " ") }), ["s.json"]);
    let restarted = Start::of(path.to_str().unwrap()).unwrap();
    assert_eq!(conflicts(&restarted, SaveFiles { base, ..edited(&other, " ") }), ["s.json"]);
    assert_eq!(fs::read_to_string(path).unwrap(), "{}");
}

/// A unit type of the scenario's own name was written to the scenario file, and then replaced by the
/// scenario.
#[test]
fn two_files_are_not_written_to_one() {
    let (folder, start) = folder();
    let before = fs::read_to_string(folder.path().join("s.json")).unwrap();
    std::os::unix::fs::symlink("scout.json", folder.path().join("link.json")).unwrap();
    for (name, written) in [("s", "s.json"), ("scout", "scout.json"), ("link", "scout.json")] {
        let SaveFiles { mut files, base, .. } = opened(&start);
        files.text += "\n";
        files.unit_files.push(UnitFile { keys: Vec::new(), text: "{}".into(), ..unit(name) });
        for replace in [false, true] {
            let save = SaveFiles { files: files.clone(), base: base.clone(), replace };
            let error = start.save(save).unwrap_err().to_string();
            assert!(error.starts_with(&format!("the unit type `{name}` would be written to")), "{error}");
            assert!(error.contains(written) && error.ends_with("rename it"), "{error}");
        }
        assert_eq!(fs::read_to_string(folder.path().join("s.json")).unwrap(), before);
        assert_eq!(fs::read_to_string(folder.path().join("scout.json")).unwrap(), SCOUT);
    }
}

/// A unit file stayed where it was read, or went beside the scenario without the folder of its key: what was
/// saved was a scenario without its unit file, or with another one.
#[test]
fn unit_files_are_written_where_the_scenario_finds_them() {
    let (folder, start) = folder();
    let path = |name: &str| folder.path().join(name);
    let is_valid = || Scenario::load(&path("s.json")).is_ok();
    for custom in ["types", ".", "types/deeper"] {
        let mut save = opened(&start);
        let mut scenario: Value = serde_json::from_str(&save.files.text).unwrap();
        scenario["custom_unit_path"] = custom.into();
        save.files.text = scenario.to_string();
        let read = save.base.keys().find(|file| file.ends_with("scout.json")).unwrap();
        fs::remove_file(read).unwrap(); // beside the scenario it would be found
        saved(&start, save);
        assert!(path(custom).join("scout.json").is_file() && is_valid(), "{custom}");
    }

    let mut save = opened(&start);
    save.files.text = save.files.text.replace("\"scout\"", "\"units/scout\"");
    save.files.unit_files[0].keys = vec!["units/scout".into()];
    saved(&start, save);
    assert!(path("types/deeper/units/scout.json").is_file() && is_valid());

    // Another page opened a scenario without the unit type meanwhile.
    let mut one = opened(&start);
    fs::write(path("s.json"), ScenarioFiles::resolve("2s3z").unwrap().1.text).unwrap();
    opened(&start);
    one.files.unit_files[0].text += "\n";
    saved(&start, SaveFiles { replace: true, ..one });
    assert_eq!(fs::read_to_string(path("types/deeper/units/scout.json")).unwrap(), format!("{SCOUT}\n"));
}

#[test]
fn nothing_is_written_outside_the_folder() {
    let (folder, start) = folder();
    let outside = tempfile::tempdir().unwrap();
    let check = |change: &dyn Fn(&mut ScenarioFiles), expected: &str| {
        let mut save = opened(&start);
        change(&mut save.files);
        let error = start.save(SaveFiles { replace: true, ..save }).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
        assert_eq!(fs::read_dir(outside.path()).unwrap().count(), 0);
    };
    for name in ["../medic", "a/b", "/tmp/medic", "", ".hidden", "a\0b", &"x".repeat(101)] {
        check(&|files| files.unit_files.push(unit(name)), "unit type names must be");
    }
    let custom = |path: String| {
        move |files: &mut ScenarioFiles| {
            let mut scenario: Value = serde_json::from_str(&files.text).unwrap();
            scenario["custom_unit_path"] = path.clone().into();
            files.text = scenario.to_string();
            files.unit_files.push(unit("medic"));
        }
    };
    check(&custom("..".into()), "outside the folder");
    check(&custom(outside.path().to_str().unwrap().into()), "outside the folder");
    std::os::unix::fs::symlink(outside.path(), folder.path().join("link")).unwrap();
    check(&custom("link".into()), "outside the folder");
    check(&custom("link/deeper".into()), "outside the folder");
    let elsewhere = tempfile::NamedTempFile::new().unwrap();
    std::os::unix::fs::symlink(elsewhere.path(), folder.path().join("medic.json")).unwrap();
    check(&|files| files.unit_files.push(unit("medic")), "outside the folder");
    assert_eq!(fs::read_to_string(elsewhere.path()).unwrap(), "");
    fs::remove_file(folder.path().join("medic.json")).unwrap();

    let mut save = opened(&start);
    custom("units/mine".into())(&mut save.files);
    saved(&start, save);
    assert_eq!(fs::read_to_string(folder.path().join("units/mine/medic.json")).unwrap(), SCOUT);
}

#[test]
fn what_is_edited_is_a_file_or_a_standard_scenario() {
    let error = |name: &str| Start::of(name).err().unwrap().to_string();
    assert!(error("2s3y").contains("neither a standard scenario"), "{}", error("2s3y"));
    assert!(error("/nowhere/s.json").starts_with("/nowhere: "), "{}", error("/nowhere/s.json"));
    assert!(error("/proc").contains("it is a folder, not a file"), "{}", error("/proc"));
    let standard = Start::of("2s3z").unwrap();
    assert_eq!(standard.open().unwrap().files.source, "2s3z.json");
    let error = standard.save(opened(&standard)).unwrap_err();
    assert!(error.to_string().contains("download"), "{error}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new.json");
    let start = Start::of(path.to_str().unwrap()).unwrap();
    let opened = start.open().unwrap();
    assert!(!opened.exists);
    let text = &opened.files.text;
    assert_eq!(Scenario::from_json(text, "new.json", "".as_ref()).unwrap().name, "new");
    let files = ScenarioFiles { source: "new.json".into(), text: "{}".into(), unit_files: Vec::new() };
    saved(&start, SaveFiles { files, base: Base::new(), replace: false });
    assert_eq!(fs::read_to_string(path).unwrap(), "{}");
}
