//! How tests wait for what must happen.

use std::time::{Duration, Instant};

/// Limit for everything that normally takes less than a second, so that it also holds on a busy machine. No
/// test waits this long for something that must not happen.
pub const TIMEOUT: Duration = Duration::from_secs(15);

/// Whether the condition becomes true within [`TIMEOUT`].
pub fn eventually(condition: impl FnMut() -> bool) -> bool {
    eventually_within(TIMEOUT, condition)
}

/// Whether the condition becomes true within `time`.
pub fn eventually_within(time: Duration, mut condition: impl FnMut() -> bool) -> bool {
    let begin = Instant::now();
    loop {
        if condition() {
            return true;
        }
        if begin.elapsed() > time {
            return false;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}
