//! The page that shows battles in a browser: one HTML document with styles, scripts and data inside.
//!
//! Its parts are in `pool/view/page`, written by hand, and used as they are. It loads nothing from a network,
//! and its content security policy forbids it.

mod data;

use serde_json::{Value, json};

pub use data::{encode_moments, encode_step, scenario_info};

use crate::{Replay, ReplayError};

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

/// The scripts that play a replay; the last one starts it.
const REPLAY_SCRIPTS: [&str; 4] = [
    include_str!("../../page/chart.js"),
    include_str!("../../page/inspector.js"),
    include_str!("../../page/transport.js"),
    include_str!("../../page/replay.js"),
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
    let scripts: Vec<&str> = BATTLE_SCRIPTS.into_iter().chain(REPLAY_SCRIPTS).collect();
    Ok(document(&format!("{} replay", scenario.name), &scripts, &data))
}

/// Puts the parts of a page together.
fn document(title: &str, scripts: &[&str], data: &Value) -> String {
    // Inside a script element only `<` can end the text early, and JSON may write it by its code.
    let data = data.to_string().replace('<', "\\u003c");
    let mut page = String::with_capacity(TEMPLATE.len() + STYLE.len() + data.len() + 65536);
    let mut rest = TEMPLATE;
    while let Some((before, (name, after))) =
        rest.split_once("{{").and_then(|(before, tail)| Some((before, tail.split_once("}}")?)))
    {
        page.push_str(before);
        match name {
            "title" => page.push_str(&escaped(title)),
            "style" => page.push_str(STYLE),
            "scripts" => page.push_str(&scripts.join("\n")),
            "data" => page.push_str(&data),
            _ => {}
        }
        rest = after;
    }
    page.push_str(rest);
    page
}

/// A text as HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
