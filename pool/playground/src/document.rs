//! The document of the page: its scripts, and what they begin with.

use crate::protocol::TeamFiles;
use serde_json::Value;
use smaclite_view::page::{Document, Module};

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
    "wasm.js",
];

/// What a page begins with, beside its teams.
#[derive(Clone, Debug, Default)]
pub struct Start {
    /// What a battle is played with where no link says it: keys of `SharedBattle` in `page/link.js`.
    pub first: Value,
    /// Whether what no agent sees is hidden.
    pub has_fog: bool,
    /// Whether a link to a battle opens in other browsers.
    pub can_share: bool,
}

/// Where the engine of a page is.
#[derive(Clone, Copy, Debug)]
pub enum EngineOf<'a> {
    /// In the page: WebAssembly, compressed by deflate, in base64.
    Page(&'a str),
    /// In the program that serves the page. These modules connect to it; the last one starts the page.
    Program(&'a [Module]),
}

/// The page as HTML.
pub fn document(engine: EngineOf<'_>, policy: &str, teams: &[TeamFiles], start: &Start) -> String {
    let (code, others, entry) = match engine {
        EngineOf::Page(code) => (Some(code), &[][..], "playground/wasm.js"),
        EngineOf::Program(modules) => (None, modules, modules.last().map_or("", |module| module.path)),
    };
    let Start { first, has_fog, can_share } = start;
    let data = serde_json::json!({
        "engine": code, "teams": teams, "first": first, "has_fog": has_fog, "can_share": can_share,
    });
    let document = Document {
        title: "Playground",
        policy,
        style: include_str!("../page/playground.css"),
        body: include_str!("../page/playground.html"),
        modules: &[MODULES, others].concat(),
        entry,
        data: &data,
    };
    document.html()
}
