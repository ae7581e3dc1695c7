//! Saving: which files are written, and which are not.

use super::*;
use smaclite_scenarios::UnitFile;
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

fn opened(start: &Start) -> ScenarioFiles {
    start.open().unwrap().files
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

#[test]
fn only_what_changed_is_written() {
    let (folder, start) = folder();
    let mut files = opened(&start);
    assert_eq!((files.unit_files.len(), files.unit_files[0].text.as_str()), (1, SCOUT));
    assert_eq!(files.unit_files[0].keys, ["scout"]);
    files.text += "\n";
    files.unit_files.push(unit("medic"));
    let text = files.text.clone();
    let saved = start.save(SaveFiles { files, replace: false }).unwrap();
    assert!(matches!(&saved, SavedFiles::Saved(files) if files.len() == 2), "{saved:?}");
    assert_eq!(names(&folder), ["medic.json", "s.json", "scout.json"]);
    assert_eq!(fs::read_to_string(folder.path().join("s.json")).unwrap(), text);
    assert_eq!(
        start.save(SaveFiles { files: opened(&start), replace: false }).unwrap(),
        SavedFiles::Saved(Vec::new())
    );
}

#[test]
fn an_invalid_file_is_opened_and_saved() {
    let (folder, start) = folder();
    fs::write(folder.path().join("s.json"), "{ \"groups\": [").unwrap();
    let mut files = opened(&start);
    assert_eq!((files.text.as_str(), files.unit_files.len()), ("{ \"groups\": [", 0));
    files.text += "]";
    start.save(SaveFiles { files, replace: false }).unwrap();
    fs::write(folder.path().join("scout.json"), "{").unwrap();
    fs::write(folder.path().join("s.json"), r#"{"groups": [3, {"units": {"scout": 1}}]}"#).unwrap();
    assert_eq!(opened(&start).unit_files[0].text, "{");
}

#[test]
fn a_file_that_another_program_changed_is_not_replaced_unasked() {
    let (folder, start) = folder();
    let edited = || {
        let mut files = opened(&start);
        files.text += "\n";
        files
    };
    let files = edited();
    fs::write(folder.path().join("s.json"), "{}").unwrap();
    let saved = start.save(SaveFiles { files, replace: false }).unwrap();
    assert!(matches!(&saved, SavedFiles::Conflicts(files) if files.len() == 1), "{saved:?}");
    assert_eq!(fs::read_to_string(folder.path().join("s.json")).unwrap(), "{}");
    let mut files = opened(&start);
    files.text = "{ }".into();
    fs::write(folder.path().join("s.json"), "{  }").unwrap();
    start.save(SaveFiles { files, replace: true }).unwrap();
    assert_eq!(fs::read_to_string(folder.path().join("s.json")).unwrap(), "{ }");

    // A file that exists but is not of this scenario.
    fs::write(folder.path().join("medic.json"), "mine").unwrap();
    let mut files = edited();
    files.unit_files.push(unit("medic"));
    let saved = start.save(SaveFiles { files, replace: false }).unwrap();
    assert!(matches!(&saved, SavedFiles::Conflicts(files) if files[0].ends_with("medic.json")), "{saved:?}");
}

/// A unit type of the scenario's own name was written to the scenario file, and then replaced by the
/// scenario.
#[test]
fn two_files_are_not_written_to_one() {
    let (folder, start) = folder();
    let before = fs::read_to_string(folder.path().join("s.json")).unwrap();
    std::os::unix::fs::symlink("scout.json", folder.path().join("link.json")).unwrap();
    for (name, written) in [("s", "s.json"), ("scout", "scout.json"), ("link", "link.json")] {
        let mut files = opened(&start);
        files.text += "\n";
        files.unit_files.push(UnitFile { keys: Vec::new(), text: "{}".into(), ..unit(name) });
        for replace in [false, true] {
            let save = SaveFiles { files: files.clone(), replace };
            let error = start.save(save).unwrap_err().to_string();
            assert!(error.starts_with(&format!("the unit type `{name}` would be written to")), "{error}");
            assert!(error.contains(written) && error.ends_with("rename it"), "{error}");
        }
        assert_eq!(fs::read_to_string(folder.path().join("s.json")).unwrap(), before);
        assert_eq!(fs::read_to_string(folder.path().join("scout.json")).unwrap(), SCOUT);
    }
}

#[test]
fn nothing_is_written_outside_the_folder() {
    let (folder, start) = folder();
    let outside = tempfile::tempdir().unwrap();
    let check = |change: &dyn Fn(&mut ScenarioFiles), expected: &str| {
        let mut files = opened(&start);
        change(&mut files);
        let error = start.save(SaveFiles { files, replace: true }).unwrap_err().to_string();
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

    let mut files = opened(&start);
    custom("units/mine".into())(&mut files);
    start.save(SaveFiles { files, replace: false }).unwrap();
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
    let error = standard.save(SaveFiles { files: opened(&standard), replace: true }).unwrap_err();
    assert!(error.to_string().contains("download"), "{error}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new.json");
    let start = Start::of(path.to_str().unwrap()).unwrap();
    let opened = start.open().unwrap();
    assert!(!opened.exists);
    let text = &opened.files.text;
    assert_eq!(Scenario::from_json(text, "new.json", "".as_ref()).unwrap().name, "new");
    let files = ScenarioFiles { source: "new.json".into(), text: "{}".into(), unit_files: Vec::new() };
    start.save(SaveFiles { files, replace: false }).unwrap();
    assert_eq!(fs::read_to_string(path).unwrap(), "{}");
}
