//! Independent jobs on several threads. The jobs and what each one computes do not depend on the number of
//! threads or on which thread runs which job; only the time does.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// The jobs were interrupted, and not all were run.
#[derive(Debug, PartialEq, Eq)]
pub struct Interrupted;

/// Runs `work` on every job. Each thread has one workspace, so there are as many threads as workspaces; the
/// calling thread is one of them, and asks before each of its jobs whether to stop.
///
/// The threads live for one call. Starting one costs some 20 us, and a call works for milliseconds.
///
/// # Errors
/// If `interrupted` returned true.
pub fn run<J: Send, W: Send>(
    jobs: impl Iterator<Item = J> + Send,
    workspaces: &mut [W],
    interrupted: &mut dyn FnMut() -> bool,
    work: impl Fn(J, &mut W) + Sync,
) -> Result<(), Interrupted> {
    let (queue, is_stopped) = (Mutex::new(jobs), AtomicBool::new(false));
    let next = || queue.lock().unwrap_or_else(std::sync::PoisonError::into_inner).next();
    let drain = |workspace: &mut W| {
        while !is_stopped.load(Relaxed)
            && let Some(job) = next()
        {
            work(job, workspace);
        }
    };
    let Some((own, others)) = workspaces.split_first_mut() else { return Ok(()) };
    std::thread::scope(|scope| {
        for workspace in others {
            // Without another thread, those that are there run all jobs.
            if std::thread::Builder::new().spawn_scoped(scope, || drain(workspace)).is_err() {
                break;
            }
        }
        while let Some(job) = next() {
            if interrupted() {
                is_stopped.store(true, Relaxed);
                break;
            }
            work(job, own);
        }
    });
    if is_stopped.into_inner() { Err(Interrupted) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_job_runs_once() {
        for threads in [1, 3] {
            let mut jobs = vec![0; 100];
            let mut counts = vec![0; threads];
            let all = run(jobs.iter_mut(), &mut counts, &mut || false, |job, count| {
                *job += 1;
                *count += 1;
            });
            assert_eq!(all, Ok(()));
            assert_eq!(jobs, [1; 100]);
            assert_eq!(counts.iter().sum::<usize>(), 100);
        }
    }

    #[test]
    fn an_interruption_ends_the_jobs_of_all_threads() {
        for threads in [1, 3] {
            let mut asked = 0;
            let mut interrupted = || {
                asked += 1;
                asked == 3
            };
            let endless = std::iter::repeat(());
            let ended = run(endless, &mut vec![(); threads], &mut interrupted, |(), ()| {});
            assert_eq!(ended, Err(Interrupted));
        }
    }
}
