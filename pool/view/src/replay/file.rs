//! The file of a replay: one JSON object, compressed by gzip (`zcat FILE | jq` shows it).
//!
//! gzip's checksum and length detect damage. Everything else is checked after reading, except for what only
//! play can tell: whether actions are legal, and whether the checksums of the episodes are reproduced.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;
use std::str::FromStr;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::bufread::GzDecoder;
use flate2::write::GzEncoder;
use serde::{Deserialize, Serialize};
use smaclite_engine::{
    Actor, Arena, BattleSetup, Opponent, RecordLayout, RecordSizes, Rules, Sides, Sizes, Snapshot,
    StreamPosition,
};
use smaclite_scenarios::{ScenarioFiles, UnitFile};
#[cfg(not(target_family = "wasm"))]
use smaclite_units::file::write_whole;
use smaclite_units::file::{printable_text, shortened};

use super::{Episode, Outcome, Replay, ReplayError};

/// The suffix of replay files.
pub const SUFFIX: &str = "smreplay";

/// The largest replay file, in bytes.
pub const MAX_FILE_BYTES: u64 = 64 << 20;

/// The largest replay, in bytes of JSON: some 5,000 episodes of 27 agents. A small file can be compressed
/// from much more.
pub const MAX_JSON_BYTES: u64 = 64 << 20;

/// The `format` of every replay.
const FORMAT: &str = "smaclite-replay";

/// The version of the format; it rises whenever the meaning of a file changes.
const VERSION: u64 = 1;

/// The `rules` that are accepted. `starcraft` stands for its newest version, and files name the version.
const RULES: &str = "\"smaclite\", \"paper\" or \"starcraft-1\"";

/// What is read first; other versions may differ in everything else.
#[derive(Deserialize)]
struct Head {
    format: String,
    version: u64,
    program: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    format: String,
    version: u64,
    program: String,
    scenario: ScenarioText,
    rules: String,
    episode_limit: Option<u32>,
    /// Only of battles in which actions play both sides.
    #[serde(default, skip_serializing_if = "Sides::is_default")]
    sides: Sides,
    episodes: Vec<EpisodeText>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ScenarioText {
    file: String,
    text: String,
    unit_files: Vec<UnitText>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct UnitText {
    name: String,
    keys: Vec<String>,
    text: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct EpisodeText {
    seed: u64,
    draws: u64,
    /// Only of episodes with another opponent than attack-move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    opponent: Option<String>,
    /// In base64, only of episodes that do not begin as after a reset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    snapshot: Option<String>,
    steps: u32,
    episode_return: f64,
    terminated: bool,
    truncated: bool,
    battle_won: bool,
    dead_allies: u32,
    dead_enemies: u32,
    /// 16 hexadecimal digits: programs that read JSON numbers as f64 would change a number of 64 bits.
    checksum: String,
    step_checksums: Vec<u16>,
    actions: Vec<u16>,
}

impl Replay {
    /// Reads a replay file.
    ///
    /// # Errors
    /// [`ReplayError`] says what is wrong with the file. Whether this version reproduces its episodes is
    /// checked by [`verify`](Self::verify).
    pub fn read(path: &Path) -> Result<Replay, ReplayError> {
        let file = path.display().to_string();
        let bytes = read_bytes(path).map_err(|error| ReplayError::Io { file: file.clone(), error })?;
        Replay::from_bytes(&bytes, &file)
    }

    /// Writes a replay file; a browser has none.
    ///
    /// # Errors
    /// [`ReplayError::TooLarge`], or [`ReplayError::Io`].
    #[cfg(not(target_family = "wasm"))]
    pub fn write(&self, path: &Path) -> Result<(), ReplayError> {
        let file = || path.display().to_string();
        let bytes = self.to_bytes().map_err(|error| match error {
            ReplayError::TooLarge { max, unit, .. } => ReplayError::TooLarge { file: file(), max, unit },
            other => other,
        })?;
        write_whole(path, |output| output.write_all(&bytes))
            .map_err(|error| ReplayError::Io { file: file(), error })
    }

    /// Reads the bytes of a replay file; `source` is what error messages call it.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn from_bytes(bytes: &[u8], source: &str) -> Result<Replay, ReplayError> {
        Replay::from_json(&inflate(bytes, source)?, source)
    }

    /// Reads the decompressed bytes of a replay file, which are JSON.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn from_json(json: &[u8], source: &str) -> Result<Replay, ReplayError> {
        if json.len() as u64 > MAX_JSON_BYTES {
            return Err(ReplayError::TooLarge { file: source.into(), max: MAX_JSON_BYTES, unit: "of JSON" });
        }
        let not_a_replay = |error: serde_json::Error| ReplayError::NotAReplay {
            file: source.into(),
            reason: error.to_string(),
        };
        // What follows the first value is not looked at yet: a dataset begins like a replay.
        let mut values = serde_json::Deserializer::from_slice(json);
        let head = Head::deserialize(&mut values).map_err(not_a_replay)?;
        if head.format != FORMAT {
            let reason = format!("`format` must be {FORMAT:?}, got {:?}", shortened(&head.format));
            return Err(ReplayError::NotAReplay { file: source.into(), reason });
        }
        if head.version != VERSION {
            return Err(ReplayError::Version {
                file: source.into(),
                given: head.version,
                supported: VERSION,
                program: shortened(&head.program),
            });
        }
        let document: Document = serde_json::from_slice(json).map_err(not_a_replay)?;
        document.replay(source)
    }

    /// The bytes of the replay's file.
    ///
    /// # Errors
    /// [`ReplayError::TooLarge`].
    pub fn to_bytes(&self) -> Result<Vec<u8>, ReplayError> {
        let io = |error| ReplayError::Io { file: "replay".into(), error };
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&self.to_json()?).map_err(io)?;
        let bytes = encoder.finish().map_err(io)?;
        if bytes.len() as u64 > MAX_FILE_BYTES { too_large(MAX_FILE_BYTES, "in its file") } else { Ok(bytes) }
    }

    /// The bytes of the replay's file before they are compressed by gzip.
    ///
    /// # Errors
    /// [`ReplayError::TooLarge`].
    pub fn to_json(&self) -> Result<Vec<u8>, ReplayError> {
        let io = |error: serde_json::Error| ReplayError::Io { file: "replay".into(), error: error.into() };
        let json = serde_json::to_vec(&Document::of(self)).map_err(io)?;
        if json.len() as u64 > MAX_JSON_BYTES { too_large(MAX_JSON_BYTES, "of JSON") } else { Ok(json) }
    }
}

fn too_large(max: u64, unit: &'static str) -> Result<Vec<u8>, ReplayError> {
    Err(ReplayError::TooLarge { file: "replay".into(), max, unit })
}

impl Document {
    fn of(replay: &Replay) -> Document {
        let ScenarioFiles { source, text, unit_files } = &replay.setup.files;
        let unit_files = unit_files.iter().cloned();
        let unit_texts = unit_files.map(|UnitFile { name, keys, text }| UnitText { name, keys, text });
        Document {
            format: FORMAT.into(),
            version: VERSION,
            program: replay.program.clone(),
            scenario: ScenarioText {
                file: source.clone(),
                text: text.clone(),
                unit_files: unit_texts.collect(),
            },
            rules: replay.setup.rules.to_string(),
            episode_limit: replay.arena.episode_limit(),
            sides: replay.setup.sides,
            episodes: replay.episodes.iter().map(|episode| EpisodeText::of(episode, &replay.arena)).collect(),
        }
    }

    fn replay(self, source: &str) -> Result<Replay, ReplayError> {
        let ScenarioText { file, text, unit_files } = self.scenario;
        let unit_files = unit_files.into_iter();
        let unit_files =
            unit_files.map(|UnitText { name, keys, text }| UnitFile { name, keys, text }).collect();
        let check = Check { file: source, key: String::new() };
        let rules = Rules::from_str(&self.rules).map_err(|_| check.invalid("rules", RULES, &self.rules))?;
        check.that(self.episode_limit != Some(0), "episode_limit", "at least 1, or null", 0)?;
        let files = ScenarioFiles { source: printable_text(&file), text, unit_files };
        let episode_limit = self.episode_limit.into();
        let setup = BattleSetup { rules, episode_limit, ..BattleSetup::new(files) }.with_sides(self.sides);
        let mut replay = Replay::new(setup, shortened(&self.program))?;
        let sizes = replay.arena.sizes();
        for (i, episode) in self.episodes.into_iter().enumerate() {
            let check = Check { file: source, key: format!("episodes[{i}].") };
            let snapshot = episode.snapshot(&check, &replay.arena)?;
            let first_step = snapshot.as_ref().map_or(0, |snapshot| snapshot.episode_length);
            let mut episode = episode.episode(&check, sizes, first_step)?;
            let is_played = episode.opponent != Opponent::Learner || self.sides.are_both();
            let expected = "a script, since the actions are those of the agents alone (`sides`)";
            check.that(is_played, "opponent", expected, episode.opponent.name())?;
            episode.snapshot = snapshot;
            replay.episodes.push(episode);
        }
        Ok(replay)
    }
}

impl EpisodeText {
    fn of(episode: &Episode, arena: &Arena) -> EpisodeText {
        let Episode { start, opponent, outcome, snapshot, .. } = episode;
        let encoded = |snapshot: &Snapshot| {
            let layout = RecordLayout::new(RecordSizes::new(&arena.sizes(), 0));
            let mut record = vec![0; layout.size()];
            snapshot.write_record(arena, &layout, &[], &mut record);
            STANDARD.encode(record)
        };
        EpisodeText {
            seed: start.seed,
            draws: start.draws,
            opponent: (*opponent != Opponent::default()).then(|| opponent.name().to_owned()),
            snapshot: snapshot.as_deref().map(encoded),
            steps: outcome.steps,
            episode_return: outcome.episode_return,
            terminated: outcome.terminated,
            truncated: outcome.truncated,
            battle_won: outcome.battle_won,
            dead_allies: outcome.dead_allies,
            dead_enemies: outcome.dead_enemies,
            checksum: format!("{:016x}", episode.checksum),
            step_checksums: episode.step_checksums.clone(),
            actions: episode.actions.clone(),
        }
    }

    /// The state in which it begins, if that is not the one after a reset.
    fn snapshot(&self, check: &Check, arena: &Arena) -> Result<Option<Box<Snapshot>>, ReplayError> {
        let Some(text) = &self.snapshot else { return Ok(None) };
        let record = STANDARD.decode(text).map_err(|_| check.invalid("snapshot", "base64", text))?;
        let mut snapshot = Box::<Snapshot>::default();
        let read = snapshot.read_record(arena, 0, &record, &mut Vec::new());
        read.map_err(|error| check.invalid("snapshot", "a state of this scenario", error))?;
        let StreamPosition { seed, draws } = snapshot.generator.position();
        check.that((seed, draws) == (self.seed, self.draws), "seed", "that of `snapshot`", self.seed)?;
        Ok(Some(snapshot))
    }

    /// Without its snapshot, before which the episode has `first_step` steps.
    fn episode(self, check: &Check, sizes: Sizes, first_step: u32) -> Result<Episode, ReplayError> {
        let n_actors = sizes.n_actors();
        let least = first_step.saturating_add(1);
        check.that(self.steps >= least, "steps", &format!("at least {least}"), self.steps)?;
        let n_checksums = self.step_checksums.len();
        let n_steps = (self.steps - first_step) as usize;
        let expected = format!("a list of length {n_steps}, the number of recorded `steps`");
        check.that(n_checksums == n_steps, "step_checksums", &expected, n_checksums)?;
        let given = self.actions.len();
        let expected = format!(
            "a list of length {}, {n_steps} recorded steps of {n_actors} units",
            n_checksums * n_actors
        );
        check.that(given == n_checksums * n_actors, "actions", &expected, given)?;
        for (i, &action) in self.actions.iter().enumerate() {
            let actor = Actor::at(i % n_actors, sizes.n_agents);
            let n_actions = sizes.of(actor.faction()).map_or(0, |sizes| sizes.n_actions);
            let (key, expected) = (|| format!("actions[{i}]"), || format!("between 0 and {}", n_actions - 1));
            if usize::from(action) >= n_actions {
                return Err(check.invalid(&key(), &expected(), action));
            }
        }
        let is_hex =
            self.checksum.len() == 16 && self.checksum.bytes().all(|digit| digit.is_ascii_hexdigit());
        let opponent = self.opponent.as_deref().map_or(Ok(Opponent::default()), |name| {
            Opponent::from_name(name).map_err(|_| check.invalid("opponent", &Opponent::names(), name))
        })?;
        let checksum = u64::from_str_radix(&self.checksum, 16).ok().filter(|_| is_hex);
        Ok(Episode {
            start: StreamPosition { seed: self.seed, draws: self.draws },
            opponent,
            snapshot: None,
            actions: self.actions,
            outcome: Outcome {
                steps: self.steps,
                episode_return: self.episode_return,
                terminated: self.terminated,
                truncated: self.truncated,
                battle_won: self.battle_won,
                dead_allies: self.dead_allies,
                dead_enemies: self.dead_enemies,
            },
            step_checksums: self.step_checksums,
            checksum: checksum
                .ok_or_else(|| check.invalid("checksum", "16 hexadecimal digits", &self.checksum))?,
        })
    }
}

/// Checks of values of a file; `key` is the key of the object that has them.
struct Check<'a> {
    file: &'a str,
    key: String,
}

impl Check<'_> {
    fn that(
        &self,
        is_valid: bool,
        key: &str,
        expected: &str,
        given: impl ToString,
    ) -> Result<(), ReplayError> {
        if is_valid { Ok(()) } else { Err(self.invalid(key, expected, given)) }
    }

    fn invalid(&self, key: &str, expected: &str, given: impl ToString) -> ReplayError {
        ReplayError::Invalid {
            file: self.file.into(),
            key: format!("{}{key}", self.key),
            expected: expected.into(),
            given: shortened(&given.to_string()),
        }
    }
}

fn read_bytes(path: &Path) -> io::Result<Vec<u8>> {
    // Before it is opened: to open a pipe is to wait for whoever writes to it.
    if !std::fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is not a regular file"));
    }
    let file = File::open(path)?;
    let mut bytes = Vec::new();
    // One byte over the limit detects a file that is larger.
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The JSON of a file.
fn inflate(bytes: &[u8], source: &str) -> Result<Vec<u8>, ReplayError> {
    let too_large = |max, unit| Err(ReplayError::TooLarge { file: source.into(), max, unit });
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return too_large(MAX_FILE_BYTES, "in its file");
    }
    let mut json = Vec::new();
    let mut decoder = GzDecoder::new(bytes);
    let not_a_replay = |reason: String| ReplayError::NotAReplay { file: source.into(), reason };
    let read = decoder.by_ref().take(MAX_JSON_BYTES + 1).read_to_end(&mut json);
    read.map_err(|error| match error.kind() {
        io::ErrorKind::UnexpectedEof => {
            not_a_replay(format!("the file ends after {} bytes, too early", bytes.len()))
        }
        _ => not_a_replay(error.to_string()),
    })?;
    if json.len() as u64 > MAX_JSON_BYTES {
        return too_large(MAX_JSON_BYTES, "of JSON");
    }
    match decoder.into_inner().len() {
        0 => Ok(json),
        surplus => Err(not_a_replay(format!("{surplus} bytes follow the compressed data"))),
    }
}
