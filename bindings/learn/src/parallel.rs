//! Independent jobs on several threads. The jobs and what each one computes do not depend on the number of
//! threads or on which thread runs which job; only the time does.

use std::sync::Mutex;

/// Runs `work` on every job. Each thread has one workspace, so there are as many threads as workspaces; the
/// calling thread is one of them.
///
/// The threads live for one call. Starting one costs some 20 us, and a call works for milliseconds.
pub(crate) fn run<J: Send, W: Send>(
    jobs: impl Iterator<Item = J> + Send,
    workspaces: &mut [W],
    work: impl Fn(J, &mut W) + Sync,
) {
    let queue = Mutex::new(jobs);
    let next = || queue.lock().unwrap_or_else(std::sync::PoisonError::into_inner).next();
    let drain = |workspace: &mut W| {
        while let Some(job) = next() {
            work(job, workspace);
        }
    };
    let Some((own, others)) = workspaces.split_first_mut() else { return };
    std::thread::scope(|scope| {
        for workspace in others {
            scope.spawn(|| drain(workspace));
        }
        drain(own);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_job_runs_once() {
        for threads in [1, 3] {
            let mut jobs = vec![0; 100];
            let mut counts = vec![0; threads];
            run(jobs.iter_mut(), &mut counts, |job, count| {
                *job += 1;
                *count += 1;
            });
            assert_eq!(jobs, [1; 100]);
            assert_eq!(counts.iter().sum::<usize>(), 100);
        }
    }
}
