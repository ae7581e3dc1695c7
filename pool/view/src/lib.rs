//! Seeing battles: what happens in each tick ([`Moment`]), pictures of it ([`Renderer`]), recorded battles
//! ([`Replay`]), and the page that plays them ([`export_html`]); and what a person tells units ([`Orders`]).
//!
//! A battle is drawn from its [`Scenario`](smaclite_scenarios::Scenario), which no tick changes, and one
//! moment per tick. Nothing here knows of pools, processes, windows or sockets.

#![forbid(unsafe_code)]

mod from_state;
mod moment;
mod orders;
pub mod page;
mod picture;
mod render;
mod replay;

pub use moment::{Attack, AttackKind, Moment, Observer, UnitMoment};
pub use orders::{AgentOrder, Order, OrderError, Orders};
pub use page::export_html;
pub use picture::{Cell, EncodeError, Picture, Sheet, SizeError, write_gif};
pub use render::{Options, RECENT_TICKS, Renderer, Theme, View, type_letters};
pub use replay::{
    Episode, EpisodeResult, MAX_FILE_BYTES, MAX_JSON_BYTES, Outcome, PlayedStep, Player, Recorder, Replay,
    ReplayError, SUFFIX,
};
