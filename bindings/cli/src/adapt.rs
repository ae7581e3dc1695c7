//! `smaclite-pool adapt`: write a team that plays every map as a team of one map.

use super::files::refuse_file;
use super::{CommandResult, completions};
use crate::check::warn_of;
use clap::Args;
use smaclite_learn::{RunDescription, Weights, adapt_team, resolve_scenario};
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "\
The folder plays wherever that of a run does: in the playground, in `play`, and on maps whose two
sides have equal sizes in tournaments and as an opponent. It has no checkpoint, so its training
cannot be continued:
  smaclite-pool train --maps 3m,8m,2s3z,MMM --out runs/four
  smaclite-pool adapt runs/four 3s5z --out runs/four-on-3s5z
  smaclite-pool tournament runs/four-on-3s5z kite")]
pub(super) struct Adapt {
    /// Folder of a run of `train --maps` or `train --network universal`
    folder: PathBuf,
    /// The map that it is to play: a standard scenario or a scenario file
    #[arg(value_name = "MAP", add = completions::scenario())]
    map: String,
    /// The folder that is written; must not hold a run
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Which weights: best (of the best evaluation, if the run was evaluated) or last [default: best, if
    /// there are some]
    #[arg(long, value_name = "best|last")]
    weights: Option<Weights>,
}

impl Adapt {
    pub(super) fn run(self) -> CommandResult {
        let Adapt { folder, map, out, weights } = self;
        let run = RunDescription::read(&folder)?;
        let setup = resolve_scenario(&map, run.setup.rules)?;
        warn_of(&setup);
        refuse_file("--out", &out)?;
        adapt_team(&folder, weights, setup, &out)?;
        let out = out.display();
        out!("{out}: the team of {}, which plays {map}; smaclite-pool evaluate {out}", folder.display())?;
        Ok(())
    }
}
