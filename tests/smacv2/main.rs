//! Comparison of the engine's interface with recordings of SMACv2's published Python code, bit for bit.
//!
//! The recorded units, actions and random numbers are put into the interface, and everything that it computes
//! from them is compared: `golden/README.md` describes the recordings. `SMACLITE_SMACV2_TRACES=folder cargo
//! test
//! --release -p smaclite-tests --test smacv2` compares with other recordings.

mod case;
mod replay;
mod tally;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use case::Case;
use tally::Tally;

fn main() -> ExitCode {
    let folder = std::env::var_os("SMACLITE_SMACV2_TRACES")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("smacv2/golden"), PathBuf::from);
    let mut paths: Vec<PathBuf> = std::fs::read_dir(&folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .map(|entry| entry.expect("an entry of the folder").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "npz"))
        .collect();
    paths.sort();
    assert!(!paths.is_empty(), "{}: no recordings (*.npz)", folder.display());
    let mut total = Tally::default();
    for path in &paths {
        let case = Case::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let tally = replay::compare(&case);
        if tally.n_different() > 0 {
            println!("{}: {tally}", path.display());
        }
        total.add(&tally);
    }
    println!("total: {} files, {} values, {} differ", paths.len(), total.n_values(), total.n_different());
    if total.n_different() == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
