//! The documents of the pages: what is in this folder, together with the battle player of `smaclite_view`.
//! How their scripts talk with this program is in `protocol`.

use serde_json::Value;
use smaclite_playground::{EngineOf, Start, TeamFiles};
use smaclite_view::page::{Document, Module};

/// The content security policy of these pages: as that of a replay, but they may connect to the server that
/// they came from.
pub(super) const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
    img-src data:; connect-src 'self'";

macro_rules! modules {
    ($($path:literal),+ $(,)?) => {
        &[$(Module { path: $path, text: include_str!($path) }),+]
    };
}

const MODULES: &[Module] = modules![
    "connection.js",
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
    "editor/message.js",
    "editor/problems.js",
    "editor/reader.js",
    "editor/squares.js",
    "editor/start.js",
    "editor/text.js",
    "editor/tools.js",
    "editor/types.js",
    "watch/follow.js",
    "watch/grid.js",
    "watch/plots.js",
    "watch/watch.js",
];

/// The page that watches a running pool. `data` is what its scripts find in the document.
pub(super) fn watch(title: &str, data: &Value) -> String {
    let document = Document {
        title,
        policy: POLICY,
        style: include_str!("watch/watch.css"),
        body: include_str!("watch/watch.html"),
        modules: MODULES,
        entry: "watch/watch.js",
        data,
    };
    document.html()
}

/// What the playground needs to have its engine in this program.
const PROGRAM_ENGINE: &[Module] = modules!["connection.js", "program_engine.js"];

/// The playground.
pub(super) fn playground(teams: &[TeamFiles], start: &Start) -> String {
    smaclite_playground::document(EngineOf::Program(PROGRAM_ENGINE), POLICY, teams, start)
}

/// The scenario editor. Its battles are played by pages of replays, each in a frame.
pub(super) fn editor() -> String {
    let document = Document {
        title: "Scenario editor",
        policy: POLICY,
        style: include_str!("editor/editor.css"),
        body: include_str!("editor/editor.html"),
        modules: MODULES,
        entry: "editor/editor.js",
        data: &Value::Null,
    };
    document.html()
}
