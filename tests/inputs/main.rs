//! Everything that reads bytes of other programs, given inputs that were found by fuzzing, and changes of
//! them. None may take much memory, whatever numbers it holds: an allocation that fails ends the process.
//!
//! A file per kind of input has the function that reads it and checks what came of it; the fuzzers
//! (`just fuzz`) run the same functions. `seeds` has inputs that were written by hand, `corpus` those that
//! reached code which no other did (`just fuzz-corpus` renews them).

mod frame;
mod replay_file;
mod request;
mod scenario_file;
mod snapshot;
mod steps;
mod unit_file;

use rand::seq::IndexedRandom;
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use smaclite_tests::heap::{Counting, Heap};
use std::io::Read;
use std::path::Path;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The most memory that reading an input and checking what came of it may take, in bytes. Those that are kept
/// take a third of it at most, and that for battles which are stepped.
const MOST_MEMORY: i64 = 4 << 20;

/// The changed inputs for each one that is kept.
const CHANGES: usize = 200;

/// Says which input was read when a check failed.
struct Reading<'a>(&'a str, &'a [u8]);

impl Drop for Reading<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let Reading(name, bytes) = self;
            eprintln!("the input was {name}: b\"{}\"", bytes.escape_ascii());
        }
    }
}

/// Names and contents of what is kept of a kind.
fn kept(kind: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("inputs");
    let seeds = std::fs::read_dir(folder.join("seeds").join(kind)).expect("seeds").map(|entry| {
        let path = entry.expect("an entry").path();
        (path.display().to_string(), std::fs::read(&path).expect("a seed"))
    });
    let mut inputs: Vec<_> = seeds.collect();
    inputs.sort(); // folders have no order
    let path = folder.join(format!("corpus/{kind}.zip"));
    let mut archive =
        zip::ZipArchive::new(std::fs::File::open(&path).expect("a corpus")).expect("an archive");
    for i in 0..archive.len() {
        let mut file = archive.by_index(i).expect("a file");
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).expect("its bytes");
        inputs.push((format!("{} of {}", file.name().expect("a name"), path.display()), bytes));
    }
    inputs
}

/// Changes some bytes, as a fuzzer does that knows nothing of the code: bytes are replaced, inserted,
/// repeated and cut, or come from another input.
fn change(bytes: &mut Vec<u8>, inputs: &[(String, Vec<u8>)], random: &mut impl Rng) {
    for _ in 0..random.random_range(1..4) {
        let at = random.random_range(0..=bytes.len());
        let end = (at + random.random_range(0..9)).min(bytes.len());
        match random.random_range(0..6) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..end)),
            2 => bytes.insert(at, random.random()),
            3 => bytes[at..end].iter_mut().for_each(|byte| *byte = random.random()),
            4 => {
                let again = bytes[at..end].to_vec();
                drop(bytes.splice(at..at, again));
            }
            _ => {
                let (_, other) = inputs.choose(random).expect("an input");
                let from = random.random_range(0..=other.len());
                bytes.truncate(at);
                bytes.extend_from_slice(&other[from..]);
            }
        }
    }
}

fn within_memory(run: fn(&[u8]), name: &str, bytes: &[u8]) {
    let _reading = Reading(name, bytes);
    let before = Heap::of_thread();
    Heap::forget_most();
    run(bytes);
    let taken = Heap::of_thread().most - before.bytes;
    assert!(taken <= MOST_MEMORY, "{taken} bytes of memory were taken");
}

fn check(kind: &str, run: fn(&[u8])) {
    let inputs = kept(kind);
    assert!(inputs.len() > 20, "{kind} has {} inputs", inputs.len());
    let mut random = Pcg64Mcg::seed_from_u64(1);
    for (name, bytes) in &inputs {
        within_memory(run, name, bytes);
        for i in 0..CHANGES {
            let mut changed = bytes.clone();
            change(&mut changed, &inputs, &mut random);
            within_memory(run, &format!("change {i} of {name}"), &changed);
        }
    }
}

#[test]
fn frames_and_control_messages() {
    check("frame", frame::run);
}

#[test]
fn replay_files() {
    check("replay_file", replay_file::run);
}

#[test]
fn requests() {
    check("request", request::run);
}

#[test]
fn scenario_files() {
    check("scenario_file", scenario_file::run);
}

#[test]
fn snapshots() {
    check("snapshot", snapshot::run);
}

#[test]
fn unit_files() {
    check("unit_file", unit_file::run);
}
