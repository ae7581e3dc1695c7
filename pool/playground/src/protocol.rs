//! What a page asks and is told: JSON, declared here and nowhere else. `page/protocol.d.ts` describes it to
//! the scripts; the test below writes it. A page with its engine inside contains both sides. In a
//! program they have the version of the messages that carry them (`web/protocol` in `bindings/cli`), which
//! changes with these, too.

use crate::editor::{Builtins, CheckedFiles, Group};
use serde::{Deserialize, Serialize};
use smaclite_scenarios::ScenarioFiles;
use smaclite_view::page::{Features, ScenarioInfo};
use smaclite_view::{AgentOrder, EpisodeResult, Order};
#[cfg(test)]
use ts_rs::TS;

/// A request of the page.
#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub(crate) enum Request {
    /// What there is to choose from.
    GetChoices {},
    /// Adds a trained team.
    AddTeam(TeamFiles),
    /// Reads a scenario file and the unit files that it names.
    OpenScenario { files: Vec<TextFile> },
    /// Reads a replay, and checks that this engine plays every tick of it as it was recorded.
    OpenReplay {
        name: String,
        /// The file's text; the page decompresses it.
        replay: String,
    },
    /// Begins a battle instead of the one that there is.
    BeginBattle(BeginBattle),
    /// Plays steps, up to the end of the battle.
    PlaySteps { steps: usize },
    /// Gives agents orders, all of them or none.
    GiveOrders {
        #[cfg_attr(test, ts(type = "Array<AgentOrder>"))]
        orders: Vec<AgentOrder>,
    },
    /// Which agents carry out orders; the team plays the others.
    TakeAgents { agents: Vec<usize> },
    /// What an agent observes before a step that was played, or the next one.
    GetObservation { step: usize, agent: usize },
    /// The battle so far as a replay.
    GetReplay {},
    /// The scenario of the battle, but for where a unit starts, in squares.
    MoveUnit { unit: usize, x: f64, y: f64 },
    /// The scenario of the battle, but for its map: rows of `_` and `X`, the southernmost first.
    PaintMap { rows: Vec<String> },
    /// What the editor needs to know of files and of what is built in.
    GetBuiltins {},
    /// The problems of files, and where their units start.
    CheckFiles {
        #[cfg_attr(test, ts(type = "ScenarioFiles"))]
        files: ScenarioFiles,
        groups: Vec<Group>,
        /// Of the teams and start positions that are drawn.
        seed: String,
    },
}

/// The response to the request of the same name.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub(crate) enum Response {
    GetChoices(Choices),
    /// The names of all teams.
    AddTeam {
        teams: Vec<TeamInfo>,
    },
    /// The scenario as [`Source::Scenario`] has it.
    OpenScenario {
        scenario: String,
    },
    OpenReplay(OpenedReplay),
    BeginBattle(Box<BegunBattle>),
    PlaySteps(PlayedSteps),
    /// The orders that hold now, by agent.
    GiveOrders {
        #[cfg_attr(test, ts(type = "Array<Order>"))]
        orders: Vec<Order>,
    },
    TakeAgents {},
    GetObservation {
        obs: Vec<f32>,
    },
    GetReplay(ReplayFile),
    /// As [`Source::Scenario`] has it.
    MoveUnit {
        scenario: String,
    },
    /// As [`Source::Scenario`] has it.
    PaintMap {
        scenario: String,
    },
    GetBuiltins(Box<Builtins>),
    CheckFiles(CheckedFiles),
}

/// What became of a request.
#[derive(Debug, Serialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub(crate) enum Outcome {
    Response(Response),
    Error(String),
}

/// What there is to choose from.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct Choices {
    /// The standard scenarios.
    pub scenarios: Vec<&'static str>,
    /// Those whose teams and start positions are drawn.
    pub generated: Vec<&'static str>,
    /// Scripts that play the enemies.
    pub opponents: Vec<&'static str>,
    /// Scripts that play the agents.
    pub policies: Vec<&'static str>,
    pub rules: Vec<String>,
    pub teams: Vec<TeamInfo>,
}

/// A trained team.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct TeamInfo {
    pub name: String,
    /// The name of the scenario that it was trained in.
    pub scenario: String,
    /// That scenario as [`Source::Scenario`] has it.
    pub source: String,
    /// Whether it plays every scenario.
    pub is_universal: bool,
}

/// A text file that a person opens.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct TextFile {
    /// Its name, without folders.
    pub name: String,
    pub text: String,
}

/// The files of a trained team.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(test, derive(TS))]
pub struct TeamFiles {
    /// What the page calls it.
    pub name: String,
    /// The text of `run.json`.
    pub run: String,
    /// The weights, safetensors in base64.
    pub weights: String,
}

/// A battle, from its start or after steps.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct BeginBattle {
    pub of: Source,
    /// The script or trained team that plays the agents.
    pub team: String,
    /// The joint actions of the steps that are played at once, agent by agent, without those of a team that
    /// plays the enemies; if they are left out, all that were recorded of the episode.
    pub actions: Option<Vec<u16>>,
    /// The agents that carry out orders.
    pub taken: Vec<usize>,
}

/// Which battle.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub(crate) enum Source {
    /// A battle of a scenario.
    Scenario {
        /// A name, the text of a scenario file, or what `run.json` has of a battle: an object with the key
        /// `files`, which has unit files too.
        scenario: String,
        /// A whole number; as a text, because JavaScript has no 64-bit integers.
        seed: String,
        /// The script or trained team that plays the enemies; those of the scenario if this is empty. A team
        /// sees the map turned by half a turn.
        opponent: String,
        /// Those of the scenario if this is empty.
        rules: String,
    },
    /// An episode of the replay that was opened last.
    Episode { episode: usize },
}

/// A battle that has begun.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct BegunBattle {
    #[cfg_attr(test, ts(type = "ScenarioInfo"))]
    pub scenario: ScenarioInfo,
    #[cfg_attr(test, ts(type = "Array<Features>"))]
    pub features: Vec<Features>,
    /// The scenario as [`Source::Scenario`] has it, for another battle.
    pub source: String,
    pub rules: String,
    /// Who plays the enemies.
    pub opponent: String,
    pub seed: String,
    /// The step with which it begins: not 0 if a replay recorded it from a snapshot on.
    pub first_step: u32,
    /// Whether it can be played on; a battle in which actions play the enemies too is only shown.
    pub is_playable: bool,
    /// What is probably a mistake in its scenario, if that is none of the standard ones.
    pub warnings: Vec<String>,
    pub played: PlayedSteps,
}

/// Steps of the battle; `track.js` decodes moments and decisions.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct PlayedSteps {
    /// The first of them, and how many there are.
    pub step: usize,
    pub steps: usize,
    pub n_moments: usize,
    /// In base64.
    pub moments: String,
    /// In base64.
    pub decisions: String,
    /// Return of the episode after them.
    #[serde(rename = "return")]
    pub episode_return: f64,
    /// How the episode ended, if it did.
    #[cfg_attr(test, ts(type = "EpisodeResult | null"))]
    pub result: Option<EpisodeResult>,
    /// The orders that hold after them, by agent.
    #[cfg_attr(test, ts(type = "Array<Order>"))]
    pub orders: Vec<Order>,
}

/// A replay that this engine reproduces.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct OpenedReplay {
    /// The program that recorded it.
    pub program: String,
    pub episodes: Vec<EpisodeInfo>,
}

/// A recorded episode.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct EpisodeInfo {
    pub seed: String,
    pub steps: usize,
    #[serde(rename = "return")]
    pub episode_return: f64,
    #[cfg_attr(test, ts(type = "EpisodeResult | null"))]
    pub result: Option<EpisodeResult>,
    /// XXH3 over the bits of all units after every tick and of every reward: 16 hexadecimal digits.
    pub checksum: String,
}

/// A replay file.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct ReplayFile {
    pub name: String,
    /// The file's text; the page compresses it by gzip.
    pub replay: String,
    /// As in [`EpisodeInfo`].
    pub checksum: String,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::editor::{FileFormat, KeyFormat, NamedText, Preset, StandardUnit, Summary, TargeterFormat};
    use serde_json::{Value, json};
    use smaclite_scenarios::UnitFile;
    use smaclite_units::file::Problem;
    use ts_rs::Config;

    /// Types of other crates. The test below compares their keys.
    const FOREIGN: &str = "\
type UnitFile = { name: string; keys: string[]; text: string };
export type ScenarioFiles = { source: string; text: string; unit_files: UnitFile[] };
export type Problem = {
  file: string; line: number | null; column: number | null; path: string; message: string;
};
export type JsonSchema = {
  type?: string;
  minimum?: number;
  exclusiveMinimum?: number;
  maximum?: number;
  enum?: string[];
  items?: JsonSchema;
  properties?: { [key in string]?: JsonSchema };
  default?: unknown;
  description?: string;
  propertyNames?: JsonSchema;
};
";

    fn keys(value: &Value) -> Vec<&str> {
        value.as_object().unwrap().keys().map(String::as_str).collect()
    }

    #[test]
    fn types_of_other_crates_are_as_the_scripts_know_them() {
        let unit = UnitFile { name: String::new(), keys: Vec::new(), text: String::new() };
        assert_eq!(keys(&json!(unit)), ["keys", "name", "text"]);
        let files = ScenarioFiles { source: String::new(), text: String::new(), unit_files: vec![] };
        assert_eq!(keys(&json!(files)), ["source", "text", "unit_files"]);
        let problem = Problem {
            file: String::new(),
            line: None,
            column: None,
            path: String::new(),
            message: String::new(),
        };
        assert_eq!(keys(&json!(problem)), ["column", "file", "line", "message", "path"]);
    }

    #[test]
    fn generated_types_of_messages() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/page/protocol.d.ts");
        let config = Config::default();
        macro_rules! declarations {
            ($($name:ident),+ $(,)?) => { [$(format!("export {}\n", $name::decl(&config))),+].concat() };
        }
        let declarations = declarations![
            Request,
            Response,
            Outcome,
            Choices,
            TeamInfo,
            TeamFiles,
            TextFile,
            BeginBattle,
            Source,
            BegunBattle,
            PlayedSteps,
            OpenedReplay,
            EpisodeInfo,
            ReplayFile,
            Group,
            Builtins,
            NamedText,
            Preset,
            StandardUnit,
            FileFormat,
            KeyFormat,
            TargeterFormat,
            CheckedFiles,
            Summary,
        ];
        let text = format!(
            "// Written by a test of src/protocol.rs: `just generate`\n\
             import type {{ AgentOrder, EpisodeResult, Features, Order, ScenarioInfo, TypeInfo }} \
             from \"#view/data.d.ts\";\n\n\
             {FOREIGN}{declarations}"
        );
        if std::env::var_os("SMACLITE_WRITE").is_some() {
            std::fs::write(file, &text).unwrap();
        }
        let written = std::fs::read_to_string(file).unwrap_or_default();
        assert!(written == text, "they have changed: run `just generate`");
    }
}
