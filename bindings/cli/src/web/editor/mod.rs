//! The scenario editor: a page of the playground's session, and the files that this program opens and saves
//! for it.

mod target;

pub(crate) use target::Start;

use super::protocol::{PageRequest, PageResponse};
use super::{App, LARGEST_FILES, Page, pages};
use smaclite_playground::Session;

/// The editor of one command.
pub(crate) struct Editor {
    start: Start,
}

impl Editor {
    pub(crate) fn new(start: Start) -> Editor {
        Editor { start }
    }

    fn respond(&self, session: &mut Session, request: PageRequest) -> Result<PageResponse, EditorError> {
        Ok(match request {
            PageRequest::Session { request } => PageResponse::Session { outcome: session.answer(request) },
            PageRequest::OpenFiles {} => PageResponse::OpenFiles(self.start.open()?),
            PageRequest::SaveFiles(save) => PageResponse::SaveFiles(self.start.save(save)?),
            _ => return Err(EditorError::OtherPage),
        })
    }
}

impl App for Editor {
    fn document(&self) -> String {
        pages::editor()
    }

    fn max_message(&self) -> usize {
        LARGEST_FILES
    }

    fn run(&self, page: Page) {
        let mut session = Session::default();
        while let Ok(Some(message)) = page.receive(None) {
            if page.respond(message.id, self.respond(&mut session, message.request)).is_err() {
                return;
            }
        }
    }
}

/// Why a request is refused.
#[derive(Debug, thiserror::Error)]
enum EditorError {
    #[error("this request is one of another page")]
    OtherPage,
    #[error(transparent)]
    Target(#[from] target::TargetError),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::web::protocol::{Base, SaveFiles};
    use smaclite_scenarios::ScenarioFiles;

    #[test]
    fn requests_that_cannot_be_carried_out_are_refused() {
        let editor = Editor::new(Start::New);
        let check = |request: PageRequest, expected: &str| {
            let error = editor.respond(&mut Session::default(), request).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        };
        check(PageRequest::Unfollow {}, "one of another page");
        let files = ScenarioFiles { source: "s.json".into(), text: "{".into(), unit_files: Vec::new() };
        let save = SaveFiles { files, base: Base::new(), replace: true };
        check(PageRequest::SaveFiles(save), "the command names no file");
    }
}
