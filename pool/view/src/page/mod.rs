//! The pages that show battles in a browser: each one HTML document with styles, scripts and data inside.
//!
//! Their parts are in `pool/view/page`, written by hand, and used as they are. They load nothing from a
//! network, and their content security policy forbids it. The page of a replay needs nothing else; the live
//! page talks over a WebSocket with the program that serves it.

mod data;

use serde_json::{Value, json};

pub use data::{encode_moments, encode_step, scenario_info};

use crate::{Replay, ReplayError};

/// What the page of a replay may load: nothing.
macro_rules! policy {
    () => {
        "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"
    };
}

/// The content security policy of pages that talk with the server that they came from.
pub const CONNECTED_POLICY: &str = concat!(policy!(), "; connect-src 'self'");

const TEMPLATE: &str = include_str!("../../page/page.html");
const STYLE: &str = include_str!("../../page/style.css");

/// The scripts that show a battle, in the order in which they depend on each other.
const BATTLE_SCRIPTS: [&str; 5] = [
    include_str!("../../page/track.js"),
    include_str!("../../page/theme.js"),
    include_str!("../../page/terrain.js"),
    include_str!("../../page/effects.js"),
    include_str!("../../page/battle.js"),
];

/// The scripts that play a battle, by mouse and keyboard, in the elements of [`PLAYER_PARTS`].
const PLAYER_SCRIPTS: [&str; 4] = [
    include_str!("../../page/chart.js"),
    include_str!("../../page/inspector.js"),
    include_str!("../../page/transport.js"),
    include_str!("../../page/player.js"),
];

/// The elements that the scripts of a player use; a body names them as `{{name}}`.
const PLAYER_PARTS: [(&str, &str); 3] = [
    ("stage", include_str!("../../page/stage.html")),
    ("details", include_str!("../../page/details.html")),
    ("transport", include_str!("../../page/transport.html")),
];

/// A page that plays a replay, and needs no other file. It is checked while it is made: all of its episodes
/// are played by this version.
///
/// # Errors
/// As [`Replay::verify`].
pub fn export_html(replay: &Replay) -> Result<String, ReplayError> {
    let n_episodes = replay.episodes().len();
    let episodes =
        (0..n_episodes).map(|episode| data::episode(replay, episode)).collect::<Result<Vec<_>, _>>()?;
    let scenario = replay.scenario();
    let data = json!({
        "program": replay.program(),
        "rules": replay.setup().rules.to_string(),
        "scenario": scenario_info(scenario, replay.arena()),
        "episodes": episodes,
    });
    let document = Document {
        title: &format!("{} replay", scenario.name),
        policy: policy!(),
        body: include_str!("../../page/replay.html"),
        scripts: &[include_str!("../../page/replay.js")],
        data: &data,
    };
    Ok(document.html())
}

/// The page that watches a running pool. `data` is what its scripts find in the document.
pub fn watch_html(title: &str, data: &Value) -> String {
    let document = Document {
        title,
        policy: CONNECTED_POLICY,
        body: include_str!("../../page/watch.html"),
        scripts: &[
            include_str!("../../page/connection.js"),
            include_str!("../../page/grid.js"),
            include_str!("../../page/plots.js"),
            include_str!("../../page/follow.js"),
            include_str!("../../page/watch.js"),
        ],
        data,
    };
    document.html()
}

/// The parts of a page with a battle player.
struct Document<'a> {
    title: &'a str,
    policy: &'a str,
    /// What is in the body; it may name [`PLAYER_PARTS`].
    body: &'a str,
    /// Scripts after those of the player; the last one starts the page.
    scripts: &'a [&'a str],
    data: &'a Value,
}

impl Document<'_> {
    fn html(&self) -> String {
        let scripts = BATTLE_SCRIPTS.iter().chain(&PLAYER_SCRIPTS).chain(self.scripts);
        let scripts = scripts.copied().collect::<Vec<_>>().join("\n");
        // Inside a script element only `<` can end the text early, and JSON may write it by its code.
        let data = self.data.to_string().replace('<', "\\u003c");
        let title = escaped(self.title);
        let mut page = String::with_capacity(TEMPLATE.len() + STYLE.len() + scripts.len() + data.len());
        let own = [
            ("policy", self.policy),
            ("title", &title),
            ("style", STYLE),
            ("body", self.body),
            ("scripts", &scripts),
            ("data", &data),
        ];
        fill(TEMPLATE, &own, &mut page);
        page
    }
}

/// Appends a template. The value of `{{body}}` is a template too, of [`PLAYER_PARTS`]; other values are not.
fn fill(template: &str, values: &[(&str, &str)], page: &mut String) {
    let mut rest = template;
    while let Some((before, (name, after))) =
        rest.split_once("{{").and_then(|(before, tail)| Some((before, tail.split_once("}}")?)))
    {
        page.push_str(before);
        match values.iter().find(|(other, _)| *other == name) {
            Some(("body", body)) => fill(body, &PLAYER_PARTS, page),
            Some((_, value)) => page.push_str(value),
            None => debug_assert!(false, "no part of a page is named {name}"),
        }
        rest = after;
    }
    page.push_str(rest);
}

/// A text as HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
