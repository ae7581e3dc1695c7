//! The documents of the pages: what is in this folder, together with the battle player of `smaclite_view`.
//! How their scripts talk with this program is in `protocol`.

use serde_json::Value;
use smaclite_playground::{EngineOf, Page};
use smaclite_view::page::{Document, Module};

/// The content security policy of these pages: as that of a replay, but they may connect to the server that
/// they came from.
pub(super) const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
    img-src data:; connect-src 'self'; frame-src 'self'";

/// Where the playground is beside the editor, and the editor beside the playground.
pub(super) const PLAYGROUND_PATH: &str = "/play/";
pub(super) const EDITOR_PATH: &str = "/edit/";

macro_rules! modules {
    ($($path:literal),+ $(,)?) => {
        &[$(Module { path: $path, text: include_str!($path) }),+]
    };
}

const MODULES: &[Module] =
    modules!["connection.js", "watch/follow.js", "watch/grid.js", "watch/plots.js", "watch/watch.js",];

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

const PLAYGROUND: &[Module] = modules!["connection.js", "program_engine.js", "program_playground.js"];
const EDITOR: &[Module] = modules!["connection.js", "program_engine.js", "program_editor.js"];

/// The playground, with its engine in this program.
pub(super) fn playground(page: &Page) -> String {
    page.html(EngineOf::Program(PLAYGROUND), POLICY, EDITOR_PATH)
}

/// The scenario editor. Its battles are played by the playground, in a frame.
pub(super) fn editor() -> String {
    Page::Editor.html(EngineOf::Program(EDITOR), POLICY, PLAYGROUND_PATH)
}
