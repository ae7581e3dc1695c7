//! How long a call may wait, and what may interrupt it.

use std::time::Duration;

/// How long a supervisor may take to answer if the caller sets no timeout. It answers at once, unless it is
/// stopped or overloaded.
pub(crate) const RESPONSE_TIMEOUT: Duration = Duration::from_secs(10);

/// How to wait.
pub struct WaitOptions<'a> {
    /// Give up after this long; `None` is no limit.
    pub timeout: Option<Duration>,
    /// Called at least every 100 ms while the caller waits; `true` ends the wait.
    pub interrupted: &'a mut dyn FnMut() -> bool,
}

impl<'a> WaitOptions<'a> {
    /// As long as a supervisor may take to answer, which is 10 seconds, or until the caller interrupts it.
    pub fn interrupted_by(interrupted: &'a mut dyn FnMut() -> bool) -> WaitOptions<'a> {
        WaitOptions { timeout: Some(RESPONSE_TIMEOUT), interrupted }
    }

    /// The same options, for one of several waits.
    pub fn reborrow(&mut self) -> WaitOptions<'_> {
        WaitOptions { timeout: self.timeout, interrupted: &mut *self.interrupted }
    }
}

impl WaitOptions<'static> {
    /// As long as a supervisor may take to answer, which is 10 seconds.
    pub fn for_response() -> Self {
        WaitOptions { timeout: Some(RESPONSE_TIMEOUT), ..WaitOptions::forever() }
    }

    /// Not at all: a timeout of zero.
    pub fn no_wait() -> Self {
        WaitOptions { timeout: Some(Duration::ZERO), ..WaitOptions::forever() }
    }

    /// No timeout and no interruption.
    pub fn forever() -> Self {
        // A closure that captures nothing takes no memory, so nothing leaks.
        WaitOptions { timeout: None, interrupted: Box::leak(Box::new(|| false)) }
    }
}
