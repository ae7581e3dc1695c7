//! What the end of a process costs.

use super::*;
use crate::checkpoint::Progress;
use crate::setups::resolve_scenario;
use smaclite_engine::Rules;
use smaclite_ipc::RuntimeDir;
use std::time::{Duration, Instant};

/// Checkpoints were written after updates alone: who killed a run in its final episodes lost all that it had
/// learnt in the minute before them, and they can take as long again.
#[test]
fn a_run_that_is_killed_in_an_evaluation_has_learnt_what_was_due() {
    let folder = tempfile::tempdir().unwrap();
    let runtime_dir = RuntimeDir::at(folder.path().join("pools")).unwrap();
    let (path, setup) = (folder.path().join("run"), resolve_scenario("3m", Rules::default()).unwrap());
    let small = Config { num_envs: 4, horizon: 8, minibatches: 2, hidden: vec![8], ..Config::for_agents(3) };
    let config = Config { steps: 90, evaluate_every: Some(45), last_actions: 0, ..small };
    let lanes = || Lanes::start(&setup, config.num_envs, 0, 1, &runtime_dir).unwrap();
    let resume = || Run::resume(&path, None, lanes(), 1).unwrap();
    let stop = |run: &mut Run| {
        let stopped = run.update(&mut || true);
        assert!(matches!(stopped, Err(TrainError::Client(ClientError::Interrupted))), "{stopped:?}");
    };
    let mut run = Run::begin(&path, config.clone(), &setup, lanes(), 1).unwrap();
    // The first evaluation is before the first update: there is nothing to keep.
    run.checkpoints.next = Instant::now();
    let first = std::fs::metadata(path.join(CHECKPOINT)).unwrap().modified().unwrap();
    stop(&mut run);
    assert_eq!(std::fs::metadata(path.join(CHECKPOINT)).unwrap().modified().unwrap(), first);
    let saved = || Progress::read(&path.join(CHECKPOINT)).unwrap().steps;
    for (due, rows) in [(45, 1), (90, 3)] {
        run.checkpoints.next = Instant::now() + Duration::from_secs(3600);
        while run.record().steps < due {
            run.update(&mut || false).unwrap();
        }
        // In the second evaluation, and in the final episodes after the third.
        let evaluations = path.join("evaluations.csv");
        let played = || std::fs::read_to_string(&evaluations).unwrap().lines().count() - 1;
        assert!(run.update(&mut || played() == rows).is_err());
        let trained = run.record().steps;
        assert!(saved() < trained, "it was not due");
        run.checkpoints.next = Instant::now();
        stop(&mut run);
        assert_eq!((saved(), played()), (trained, rows));
    }
    let trained = run.record().steps;
    drop(run);
    assert_eq!(resume().record().steps, trained);
}
