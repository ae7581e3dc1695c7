//! What the scenario editor asks: what is built in, and what is wrong with the files that it edits. The page
//! edits their texts; nothing of it is kept here. The files of a scenario travel as
//! [`ScenarioFiles`](smaclite_scenarios::ScenarioFiles).

mod builtins;
mod check;
mod protocol;

pub(crate) use builtins::builtins;
pub use builtins::new_scenario;
pub(crate) use check::check;
pub(crate) use protocol::*;
