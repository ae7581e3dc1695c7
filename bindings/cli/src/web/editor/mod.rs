//! The scenario editor. The page edits the texts of a scenario file and its unit files; this side checks
//! them, places the units, plays battles, and saves. It keeps no state of a page. The files of a scenario
//! travel as [`ScenarioFiles`](smaclite_scenarios::ScenarioFiles).

mod builtins;
mod check;
mod play;

mod target;

pub(crate) use target::Start;

use super::protocol::{PageRequest, PageResponse};
use super::{App, Page, pages};

/// The editor of one command.
pub(crate) struct Editor {
    start: Start,
}

impl Editor {
    pub(crate) fn new(start: Start) -> Editor {
        Editor { start }
    }

    fn respond(&self, request: PageRequest) -> Result<PageResponse, EditorError> {
        Ok(match request {
            PageRequest::GetBuiltins {} => PageResponse::GetBuiltins(builtins::builtins()),
            PageRequest::OpenFiles {} => PageResponse::OpenFiles(self.start.open()?),
            PageRequest::CheckFiles { files, groups, seed } => {
                PageResponse::CheckFiles(check::check(&files, &groups, &seed))
            }
            PageRequest::PlayBattle(battle) => PageResponse::PlayBattle(play::play(battle)?),
            PageRequest::SaveFiles(save) => PageResponse::SaveFiles(self.start.save(save)?),
            _ => return Err(EditorError::OtherPage),
        })
    }
}

impl App for Editor {
    fn document(&self) -> String {
        pages::editor()
    }

    fn run(&self, page: Page) {
        while let Ok(Some(message)) = page.receive(None) {
            if page.respond(message.id, self.respond(message.request)).is_err() {
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
    Play(#[from] play::PlayError),
    #[error(transparent)]
    Target(#[from] target::TargetError),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::web::protocol::SaveFiles;
    use smaclite_scenarios::ScenarioFiles;

    #[test]
    fn requests_that_cannot_be_carried_out_are_refused() {
        let editor = Editor::new(Start::New);
        let check = |request: PageRequest, expected: &str| {
            let error = editor.respond(request).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        };
        check(PageRequest::Unfollow {}, "one of another page");
        let files = ScenarioFiles { source: "s.json".into(), text: "{".into(), unit_files: Vec::new() };
        check(PageRequest::SaveFiles(SaveFiles { files, replace: true }), "the command names no file");
    }
}
