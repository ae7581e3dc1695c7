//! Processor time of a run. Runs in the same process share its processor time: while several are active, each
//! gets an equal part, and all parts together are the whole.

use cpu_time::ProcessTime;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What all timers of the process share.
struct Clock {
    /// Processor seconds of the process at the last change.
    read_at: f64,
    active: u32,
    /// The part of one active run so far, in seconds.
    part: f64,
}

static CLOCK: Mutex<Clock> = Mutex::new(Clock { read_at: 0.0, active: 0, part: 0.0 });

/// The clock, brought up to now.
fn clock() -> MutexGuard<'static, Clock> {
    let mut clock = CLOCK.lock().unwrap_or_else(PoisonError::into_inner);
    // Of all threads of this process; the time of a pool in another process is not in it.
    let now = ProcessTime::now().as_duration().as_secs_f64();
    if clock.active > 0 {
        clock.part += (now - clock.read_at) / f64::from(clock.active);
    }
    clock.read_at = now;
    clock
}

/// Measures what one run uses, from its start until it is dropped.
pub(crate) struct CpuTimer {
    begin: f64,
}

impl CpuTimer {
    pub fn start() -> CpuTimer {
        let mut clock = clock();
        clock.active += 1;
        CpuTimer { begin: clock.part }
    }

    /// Processor seconds since the start.
    pub fn seconds(&self) -> f64 {
        clock().part - self.begin
    }
}

impl Drop for CpuTimer {
    fn drop(&mut self) {
        clock().active -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests of this process train at the same time, so only an upper bound holds.
    #[test]
    fn runs_share_the_time_of_the_process() {
        let timers = [CpuTimer::start(), CpuTimer::start()];
        let before = timers.each_ref().map(CpuTimer::seconds);
        let work: f64 = (0..1_000_000).map(|i| f64::from(i).sqrt()).sum();
        let after = timers.each_ref().map(CpuTimer::seconds);
        assert!(work > 0.0);
        let parts = [after[0] - before[0], after[1] - before[1]];
        assert!(parts.iter().all(|part| *part > 0.0), "{parts:?}");
        assert!(parts.iter().sum::<f64>() <= clock().read_at, "{parts:?}");
    }
}
