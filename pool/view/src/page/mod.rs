//! The page that shows a replay in a browser: one HTML document with styles, scripts and data inside.
//!
//! Its parts are in `pool/view/page`, written by hand: modules of JavaScript, which `bundle` joins. The page
//! loads nothing, and its content security policy forbids it. Other pages that show battles are made of the
//! same parts, by [`Document`].

mod bundle;
mod data;

use serde_json::Value;

pub use bundle::Module;
pub use data::{
    Features, ScenarioInfo, TypeInfo, encode_moments, encode_step, features_info, scenario_info, types_info,
};

use bundle::{bundle, styles};
use data::ReplayData;

use crate::{Replay, ReplayError};

/// The content security policy of a page that needs nothing else: it runs the scripts inside, and loads
/// nothing. A script cannot import another one.
pub const POLICY: &str =
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:";

const TEMPLATE: &str = include_str!("../../page/page.html");
const STYLE: &str = include_str!("../../page/style.css");

macro_rules! modules {
    ($($name:literal),+ $(,)?) => {
        &[$(Module { path: concat!("view/", $name), text: include_str!(concat!("../../page/", $name)) }),+]
    };
}

/// The modules that show battles; pages import them as `#view/name.js`.
const MODULES: &[Module] = modules![
    "actions.js",
    "address.js",
    "battle.js",
    "brush.js",
    "camera.js",
    "chart.js",
    "commander.js",
    "controls.js",
    "dom.js",
    "effects.js",
    "frames.js",
    "inspector.js",
    "numbers.js",
    "observation.js",
    "play_view.js",
    "player.js",
    "replay.js",
    "selection.js",
    "squares.js",
    "terrain.js",
    "theme.js",
    "track.js",
    "transport.js",
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
    if n_episodes == 0 {
        return Err(ReplayError::NoEpisodes);
    }
    let episodes =
        (0..n_episodes).map(|episode| data::episode(replay, episode)).collect::<Result<Vec<_>, _>>()?;
    let scenario = replay.scenario();
    let data = ReplayData {
        program: replay.program().to_owned(),
        rules: replay.setup().rules.to_string(),
        scenario: scenario_info(scenario, replay.arena()),
        episodes,
    };
    let data = serde_json::to_value(data).unwrap_or_default(); // every value of it is valid JSON
    let document = Document {
        title: &format!("{} replay", scenario.name),
        policy: POLICY,
        style: "",
        body: include_str!("../../page/replay.html"),
        modules: &[],
        entry: "view/replay.js",
        data: &data,
    };
    Ok(document.html())
}

/// A page with a battle player.
#[derive(Clone, Copy, Debug)]
pub struct Document<'a> {
    /// The title of the window.
    pub title: &'a str,
    /// The content security policy.
    pub policy: &'a str,
    /// Rules after those of the player.
    pub style: &'a str,
    /// What is in the body; `{{stage}}`, `{{details}}` and `{{transport}}` are the elements of a player.
    pub body: &'a str,
    /// Modules besides those of the player, which are `#view/...`.
    pub modules: &'a [Module],
    /// The path of the module that starts the page.
    pub entry: &'a str,
    /// What the scripts find in the element `data`.
    pub data: &'a Value,
}

impl Document<'_> {
    /// The text of the document.
    pub fn html(&self) -> String {
        let scripts = bundle(self.entry, &[self.modules, MODULES]);
        // Inside a script element only `<` can end the text early, and JSON may write it by its code.
        let data = self.data.to_string().replace('<', "\\u003c");
        let title = escaped(self.title);
        let style = styles(&[STYLE, self.style]);
        let mut page = String::with_capacity(TEMPLATE.len() + style.len() + scripts.len() + data.len());
        let own = [
            ("policy", self.policy),
            ("title", &title),
            ("style", &style),
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
