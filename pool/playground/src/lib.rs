//! What answers the playground and the scenario editor, and their documents: battles without a pool.
//!
//! A page sends requests as JSON to a [`Session`], which has one battle at a time, and gets responses:
//! `protocol` declares both. Scripts or trained [teams](Team) play the agents, a person takes over some or
//! all of them, and every battle is a replay. In a page of its own the session is WebAssembly (`exports`; the
//! program of this crate makes the pages), in `smaclite-pool play` and `edit` a part of that program.
//!
//! ```
//! use smaclite_playground::Session;
//!
//! let mut session = Session::default();
//! let request = r#"{"type": "begin_battle", "team": "nearest", "actions": [], "taken": [],
//!     "of": {"kind": "scenario", "scenario": "3m", "seed": "1", "opponent": "", "rules": ""}}"#;
//! assert!(session.respond_json(request.as_bytes()).starts_with(r#"{"response":{"type":"begin_battle""#));
//! let request = r#"{"type": "play_steps", "steps": 1000}"#;
//! assert!(session.respond_json(request.as_bytes()).contains(r#""result":"won""#));
//! ```

#![forbid(unsafe_op_in_unsafe_fn)]

mod battle;
mod document;
mod editor;
#[cfg(target_family = "wasm")]
mod exports;
mod game;
mod layer;
mod network;
mod protocol;
mod session;
mod source;
mod team;
mod units_network;

pub use document::{EngineOf, Page};
pub use editor::new_scenario;
pub use protocol::TeamFiles;
pub use session::{Answer, Session};
pub use source::source_of;
pub use team::{Team, TeamError};
