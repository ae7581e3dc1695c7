//! The live page: the battles of a running pool. Nothing here writes to the pool.
//!
//! Each open page has a conversation on a thread; what pages have in common is read once for all of them:
//! the status of the pool, and the newest frame of a lane. While a page is hidden, its conversation waits.

mod battles;
mod cells;
mod conversation;
mod episodes;
mod follow;
mod lane;
mod pool;
mod simulation;

use super::{App, Page};
use conversation::Conversation;
use pool::WatchedPool;
use serde_json::json;
use smaclite_ipc::RuntimeDir;
use smaclite_view::page::watch_html;

/// What a live page shows.
pub(crate) struct Live {
    pool: WatchedPool,
    lane: String,
}

impl Live {
    pub(crate) fn new(runtime_dir: RuntimeDir, pool: String, lane: String) -> Live {
        Live { pool: WatchedPool::new(runtime_dir, pool), lane }
    }
}

impl App for Live {
    fn document(&self) -> String {
        watch_html(self.pool.name(), &json!({"pool": self.pool.name(), "lane": self.lane}))
    }

    fn talk(&self, page: Page) {
        let _closed = Conversation::new(&self.pool, &page).run();
    }
}
