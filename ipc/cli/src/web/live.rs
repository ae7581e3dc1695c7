//! The live page: the battles of a running pool.

use super::{App, Page};
use serde_json::json;
use smaclite_ipc::RuntimeDir;
use smaclite_view::page::watch_html;

/// What a live page shows.
pub(crate) struct Live {
    runtime_dir: RuntimeDir,
    pool: String,
    lane: String,
}

impl Live {
    pub(crate) fn new(runtime_dir: RuntimeDir, pool: String, lane: String) -> Live {
        Live { runtime_dir, pool, lane }
    }
}

impl App for Live {
    fn document(&self) -> String {
        watch_html(&self.pool, &json!({"pool": self.pool, "lane": self.lane}))
    }

    fn talk(&self, page: Page) {
        while let Ok(Some(request)) = page.receive(None) {
            let why = format!("there is no request `{}`", request.action);
            if page.refuse(&request, why).is_err() {
                return;
            }
        }
        let _ = &self.runtime_dir;
    }
}
