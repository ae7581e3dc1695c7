//! The file of a dataset, compressed by gzip: a line of JSON (`zcat FILE | head -1 | jq` shows it), and then
//! columns of bytes, whose lengths follow from it:
//!
//! | column | bytes |
//! | --- | --- |
//! | seeds | u64 per episode, less the seed of the episode before (modulo 2^64) |
//! | lengths | u32 per episode |
//! | policies | u16 per episode |
//! | ends | a byte per episode: 1 terminated, 2 truncated, 4 won |
//! | actions | a byte per agent and step, or a u16 if there are more than 256 actions; see below |
//!
//! Actions are stored episode by episode, and in each those of one agent after those of the other, as they
//! resemble each other most.
//!
//! Numbers are little-endian. gzip's checksum and length detect damage, and what is compressed is read only
//! as far as the line of JSON says. Everything is checked after reading, except for what only play can tell:
//! whether actions are legal, and whether the arrays have the recorded hashes, and the returns and different
//! pairs of the card. What training told of the policies cannot be checked.

use super::arrays::{ARRAYS, N_ARRAYS};
use super::{Card, Dataset, DatasetError, End, Episode, Policy, starts};
use flate2::Compression;
use flate2::bufread::GzDecoder;
use flate2::write::GzEncoder;
use serde::{Deserialize, Serialize};
use smaclite_engine::{BattleSetup, Sides, Sizes};
use smaclite_units::file::{shortened, write_whole};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::Path;
use std::sync::Arc;

/// The suffix of dataset files.
pub const SUFFIX: &str = "smdata";

/// Most steps of a dataset, so that their numbers fit into 32 bits.
pub(super) const MAX_STEPS: usize = 1 << 30;

/// Most policies of a dataset, whose numbers are of 16 bits.
pub(super) const MAX_POLICIES: usize = 1 << 16;

/// Most bytes of the line of JSON.
const MAX_HEAD_BYTES: u64 = 64 << 20;

/// The `format` of every dataset.
const FORMAT: &str = "smaclite-dataset";

/// The version of the format; it rises whenever the meaning of a file changes.
const VERSION: u64 = 1;

/// The name and version of this program.
pub(super) fn this_program() -> String {
    format!("smaclite-pool {}", env!("CARGO_PKG_VERSION"))
}

/// What is read first; other versions may differ in everything else.
#[derive(Deserialize)]
struct Start {
    format: String,
    version: u64,
    program: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    format: String,
    version: u64,
    program: String,
    setup: BattleSetup,
    policies: Vec<Policy>,
    episodes: usize,
    steps: usize,
    /// By the name of the array, 32 hexadecimal digits.
    hashes: BTreeMap<String, String>,
    /// That of all arrays.
    hash: String,
    card: Card,
}

impl Dataset {
    /// Reads a dataset file.
    ///
    /// # Errors
    /// [`DatasetError`] says what is wrong with the file. Whether this version plays its episodes as they
    /// were recorded is checked by [`expand`](Self::expand).
    pub fn read(path: &Path) -> Result<Dataset, DatasetError> {
        let file = path.display().to_string();
        let failed = |error| DatasetError::Io { file: file.clone(), error };
        // Before it is opened: to open a pipe is to wait for its writer.
        if !std::fs::metadata(path).map_err(failed)?.is_file() {
            return Err(failed(io::Error::other("it is not a regular file")));
        }
        Dataset::from_reader(BufReader::new(File::open(path).map_err(failed)?), &file)
    }

    /// Writes a dataset file, whole or not at all.
    ///
    /// # Errors
    /// [`DatasetError::Io`].
    pub fn write(&self, path: &Path) -> Result<(), DatasetError> {
        write_whole(path, |output| self.write_to(output))
            .map_err(|error| DatasetError::Io { file: path.display().to_string(), error })
    }

    fn write_to(&self, output: &mut dyn Write) -> io::Result<()> {
        let mut encoder = GzEncoder::new(output, Compression::best());
        serde_json::to_writer(&mut encoder, &self.head())?;
        encoder.write_all(b"\n")?;
        let mut before = 0;
        for Episode { seed, .. } in &self.episodes {
            encoder.write_all(&seed.wrapping_sub(before).to_le_bytes())?;
            before = *seed;
        }
        let episodes = || self.episodes.iter();
        episodes().try_for_each(|episode| encoder.write_all(&episode.length.to_le_bytes()))?;
        episodes().try_for_each(|episode| encoder.write_all(&episode.policy.to_le_bytes()))?;
        episodes().try_for_each(|episode| encoder.write_all(&[episode.end.byte()]))?;
        let (Sizes { n_agents, .. }, width) = (self.sizes(), action_bytes(self.sizes()));
        for episode in 0..self.episodes.len() {
            for agent in 0..n_agents {
                for step in self.steps_of(episode) {
                    let action = self.actions[step * n_agents + agent].to_le_bytes();
                    encoder.write_all(&action[..width])?;
                }
            }
        }
        encoder.finish().map(|_| ())
    }

    fn head(&self) -> Head {
        let names = ARRAYS.iter().map(|spec| spec.name.to_owned());
        let hashes = names.zip(&self.hashes).map(|(name, hash)| (name, format!("{hash:032x}"))).collect();
        Head {
            format: FORMAT.to_owned(),
            version: VERSION,
            program: self.program.clone(),
            setup: self.setup.clone(),
            policies: self.policies.clone(),
            episodes: self.episodes.len(),
            steps: self.n_steps(),
            hashes,
            hash: self.hash(),
            card: self.card.clone(),
        }
    }

    /// Reads the bytes of a dataset file; `source` is what error messages call it.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn from_reader(input: impl BufRead, source: &str) -> Result<Dataset, DatasetError> {
        let mut reader = Reader { input: BufReader::new(GzDecoder::new(input)), source };
        let head = reader.head()?;
        let (_, arena) = head.setup.arena()?;
        let sizes = arena.sizes();
        reader.check_head(&head)?;
        let episodes = reader.episodes(&head, arena.episode_limit())?;
        let actions = reader.actions(&episodes, sizes)?;
        reader.check_end()?;
        let starts = starts(&episodes);
        let hashes = reader.hashes(&head)?;
        let dataset = Dataset {
            source: source.to_owned(),
            program: shortened(&head.program),
            setup: head.setup,
            arena: Arc::new(arena),
            policies: head.policies,
            episodes,
            starts,
            actions,
            hashes,
            card: head.card,
        };
        let hash = dataset.hash();
        reader.that(head.hash == hash, "hash", &hash, &head.hash)?;
        dataset.check_card()?;
        Ok(dataset)
    }
}

struct Reader<'a, R: BufRead> {
    input: BufReader<GzDecoder<R>>,
    source: &'a str,
}

impl<R: BufRead> Reader<'_, R> {
    fn not_a_dataset(&self, reason: impl Into<String>) -> DatasetError {
        DatasetError::NotADataset { file: self.source.to_owned(), reason: reason.into() }
    }

    fn that(
        &self,
        is_valid: bool,
        key: &str,
        expected: &str,
        given: impl ToString,
    ) -> Result<(), DatasetError> {
        if is_valid {
            return Ok(());
        }
        Err(DatasetError::Invalid {
            file: self.source.to_owned(),
            key: key.to_owned(),
            expected: expected.to_owned(),
            given: shortened(&given.to_string()),
        })
    }

    fn failed(&self, error: &io::Error) -> DatasetError {
        match error.kind() {
            io::ErrorKind::UnexpectedEof => self.not_a_dataset("the file ends too early"),
            _ => self.not_a_dataset(error.to_string()),
        }
    }

    fn head(&mut self) -> Result<Head, DatasetError> {
        let mut line = Vec::new();
        let read = self.input.by_ref().take(MAX_HEAD_BYTES).read_until(b'\n', &mut line);
        read.map_err(|error| self.failed(&error))?;
        let json = |error: serde_json::Error| self.not_a_dataset(error.to_string());
        let start: Start = serde_json::from_slice(&line).map_err(json)?;
        if start.format != FORMAT {
            let given = shortened(&start.format);
            return Err(self.not_a_dataset(format!("`format` must be {FORMAT:?}, got {given:?}")));
        }
        if start.version != VERSION {
            return Err(DatasetError::Version {
                file: self.source.to_owned(),
                given: start.version,
                supported: VERSION,
                program: shortened(&start.program),
            });
        }
        if line.last() != Some(&b'\n') {
            let reason = format!("it does not begin with a line of at most {MAX_HEAD_BYTES} bytes");
            return Err(self.not_a_dataset(reason));
        }
        serde_json::from_slice(&line).map_err(json)
    }

    fn check_head(&self, head: &Head) -> Result<(), DatasetError> {
        let Head { setup, policies, episodes, steps, hashes, .. } = head;
        self.that(setup.sides == Sides::default(), "setup.sides", "left out", "both sides")?;
        let n_policies = policies.len();
        let fits = (1..=MAX_POLICIES).contains(&n_policies);
        self.that(fits, "policies", &format!("1 to {MAX_POLICIES} policies"), n_policies)?;
        self.that((1..=MAX_STEPS).contains(steps), "steps", &format!("1 to {MAX_STEPS}"), steps)?;
        let fits = (1..=*steps).contains(episodes);
        self.that(fits, "episodes", &format!("1 to {steps}, the `steps`"), episodes)?;
        let fits = hashes.len() == N_ARRAYS;
        self.that(fits, "hashes", &format!("of the {N_ARRAYS} arrays"), hashes.len())
    }

    fn hashes(&self, head: &Head) -> Result<Vec<u128>, DatasetError> {
        let of_array = |name: &str| {
            let text = head.hashes.get(name).map_or("", String::as_str);
            let is_hex = text.len() == 32 && text.bytes().all(|digit| digit.is_ascii_hexdigit());
            self.that(is_hex, &format!("hashes.{name}"), "32 hexadecimal digits", text)?;
            u128::from_str_radix(text, 16).map_err(|error| self.not_a_dataset(error.to_string()))
        };
        ARRAYS.iter().map(|spec| of_array(spec.name)).collect()
    }

    /// The next bytes. Memory grows with what was read, not with what the file promises.
    fn column(&mut self, len: usize) -> Result<Vec<u8>, DatasetError> {
        let mut bytes = Vec::new();
        let read = self.input.by_ref().take(len as u64).read_to_end(&mut bytes);
        read.map_err(|error| self.failed(&error))?;
        if bytes.len() == len { Ok(bytes) } else { Err(self.not_a_dataset("the file ends too early")) }
    }

    fn episodes(&mut self, head: &Head, limit: Option<u32>) -> Result<Vec<Episode>, DatasetError> {
        let n = head.episodes;
        let [seeds, lengths, policies, ends] = [8, 4, 2, 1].map(|width| self.column(n * width));
        let (seeds, lengths, policies, ends) = (seeds?, lengths?, policies?, ends?);
        let mut episodes = Vec::with_capacity(n);
        let (mut seed, mut steps) = (0u64, 0usize);
        let rows = seeds.as_chunks().0.iter().zip(lengths.as_chunks().0).zip(policies.as_chunks().0);
        for (i, (((delta, length), policy), end)) in rows.zip(&ends).enumerate() {
            let check = |is_valid, key: &str, expected: &str, given: u64| {
                self.that(is_valid, &format!("episode {i}: {key}"), expected, given)
            };
            seed = seed.wrapping_add(u64::from_le_bytes(*delta));
            let (length, policy) = (u32::from_le_bytes(*length), u16::from_le_bytes(*policy));
            let limit = limit.unwrap_or(u32::MAX);
            check((1..=limit).contains(&length), "length", &format!("1 to {limit}"), length.into())?;
            let is_policy = usize::from(policy) < head.policies.len();
            check(is_policy, "policy", &format!("below {}", head.policies.len()), policy.into())?;
            let expected = "1 (lost), 2 (truncated) or 5 (won)";
            check([1, 2, 5].contains(end), "end", expected, (*end).into())?;
            steps += length as usize;
            episodes.push(Episode { seed, length, policy, end: End::from_byte(*end) });
        }
        self.that(steps == head.steps, "steps", &format!("{steps}, those of the episodes"), head.steps)?;
        Ok(episodes)
    }

    fn actions(&mut self, episodes: &[Episode], sizes: Sizes) -> Result<Vec<u16>, DatasetError> {
        let (Sizes { n_agents, n_actions, .. }, width) = (sizes, action_bytes(sizes));
        let mut actions = Vec::new();
        for (i, episode) in episodes.iter().enumerate() {
            let length = episode.length as usize;
            let column = self.column(length * n_agents * width)?;
            let number = |place: usize| {
                let mut bytes = [0; 2];
                bytes[..width].copy_from_slice(&column[place * width..][..width]);
                u16::from_le_bytes(bytes)
            };
            for step in 0..length {
                for agent in 0..n_agents {
                    let action = number(agent * length + step);
                    let key = || format!("episode {i}, step {step}: action of agent {agent}");
                    if usize::from(action) >= n_actions {
                        self.that(false, &key(), &format!("below {n_actions}"), action)?;
                    }
                    actions.push(action);
                }
            }
        }
        Ok(actions)
    }

    /// Reads to the end, where gzip's checksum is.
    fn check_end(&mut self) -> Result<(), DatasetError> {
        let surplus = io::copy(&mut self.input.by_ref().take(1), &mut io::sink());
        if surplus.map_err(|error| self.failed(&error))? > 0 {
            return Err(self.not_a_dataset("more actions follow than the episodes have"));
        }
        let rest = self.input.get_mut().get_mut().fill_buf().map(<[u8]>::is_empty);
        match rest.map_err(|error| self.failed(&error))? {
            true => Ok(()),
            false => Err(self.not_a_dataset("bytes follow the compressed data")),
        }
    }
}

/// Bytes of an action in the file.
fn action_bytes(sizes: Sizes) -> usize {
    if sizes.n_actions <= 256 { 1 } else { 2 }
}

impl End {
    fn byte(self) -> u8 {
        u8::from(self.terminated) | u8::from(self.truncated) << 1 | u8::from(self.battle_won) << 2
    }

    fn from_byte(byte: u8) -> End {
        End { terminated: byte & 1 != 0, truncated: byte & 2 != 0, battle_won: byte & 4 != 0 }
    }
}
