//! The playground, whose engine is this program: each open page has a session of its own, on its thread.

use super::protocol::{PageRequest, PageResponse};
use super::{App, Page, pages};
use serde::Deserialize;
use serde_json::value::RawValue;
use serde_json::{Value, json};
use smaclite_playground::{Session, Start, TeamFiles};

/// The playground with the teams and the battle of one command.
pub(crate) struct Playground {
    pub(crate) teams: Vec<TeamFiles>,
    pub(crate) start: Start,
}

/// A request that was not carried out.
#[derive(Deserialize)]
struct Refused {
    error: String,
}

impl Playground {
    /// Says why its battle cannot begin, before a page is opened.
    pub(crate) fn check(&self) -> Result<(), String> {
        let Value::Object(mut of) = self.start.first.clone() else { return Ok(()) };
        let taken = of.remove("taken");
        of.insert("kind".to_owned(), json!("scenario"));
        let begin =
            json!({"type": "begin_battle", "of": of, "team": "nearest", "actions": [], "taken": taken});
        let add = |team: &TeamFiles| {
            let mut add = json!(team);
            add["type"] = json!("add_team");
            add
        };
        let mut session = Session::default();
        for request in self.teams.iter().map(add).chain([begin]) {
            let outcome = session.respond_json(request.to_string().as_bytes());
            if let Ok(Refused { error }) = serde_json::from_str(&outcome) {
                return Err(error);
            }
        }
        Ok(())
    }
}

impl App for Playground {
    fn document(&self) -> String {
        pages::playground(&self.teams, &self.start)
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
