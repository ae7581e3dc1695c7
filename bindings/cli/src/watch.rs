//! `smaclite-pool watch`: a page in the browser that shows the battles of a running pool.

use crate::list::given_or_only_pool;
use crate::web::live::Live;
use crate::web::{ServeOptions, serve};
use crate::{CommandResult, completions, runtime_dir};
use clap::Args;
use smaclite_ipc::{ControlError, WaitOptions, status};

#[derive(Args)]
#[command(after_help = "Examples:\n  smaclite-pool watch train --open\n  \
    smaclite-pool watch train --lane hard --port 8000\n\n\
    From another machine: ssh -L 8000:127.0.0.1:8000 HOST, then open the printed URL here.\n\n\
    Open pages find a program that is started again with the same --port and, in the environment variable \
    SMACLITE_POOL_TOKEN, the same token of at least 32 letters and digits.")]
pub(super) struct Watch {
    /// Name of the pool [default: the only one that runs]
    #[arg(add = completions::pool())]
    pool: Option<String>,
    /// Lane to show first [default: the pool's first lane]
    #[arg(long)]
    lane: Option<String>,
    #[command(flatten)]
    serve: ServeOptions,
}

impl Watch {
    pub(super) fn run(self) -> CommandResult {
        let runtime_dir = runtime_dir()?;
        let pool = given_or_only_pool(self.pool, &runtime_dir)?;
        let lanes = status(&runtime_dir, &pool, WaitOptions::for_response())?.lanes;
        let mut lanes = lanes.into_iter().map(|lane| lane.description.lane).collect::<Vec<_>>();
        let lane = match self.lane {
            Some(lane) if lanes.contains(&lane) => lane,
            Some(lane) => return Err(ControlError::NoSuchLane { lane, lanes }.into()),
            None => lanes.swap_remove(0), // a pool has a lane
        };
        serve(&self.serve, Live::new(runtime_dir, pool, lane))
    }
}
