//! The live page: the battles of a running pool. Nothing here writes to the pool.
//!
//! Each open page has a session on a thread; what pages have in common is read once for all of them: the
//! status of the pool, and the newest frame of a lane. While a page is hidden, its session waits.

mod battles;
mod cells;
mod episodes;
mod follow;
mod lane;
mod pool;
mod session;

use super::{App, Page, pages};
use pool::WatchedPool;
use serde_json::json;
use session::Session;
use smaclite_ipc::RuntimeDir;

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
        pages::watch(self.pool.name(), &json!({"pool": self.pool.name(), "lane": self.lane}))
    }

    fn run(&self, page: Page) {
        let _closed = Session::new(&self.pool, &page).run();
    }
}
