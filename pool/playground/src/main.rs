//! Makes the page of the playground: one document, with the engine, the scripts and trained teams inside, so
//! that it works from a folder and without a network.
//!
//!     smaclite-playground ENGINE.wasm PAGE.html [TEAM...]
//!
//! A team is a folder that `smaclite-pool train` wrote; the page calls it by the folder's name.
//! `just playground` runs this.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use serde_json::json;
use smaclite_playground::{EngineOf, Start, TeamFiles, document};
use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// As that of a replay, but it may run the engine.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; \
    style-src 'unsafe-inline'; img-src data:";

/// The weights of a run that play, the best ones first. In self-play it is the other way round, and such
/// teams are opened on the page (`page/files.js`).
const WEIGHTS: [&str; 2] = ["best.safetensors", "weights.safetensors"];

fn main() -> ExitCode {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [engine, page, teams @ ..] = &arguments[..] else {
        eprintln!("usage: smaclite-playground ENGINE.wasm PAGE.html [TEAM...]");
        return ExitCode::from(2);
    };
    match write_page(engine, page, teams) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("smaclite-playground: {error}");
            ExitCode::FAILURE
        }
    }
}

fn write_page(engine: &Path, page: &Path, folders: &[PathBuf]) -> Result<(), Box<dyn Error>> {
    let code = read(engine)?;
    let teams = folders.iter().map(|folder| team(folder)).collect::<Result<Vec<TeamFiles>, _>>()?;
    let compressed = deflated(&code)?;
    let start = Start { first: json!({}), can_share: true, ..Start::default() };
    let html = document(EngineOf::Page(&STANDARD.encode(&compressed)), POLICY, &teams, &start);
    std::fs::write(page, &html).map_err(|error| format!("cannot write `{}`: {error}", page.display()))?;
    let kilobytes = |bytes: usize| bytes / 1000;
    println!(
        "{}: {} KB; engine {} KB, compressed {} KB; {} teams",
        page.display(),
        kilobytes(html.len()),
        kilobytes(code.len()),
        kilobytes(compressed.len()),
        teams.len()
    );
    Ok(())
}

fn team(folder: &Path) -> Result<TeamFiles, Box<dyn Error>> {
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let run = String::from_utf8(read(&folder.join("run.json"))?)?;
    let weights = WEIGHTS.iter().map(|name| folder.join(name)).find(|path| path.is_file());
    let weights = weights.ok_or_else(|| format!("`{}` has no weights", folder.display()))?;
    Ok(TeamFiles::new(name, run, &read(&weights)?)?)
}

fn deflated(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    encoder.finish()
}

fn read(path: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(path).map_err(|error| format!("cannot read `{}`: {error}", path.display()))
}
