//! The control plane: attaching, descriptions of lanes, status. JSON lines over a Unix socket, because the
//! kernel notifies either end at once when the other dies, and says which process it was. Batches do not
//! use it.

pub(crate) mod client;
pub mod protocol;
pub(crate) mod served_lane;
pub(crate) mod server;
