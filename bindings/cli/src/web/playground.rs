//! The playground, whose engine is this program: each open page has a session of its own, on its thread.

use super::protocol::{PageRequest, PageResponse};
use super::{App, LARGEST_FILES, Page, pages};
use crate::zoo::team_files;
use serde_json::{Value, json};
use smaclite_playground::{Page as Document, Session, TeamFiles};
use std::path::Path;

/// The playground of one command.
pub(crate) struct Playground(Document);

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
            if let Some(error) = session.answer(request).error() {
                return Err(error.to_owned());
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

    fn max_message(&self) -> usize {
        LARGEST_FILES
    }

    fn run(&self, page: Page) {
        let mut session = Session::default();
        while let Ok(Some(message)) = page.receive(None) {
            let response = match message.request {
                PageRequest::Session { request } => {
                    Ok(PageResponse::Session { outcome: session.answer(request) })
                }
                _ => Err("this request is one of another page"),
            };
            if page.respond(message.id, response).is_err() {
                return;
            }
        }
    }
}
