//! Makes the pages of the playground and of the editor, `battle.html` and `editor.html` in a folder:
//! documents with the engine and the scripts inside, the playground also with trained teams, so that they
//! work without a network.
//!
//!     smaclite-playground ENGINE.wasm FOLDER [TEAM...]
//!
//! A team is a folder that `smaclite-pool train` wrote; the page calls it by the folder's name.
//! `just playground` runs this.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use serde_json::json;
use smaclite_playground::{EngineOf, Page, TeamFiles};
use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// As that of a replay, but they may run the engine, and the editor shows the playground.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; \
    style-src 'unsafe-inline'; img-src data:; frame-src 'self' file:";

const PLAYGROUND: &str = "battle.html";
const EDITOR: &str = "editor.html";

/// The weights of a run that play, the best ones first. In self-play it is the other way round, and such
/// teams are opened on the page (`page/files.js`).
const WEIGHTS: [&str; 2] = ["best.safetensors", "weights.safetensors"];

fn main() -> ExitCode {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [engine, folder, teams @ ..] = &arguments[..] else {
        eprintln!("usage: smaclite-playground ENGINE.wasm FOLDER [TEAM...]");
        return ExitCode::from(2);
    };
    match write_pages(engine, folder, teams) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("smaclite-playground: {error}");
            ExitCode::FAILURE
        }
    }
}

fn write_pages(engine: &Path, folder: &Path, teams: &[PathBuf]) -> Result<(), Box<dyn Error>> {
    let code = read(engine)?;
    let teams = teams.iter().map(|folder| team(folder)).collect::<Result<Vec<TeamFiles>, _>>()?;
    let compressed = deflated(&code)?;
    println!("engine: {} KB, compressed {} KB", code.len() / 1000, compressed.len() / 1000);
    let engine = STANDARD.encode(&compressed);
    let playground = Page::Playground { teams, first: json!({}), has_fog: false, can_share: true };
    for (name, page, other) in [(PLAYGROUND, playground, EDITOR), (EDITOR, Page::Editor, PLAYGROUND)] {
        let html = page.html(EngineOf::Page(&engine), POLICY, other);
        let path = folder.join(name);
        std::fs::write(&path, &html)
            .map_err(|error| format!("cannot write `{}`: {error}", path.display()))?;
        println!("{}: {} KB", path.display(), html.len() / 1000);
    }
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
