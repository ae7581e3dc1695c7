//! The zoo: trained teams that are part of the program, one for each standard scenario that flat
//! networks win, and `all-maps`, which plays every scenario. `just results-zoo` makes its files.
//!
//! A team is called `zoo:SCENARIO`, or `zoo:all-maps`, wherever the folder of a run stands for its team. Its
//! files are those of a run that others read (`run.json`, `best.safetensors`), and a card; without
//! evaluations and a checkpoint, it can be neither reported, verified nor resumed.

use std::path::{Path, PathBuf, is_separator};

/// What the names of teams in the zoo begin with.
pub(crate) const PREFIX: &str = "zoo:";

/// The files of a team.
struct Files {
    name: &'static str,
    run: &'static [u8],
    best: &'static [u8],
    card: &'static [u8],
}

macro_rules! teams {
    ($($name:literal)*) => {
        &[$(Files {
            name: $name,
            run: include_bytes!(concat!("../zoo/", $name, "/run.json")),
            best: include_bytes!(concat!("../zoo/", $name, "/best.safetensors")),
            card: include_bytes!(concat!("../zoo/", $name, "/card.json")),
        }),*]
    };
}

/// In the order of their names.
const TEAMS: &[Files] = teams! {
    "10m_vs_11m"
    "1c3s5z"
    "25m"
    "27m_vs_30m"
    "2c_vs_64zg"
    "2s3z"
    "2s_vs_1sc"
    "3m"
    "3s5z"
    "3s5z_vs_3s6z"
    "3s_vs_3z"
    "3s_vs_4z"
    "3s_vs_5z"
    "5m_vs_6m"
    "8m"
    "8m_vs_9m"
    "MMM"
    "MMM2"
    "all-maps"
    "bane_vs_bane"
    "corridor"
};

/// What the teams of the zoo are called: by their scenarios, and `all-maps`.
pub fn zoo_teams() -> impl Iterator<Item = &'static str> {
    TEAMS.iter().map(|team| team.name)
}

/// What stands for the folder of a team.
pub(crate) fn folder(scenario: &str) -> PathBuf {
    PathBuf::from(format!("{PREFIX}{scenario}"))
}

/// Whether a text that can also be something else, as the name of a script, names a trained team: the folder
/// of a run, or a team of the zoo. Its mistakes are found where it is read.
pub fn names_team(text: &str) -> bool {
    text.starts_with(PREFIX) || text.contains(is_separator) || Path::new(text).is_dir()
}

/// The file of a team with this path, as `zoo:3m/run.json`.
pub(crate) fn zoo_file(path: &Path) -> Option<&'static [u8]> {
    let (name, file) = path.to_str()?.strip_prefix(PREFIX)?.split_once(is_separator)?;
    let team = TEAMS.iter().find(|team| team.name == name)?;
    match file {
        "run.json" => Some(team.run),
        "best.safetensors" => Some(team.best),
        "card.json" => Some(team.card),
        _ => None,
    }
}

/// That the zoo has a team of this name, for an error that found none.
pub(crate) fn zoo_hint(folder: &Path) -> String {
    match zoo_teams().find(|name| folder == Path::new(name)) {
        Some(name) => format!("; the team of the zoo is `{PREFIX}{name}`"),
        None => String::new(),
    }
}

/// The name of a team that the zoo does not have, if this folder is called so.
pub(crate) fn missing(folder: &Path) -> Option<&str> {
    let name = folder.to_str()?.strip_prefix(PREFIX)?;
    (!zoo_teams().any(|team| team == name)).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_teams_of_the_folder_are_in_the_program() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("zoo");
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort_unstable();
        assert!(zoo_teams().eq(names));
    }

    #[test]
    fn paths_below_zoo_are_files_of_teams() {
        assert!(zoo_file(&folder("3m").join("run.json")).is_some());
        for path in ["zoo:3m", "zoo:3m/log.csv", "zoo:4m/run.json", "3m/run.json", "zoo:/run.json"] {
            assert_eq!(zoo_file(Path::new(path)), None, "{path}");
        }
    }
}
