//! Standard output, whose errors say that they are of it.

use crate::CommandResult;
use serde::Serialize;
use std::error::Error;
use std::io::{self, ErrorKind, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether the command goes on where its reader has closed standard output.
static GOES_ON: AtomicBool = AtomicBool::new(false);

/// Says whether the command that begins goes on where its reader has closed standard output. Most end then,
/// with success; one whose exit status is what it found would say that it found nothing.
pub(crate) fn go_on_if_closed(goes_on: bool) {
    GOES_ON.store(goes_on, Ordering::Relaxed); // publishes nothing else
}

/// Standard output. Unlike that of [`std::io::stdout`], an error names what could not be written.
pub(crate) struct Output;

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match io::stdout().write(bytes) {
            Err(error) if error.kind() == ErrorKind::BrokenPipe && GOES_ON.load(Ordering::Relaxed) => {
                Ok(bytes.len())
            }
            written => written.map_err(named),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stdout().flush().map_err(named)
    }
}

/// An error of standard output.
#[derive(Debug, thiserror::Error)]
#[error("standard output: {0}")]
struct OutputError(io::Error);

fn named(error: io::Error) -> io::Error {
    io::Error::new(error.kind(), OutputError(error))
}

/// Prints a value as one line of JSON.
pub(crate) fn print_json(value: &impl Serialize) -> CommandResult {
    out!("{}", serde_json::to_string(value)?)?;
    Ok(())
}

/// Whether this error is that the reader of standard output has closed it, as `| head` does. That of another
/// pipe is not.
pub(crate) fn is_closed(error: &(dyn Error + 'static)) -> bool {
    let error = error.downcast_ref::<io::Error>().filter(|error| error.kind() == ErrorKind::BrokenPipe);
    error.and_then(io::Error::get_ref).is_some_and(|inner| inner.is::<OutputError>())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A command whose other pipe broke, as that to ffmpeg, ended without a message and with status 0.
    #[test]
    fn only_standard_output_is_meant() {
        let broken = || io::Error::from(ErrorKind::BrokenPipe);
        assert!(is_closed(&named(broken())) && !is_closed(&broken()));
        assert!(!is_closed(&named(ErrorKind::StorageFull.into())));
    }
}
