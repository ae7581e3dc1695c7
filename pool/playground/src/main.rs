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
use safetensors::SafeTensors;
use serde_json::{Value, json};
use smaclite_playground::Team;
use smaclite_view::page::{Document, Module};
use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// As that of a replay, but it may run the engine.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; \
    style-src 'unsafe-inline'; img-src data:";

macro_rules! modules {
    ($($name:literal),+ $(,)?) => {
        &[$(Module { path: concat!("playground/", $name), text: include_str!(concat!("../page/", $name)) }),+]
    };
}

const MODULES: &[Module] = modules![
    "choices.js",
    "engine.js",
    "episodes.js",
    "files.js",
    "headline.js",
    "link.js",
    "main.js",
    "mover.js",
    "painter.js",
    "playground.js",
    "playground_view.js",
    "scenario.js",
    "share.js",
];

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
    let teams = folders.iter().map(|folder| team(folder)).collect::<Result<Vec<Value>, _>>()?;
    let compressed = deflated(&code)?;
    let data = json!({ "engine": STANDARD.encode(&compressed), "teams": teams });
    let document = Document {
        title: "Playground",
        policy: POLICY,
        style: include_str!("../page/playground.css"),
        body: include_str!("../page/playground.html"),
        modules: MODULES,
        entry: "playground/main.js",
        data: &data,
    };
    let html = document.html();
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

/// What the page needs of a team: of the weights those of the actor.
fn team(folder: &Path) -> Result<Value, Box<dyn Error>> {
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let run = String::from_utf8(read(&folder.join("run.json"))?)?;
    let weights = WEIGHTS.iter().map(|name| folder.join(name)).find(|path| path.is_file());
    let weights = weights.ok_or_else(|| format!("`{}` has no weights", folder.display()))?;
    let bytes = read(&weights)?;
    Team::read(&name, &run, &bytes)?; // a page does not find out that a team is damaged
    let tensors = SafeTensors::deserialize(&bytes)?.tensors();
    let actor = tensors.into_iter().filter(|(name, _)| name.starts_with("actor."));
    let actor = safetensors::serialize(actor, None)?;
    Ok(json!({ "name": name, "run": run, "weights": STANDARD.encode(actor) }))
}

fn deflated(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    encoder.finish()
}

fn read(path: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(path).map_err(|error| format!("cannot read `{}`: {error}", path.display()))
}
