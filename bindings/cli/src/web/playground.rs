//! The playground, whose engine is this program: each open page has a session of its own, on its thread.

use super::protocol::{PageRequest, PageResponse};
use super::{App, Page, pages};
use crate::zoo::team_files;
use serde::Deserialize;
use serde_json::value::RawValue;
use serde_json::{Value, json};
use smaclite_playground::{Page as Document, Session, TeamFiles};
use std::path::Path;

/// The playground of one command.
pub(crate) struct Playground(Document);

/// A request that was not carried out.
#[derive(Deserialize)]
struct Refused {
    error: String,
}

impl Playground {
    /// The battle of `first`, in which a person has the agents of `taken`, and sees what they see.
    ///
    /// # Errors
    /// If the battle cannot begin.
    pub(crate) fn of_battle(teams: Vec<TeamFiles>, first: Value) -> Result<Playground, String> {
        let mut of = first.clone();
        of["kind"] = json!("scenario");
        let begin = json!({
            "type": "begin_battle", "of": of, "team": "nearest", "actions": [], "taken": first["taken"],
        });
        let add = |team: &TeamFiles| {
            let mut add = json!(team);
            add["type"] = json!("add_team");
            add
        };
        let mut session = Session::default();
        for request in teams.iter().map(add).chain([begin]) {
            let outcome = session.respond_json(request.to_string().as_bytes());
            if let Ok(Refused { error }) = serde_json::from_str(&outcome) {
                return Err(error);
            }
        }
        Ok(Playground(Document::Playground { teams, first, has_fog: true, can_share: false }))
    }

    /// What plays the scenarios of the editor: a team has the agents.
    pub(super) fn beside_editor() -> Result<Playground, Box<dyn std::error::Error>> {
        let teams = vec![team_files(Path::new("zoo:all-maps"), "all-maps")?];
        Ok(Playground(Document::Playground { teams, first: json!({}), has_fog: false, can_share: false }))
    }
}

impl App for Playground {
    fn document(&self) -> String {
        pages::playground(&self.0)
    }

    /// Replays and teams.
    fn max_message(&self) -> usize {
        1 << 26
    }

    fn run(&self, page: Page) {
        let mut session = Session::default();
        while let Ok(Some(message)) = page.receive(None) {
            let response = match message.request {
                PageRequest::Session { request } => respond(&mut session, &request),
                _ => Err("this request is one of another page".to_owned()),
            };
            if page.respond(message.id, response).is_err() {
                return;
            }
        }
    }
}

/// What a session responds to a request of its page.
pub(super) fn respond(session: &mut Session, request: &Value) -> Result<PageResponse, String> {
    let outcome = session.respond_json(request.to_string().as_bytes());
    let outcome = RawValue::from_string(outcome).map_err(|error| error.to_string())?;
    Ok(PageResponse::Session { outcome })
}
