//! The logs of a run: one row or one event per update.

mod csv;
mod tensorboard;

pub(crate) use csv::{CsvLog, KeptLines};
pub(crate) use tensorboard::TensorBoardLog;
