//! The documents of the pages: their scripts, and what they begin with.

use crate::protocol::TeamFiles;
use serde_json::{Value, json};
use smaclite_view::page::{Document, Module};

macro_rules! modules {
    ($($name:literal),+ $(,)?) => {
        &[$(Module { path: concat!("playground/", $name), text: include_str!(concat!("../page/", $name)) }),+]
    };
}

const MODULES: &[Module] = modules![
    "choices.js",
    "editor/agreement.js",
    "editor/arena.js",
    "editor/commands.js",
    "editor/document.js",
    "editor/editor.js",
    "editor/fields.js",
    "editor/files.js",
    "editor/formats.js",
    "editor/groups.js",
    "editor/handles.js",
    "editor/history.js",
    "editor/json.js",
    "editor/map.js",
    "editor/problems.js",
    "editor/reader.js",
    "editor/squares.js",
    "editor/start.js",
    "editor/text.js",
    "editor/tools.js",
    "editor/types.js",
    "editor/wasm.js",
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

/// A page of this crate.
#[derive(Clone, Debug)]
pub enum Page {
    /// A battle, and what it can be played with.
    Playground {
        /// Trained teams.
        teams: Vec<TeamFiles>,
        /// What a battle is played with where no link says it: keys of `SharedBattle` in `page/link.js`.
        first: Value,
        /// Whether what no agent sees is hidden.
        has_fog: bool,
        /// Whether a link to a battle opens in other browsers.
        can_share: bool,
    },
    /// The editor of a scenario and its unit files.
    Editor,
}

/// Where the engine of a page is.
#[derive(Clone, Copy, Debug)]
pub enum EngineOf<'a> {
    /// In the page: WebAssembly, compressed by deflate, in base64.
    Page(&'a str),
    /// In the program that serves the page. These modules connect to it; the last one starts the page.
    Program(&'a [Module]),
}

impl Page {
    /// The page as HTML. `other` is the address of the other page: the playground plays what is edited, the
    /// editor edits what is played.
    pub fn html(&self, engine: EngineOf<'_>, policy: &str, other: &str) -> String {
        let (code, modules) = match engine {
            EngineOf::Page(code) => (Some(code), &[][..]),
            EngineOf::Program(modules) => (None, modules),
        };
        let mut data = json!({"engine": code, "other": other});
        let (title, style, body, own_entry) = match self {
            Page::Playground { teams, first, has_fog, can_share } => {
                data["teams"] = json!(teams);
                data["first"] = json!(first);
                data["has_fog"] = json!(has_fog);
                data["can_share"] = json!(can_share);
                let (style, body) =
                    (include_str!("../page/playground.css"), include_str!("../page/playground.html"));
                ("Playground", style, body, "playground/wasm.js")
            }
            Page::Editor => {
                let style = include_str!("../page/editor/editor.css");
                (
                    "Scenario editor",
                    style,
                    include_str!("../page/editor/editor.html"),
                    "playground/editor/wasm.js",
                )
            }
        };
        let entry = modules.last().map_or(own_entry, |module| module.path);
        let modules = &[MODULES, modules].concat();
        Document { title, policy, style, body, modules, entry, data: &data }.html()
    }
}
