//! The scenario editor. The page edits the texts of a scenario file and its unit files; this side checks
//! them, places the units, plays battles, and saves. It keeps no state of a page. The files of a scenario
//! travel as [`ScenarioFiles`](smaclite_scenarios::ScenarioFiles).

mod check;
mod play;
mod standard;
mod target;

pub(crate) use target::Start;

use super::{App, Page, Request};
use serde::de::DeserializeOwned;
use serde_json::Value;
use smaclite_view::page::edit_html;

/// The editor of one command.
pub(crate) struct Editor {
    start: Start,
}

impl Editor {
    pub(crate) fn new(start: Start) -> Editor {
        Editor { start }
    }

    fn respond(&self, request: &Request) -> Result<Value, EditorError> {
        match request.action.as_str() {
            "standard" => Ok(standard::standard()),
            "open" => Ok(self.start.open()?),
            "check" => Ok(check::check(arguments(request)?)),
            "play" => Ok(play::play(arguments(request)?)?),
            "save" => Ok(self.start.save(arguments(request)?)?),
            other => Err(EditorError::UnknownRequest(other.to_owned())),
        }
    }
}

impl App for Editor {
    fn document(&self) -> String {
        edit_html()
    }

    fn talk(&self, page: Page) {
        while let Ok(Some(request)) = page.receive(None) {
            let answered = match self.respond(&request) {
                Ok(answer) => page.answer(&request, answer),
                Err(error) => page.refuse(&request, error),
            };
            if answered.is_err() {
                return;
            }
        }
    }
}

/// Why a request is refused.
#[derive(Debug, thiserror::Error)]
enum EditorError {
    #[error("unknown request `{0}`; the requests are standard, open, check, play and save")]
    UnknownRequest(String),
    #[error("`{action}`: {error}")]
    Arguments { action: String, error: serde_json::Error },
    #[error(transparent)]
    Play(#[from] play::PlayError),
    #[error(transparent)]
    Target(#[from] target::TargetError),
}

fn arguments<T: DeserializeOwned>(request: &Request) -> Result<T, EditorError> {
    let arguments = Value::Object(request.arguments.clone());
    serde_json::from_value(arguments)
        .map_err(|error| EditorError::Arguments { action: request.action.clone(), error })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn requests_that_cannot_be_understood_are_refused() {
        let editor = Editor::new(Start::New);
        let files = json!({"source": "s.json", "text": "{", "unit_files": []});
        let check = |request: Value, expected: &str| {
            let request: Request = serde_json::from_value(request).unwrap();
            let error = editor.respond(&request).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        };
        check(json!({"id": 1, "do": "delete"}), "unknown request `delete`; the requests are standard, open,");
        check(json!({"id": 2, "do": "check", "files": files}), "`check`: missing field `groups`");
        check(
            json!({"id": 3, "do": "check", "files": 3, "groups": []}),
            "`check`: invalid type: integer `3`",
        );
        let play =
            json!({"id": 4, "do": "play", "files": files, "policy": "nearest", "seed": 1, "rules": "paper"});
        check(play, "`play`: invalid type: integer `1`, expected a string");
        check(json!({"id": 5, "do": "save", "files": files, "replace": true}), "the command names no file");
    }
}
