//! What a folder of a run says to others: `run.json`, and the weights of its team.

use crate::architecture::{Architecture, Inputs};
use crate::config::{Config, ConfigError, Enemies, NetworkKind};
use crate::lane_error::{UnequalUnits, check_equal_sides};
use crate::lanes::sizes_with_history;
use crate::team::{Network, OnScenario};
use crate::tensors::{FileError, exists, read, read_text, write};
use crate::weights::read_actor;
use crate::zoo;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use smaclite_engine::{BattleSetup, Opponents, Sizes};
use smaclite_scenarios::{Problems, ScenarioFiles};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// The last weights of a run, which others read.
pub(crate) const WEIGHTS: &str = "weights.safetensors";

/// Its best weights, if it was evaluated.
pub(crate) const BEST: &str = "best.safetensors";

/// Its evaluations while it trained.
pub(crate) const EVALUATIONS: &str = "evaluations.csv";

/// The folder, in that of a run, of the team that plays the enemies.
pub const OPPONENT: &str = "opponent";

/// The file by which a folder is known to be that of a run of `smaclite-pool train`, and of another learner.
pub const DESCRIPTIONS: [&str; 2] = ["run.json", "options.json"];

/// Files of results, and of what a run is continued from: nothing replaces or overlooks them.
const PRECIOUS: [&str; 3] = ["final.json", EVALUATIONS, "checkpoint.safetensors"];

/// The log of a run, which is empty until its first update.
pub(crate) const LOG: &str = "log.csv";

/// Whether a folder holds a run, which another one must not replace.
///
/// # Errors
/// If it holds one without its `run.json`.
pub fn holds_run(folder: &Path) -> Result<bool, FileError> {
    match folder.join(DESCRIPTIONS[0]).exists() {
        true => Ok(true),
        false => check_no_files(folder).map(|()| false),
    }
}

/// Refuses a folder that holds a run without a description. A search for runs would miss it.
///
/// # Errors
/// If it does.
pub fn refuse_undescribed(folder: &Path) -> Result<(), FileError> {
    let is_described = DESCRIPTIONS.iter().any(|name| folder.join(name).is_file());
    if is_described { Ok(()) } else { check_no_files(folder) }
}

/// What a process left that was killed while it began a run is nothing to keep: `run.json` is written last
/// then, and the empty log first.
fn check_no_files(folder: &Path) -> Result<(), FileError> {
    if fs::metadata(folder.join(LOG)).is_ok_and(|log| log.len() == 0) {
        return Ok(());
    }
    match PRECIOUS.into_iter().find(|name| folder.join(name).is_file()) {
        Some(found) => Err(FileError::Undescribed { folder: folder.to_owned(), found }),
        None => Ok(()),
    }
}

/// The contents of `run.json`.
#[derive(Serialize, Deserialize)]
struct RunFile {
    version: String,
    config: Config,
    #[serde(flatten)]
    setup: BattleSetup,
    /// The maps of the run but the first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    other_maps: Vec<BattleSetup>,
    /// The numbers of steps that the run was to make before it was resumed with others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    former_steps: Vec<u64>,
}

impl RunFile {
    fn of(run: &RunDescription) -> RunFile {
        let RunDescription { config, setup, other_maps, former_steps, .. } = run.clone();
        RunFile { version: env!("CARGO_PKG_VERSION").to_owned(), config, setup, other_maps, former_steps }
    }

    fn description(self) -> Result<RunDescription, OtherMap> {
        let RunFile { config, setup, other_maps, former_steps, .. } = self;
        config.check()?;
        config.check_maps(1 + other_maps.len())?;
        let run = RunDescription::checked::<OtherMap>(config, setup)?;
        Ok(RunDescription { other_maps, former_steps, ..run })
    }
}

/// What `run.json` says.
#[derive(Clone, Debug)]
pub struct RunDescription {
    /// The hyperparameters.
    pub config: Config,
    /// What the team plays, where scripts play the enemies: in a run in which teams play them, `attack_move`.
    pub setup: BattleSetup,
    /// The scenario's name.
    pub name: String,
    /// The sizes of its environments; `obs_size` includes the last actions.
    pub sizes: Sizes,
    /// What its networks are built for.
    pub(crate) inputs: Inputs,
    /// What the team was trained on besides.
    pub other_maps: Vec<BattleSetup>,
    /// The numbers of steps by which it was trained before that of `config`.
    pub former_steps: Vec<u64>,
}

impl RunDescription {
    /// Reads the description of the run in a folder.
    ///
    /// # Errors
    /// If it cannot be read or is not valid.
    pub fn read(folder: &Path) -> Result<RunDescription, FileError> {
        RunDescription::read_with_text(folder).map(|(run, _)| run)
    }

    /// The same with the text of its file.
    pub(crate) fn read_with_text(folder: &Path) -> Result<(RunDescription, Vec<u8>), FileError> {
        let path = folder.join("run.json");
        if let Some(name) = zoo::missing(folder) {
            return Err(FileError::NotInZoo { name: name.to_owned() });
        }
        if !exists(&path) {
            return Err(FileError::NoRun { folder: folder.to_owned() });
        }
        let text = read(&path)?;
        let run = RunDescription::from_json(&text).map_err(|why| FileError::Damaged { path, why })?;
        Ok((run, text))
    }

    /// The same as a text.
    pub(crate) fn to_json(&self) -> Vec<u8> {
        serde_json::to_vec(&RunFile::of(self)).expect("all of its keys are text")
    }

    /// The run of such a text, or why it is none.
    pub(crate) fn from_json(text: &[u8]) -> Result<RunDescription, String> {
        let file: RunFile = serde_json::from_slice(text).map_err(|error| error.to_string())?;
        file.description().map_err(|error| error.to_string())
    }

    pub(crate) fn new(config: Config, setup: BattleSetup) -> Result<RunDescription, Problems> {
        let (scenario, arena) = setup.arena()?;
        let sizes = sizes_with_history(arena.sizes(), config.last_actions);
        let inputs = Inputs::new(&setup.rules.figures(&scenario), sizes, config.last_actions);
        let (name, other_maps, former_steps) = (scenario.name, Vec::new(), Vec::new());
        Ok(RunDescription { config, setup, name, sizes, inputs, other_maps, former_steps })
    }

    /// The same, if the networks know the observations.
    fn checked<E: From<ConfigError> + From<Problems>>(config: Config, setup: BattleSetup) -> Result<Self, E> {
        let run = RunDescription::new(config, setup)?;
        run.inputs.check(&run.config)?;
        Ok(run)
    }

    /// In what this run differs from the expected one, besides hyperparameters of these names.
    /// For messages, as [`BattleSetup::differences`].
    pub(crate) fn differences(&self, expected: &RunDescription, besides: &[&str]) -> String {
        let of_maps = self.setups().zip(expected.setups()).map(|(given, expected)| {
            let source = expected.files.source.clone(); // where a file was is no difference
            let files = ScenarioFiles { source: source.clone(), ..given.files.clone() };
            match (BattleSetup { files, ..given.clone() }).differences(expected) {
                part if part.is_empty() || self.map_count() == 1 => part,
                part => format!("{part} of map `{source}`"),
            }
        });
        let mut parts: Vec<String> = of_maps.filter(|part| !part.is_empty()).collect();
        let [given, expected] = [self, expected].map(|run| {
            let mut values = serde_json::to_value(&run.config).unwrap_or_default();
            values["maps"] = run.map_count().into();
            values
        });
        let names = [&given, &expected].into_iter().filter_map(Value::as_object).flat_map(Map::keys);
        let names: BTreeSet<&str> = names.map(String::as_str).collect();
        for name in
            names.into_iter().filter(|name| !besides.contains(name) && given[*name] != expected[*name])
        {
            parts.push(format!("{name} ({} instead of {})", given[name], expected[name]));
        }
        parts.join(", ")
    }

    /// The network of the team's policy, as files have it.
    pub(crate) fn actor(&self) -> Architecture {
        let [actor, _] = Architecture::stored(&self.config, &self.inputs);
        actor
    }

    /// Reads a file with weights of the team's policy.
    ///
    /// # Errors
    /// If it cannot be read, is damaged, or is of another network.
    pub fn read_actor(&self, path: &Path) -> Result<Network, FileError> {
        read_actor(path, self.actor())
    }

    /// The network that plays the scenario, from that of the files.
    pub(crate) fn playing(&self, stored: Network) -> Network {
        match OnScenario::new(&self.config, &self.inputs) {
            None => stored,
            Some(on_scenario) => on_scenario.into_actor(&stored),
        }
    }

    /// The same run on a map: one that it was trained on, or, for a team whose networks fit every scenario,
    /// another one. The enemies are played by the scripts of the training on this map; on another one by
    /// those that the training was given, or else by the map's own.
    ///
    /// # Errors
    /// If the networks fit its own alone, or the scenario has other features than the standard maps.
    pub fn on(&self, map: BattleSetup) -> Result<RunDescription, OtherMap> {
        let scenario = map.files.scenario()?;
        let trained = self.setups().find(|trained| {
            trained.rules == map.rules && trained.files.scenario().is_ok_and(|other| other == scenario)
        });
        if self.config.network != NetworkKind::Universal && trained.is_none() {
            return Err(OtherMap::NotUniversal(self.name.clone()));
        }
        let given =
            Some(&self.setup).filter(|setup| setup.opponents != Opponents::of(&setup.files, setup.sides));
        let opponents = trained.or(given).unwrap_or(&map).opponents.clone();
        self.of_map(BattleSetup { opponents, ..map })
    }

    /// The team on one map.
    fn of_map<E: From<ConfigError> + From<Problems>>(&self, map: BattleSetup) -> Result<RunDescription, E> {
        RunDescription::checked(Config { map_weights: Vec::new(), ..self.config.clone() }, map)
    }

    /// What the team was trained on: its first map and the others.
    pub fn setups(&self) -> impl Iterator<Item = &BattleSetup> {
        [&self.setup].into_iter().chain(&self.other_maps)
    }

    /// How many maps that are.
    pub fn map_count(&self) -> usize {
        1 + self.other_maps.len()
    }

    /// The run on each of its maps, in their order.
    ///
    /// # Errors
    /// If a scenario is not valid, or the networks do not know its observations.
    pub fn on_each_map(&self) -> Result<Vec<RunDescription>, OtherMap> {
        let one = |setup: &BattleSetup| {
            let run = self.of_map::<OtherMap>(setup.clone())?;
            Ok(RunDescription { former_steps: self.former_steps.clone(), ..run })
        };
        self.setups().map(one).collect()
    }

    /// The run with which its team plays the enemies of these battles: on them, if its networks fit every
    /// scenario.
    pub(crate) fn playing_enemies_of<E>(self, folder: &Path, setup: &BattleSetup) -> Result<RunDescription, E>
    where
        E: From<UnequalUnits> + From<ConfigError> + From<Problems>,
    {
        if self.config.network != NetworkKind::Universal {
            return Ok(self);
        }
        check_equal_sides(folder, &setup.files.scenario()?)?;
        self.of_map(setup.clone())
    }

    /// What the lanes of the run play, on its first map.
    pub fn lanes_setup(&self) -> BattleSetup {
        self.config.enemies.setup(&self.setup)
    }

    /// What they play on each of its maps, in their order.
    pub fn lanes_setups(&self) -> Vec<BattleSetup> {
        self.setups().map(|setup| self.config.enemies.setup(setup)).collect()
    }
}

/// Why a team does not play another map.
#[derive(Debug, thiserror::Error)]
pub enum OtherMap {
    /// Its networks are those of one scenario.
    #[error(
        "the team was trained in `{0}` and plays that alone; a team that plays other maps is one of \
         `train --network universal` or `--maps`"
    )]
    NotUniversal(String),
    /// Its networks do not know the observations.
    #[error(transparent)]
    Observations(#[from] ConfigError),
    /// The scenario is not valid.
    #[error(transparent)]
    Scenario(#[from] Problems),
    /// It is to play enemies that are other units than the agents.
    #[error(transparent)]
    UnequalUnits(#[from] UnequalUnits),
    /// There is no such team, or its files are damaged.
    #[error(transparent)]
    File(#[from] FileError),
}

/// Which weights of a run play.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Weights {
    /// Those of the last checkpoint, `weights.safetensors`.
    Last,
    /// Those of the best evaluation, `best.safetensors`.
    Best,
}

impl Weights {
    /// Which weights of the run in a folder play, if nothing else is said: the best ones, if the run was
    /// evaluated, else the last. In self-play the last: its evaluations are against a script that it does not
    /// learn to beat.
    pub fn of(folder: &Path, run: &RunDescription) -> Weights {
        let is_self_play = matches!(run.config.enemies, Enemies::SelfPlay(_));
        let has_best = exists(&folder.join(BEST)) || was_evaluated(folder);
        if !is_self_play && has_best { Weights::Best } else { Weights::Last }
    }

    /// Says why a run has no such weights, if there is a reason other than damage.
    pub(crate) fn check_kept(self, folder: &Path) -> Result<(), FileError> {
        let why = match self {
            Weights::Best if was_evaluated(folder) => {
                "it was evaluated, so they were lost; `train --resume` writes them again, or choose the last \
                 weights"
            }
            Weights::Best => {
                "it was not evaluated while it trained (--evaluate-every); choose the last weights"
            }
            Weights::Last if !exists(&folder.join(BEST)) => return Ok(()),
            Weights::Last => "only the best weights were kept; choose those",
        };
        let missing = self.file_name();
        match exists(&folder.join(missing)) {
            true => Ok(()),
            false => Err(FileError::NoWeights { folder: folder.to_owned(), missing, why }),
        }
    }

    /// The name of the file, in the folder of a run.
    pub fn file_name(self) -> &'static str {
        match self {
            Weights::Last => WEIGHTS,
            Weights::Best => BEST,
        }
    }
}

/// Whether an evaluation of the run in a folder is complete. A run that is to be evaluated has the file, with
/// its header, from the beginning on; a row is written last. A file that cannot be read is no reason to play
/// other weights without a word.
fn was_evaluated(folder: &Path) -> bool {
    let complete_lines = |text: String| text.matches('\n').count();
    read_text(&folder.join(EVALUATIONS)).map_or(true, |text| complete_lines(text) > 1)
}

smaclite_units::keywords!(Weights, "weights", "last" => Last, "best" => Best);

/// The policy of the team in a folder, on the map of this description of its run; and which of its weights
/// these are.
///
/// # Errors
/// If the files cannot be read or are damaged.
pub(crate) fn read_policy(
    folder: &Path,
    run: &RunDescription,
    weights: Option<Weights>,
) -> Result<(Weights, Network), FileError> {
    let weights = weights.unwrap_or_else(|| Weights::of(folder, run));
    weights.check_kept(folder)?;
    Ok((weights, run.playing(run.read_actor(&folder.join(weights.file_name()))?)))
}

pub(crate) fn write_description(folder: &Path, run: &RunDescription) -> Result<(), FileError> {
    let path = folder.join("run.json");
    let text = serde_json::to_vec_pretty(&RunFile::of(run))
        .map_err(|error| FileError::Write { path: path.clone(), source: error.into() })?;
    write(&path, &text)
}
