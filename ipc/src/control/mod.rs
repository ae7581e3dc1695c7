//! The control plane: who may attach, what a lane is, how it goes. JSON lines over a Unix socket, because the
//! kernel tells both ends at once when the other dies, however it died, and says which process it is. Batches
//! never come this way.

pub(crate) mod client;
pub mod protocol;
pub(crate) mod server;
