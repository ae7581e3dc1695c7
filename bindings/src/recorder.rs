//! Recording battles of a pool: a follower, whose newest episodes can be written as a replay at any time.

use crate::convert::{IntArg, is_about_argument, to_unsigned};
use crate::errors::{class, client_error, connect_error, invalid_request};
use crate::exclusive::{Exclusive, Texts};
use crate::query::runtime_dir;
use crate::wait::{interruptible, run_on_thread};
use pyo3::exceptions::{PyOSError, PyRuntimeWarning};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use smaclite_ipc::{ClientError, WaitOptions};
use smaclite_recorder::PoolRecorder;
use smaclite_view::SUFFIX;
use std::ffi::CString;
use std::path::{Path, PathBuf};

/// The most episodes per environment that a recorder keeps.
const MAX_EPISODES: usize = 1000;

/// Writes the newest episodes, unless there is none: then it returns `false`.
fn save(recorder: &mut PoolRecorder, path: &Path, wait: WaitOptions<'_>) -> PyResult<bool> {
    match recorder.read(wait) {
        // What was received before the pool ended stays.
        Err(ClientError::PoolDied { .. }) if recorder.n_complete() > 0 => {}
        result => result.map_err(client_error)?,
    }
    let replay = recorder.replay(true).map_err(|error| class::PoolError::new_err(error.to_string()))?;
    if replay.episodes().is_empty() {
        return Ok(false);
    }
    replay.write(path).map_err(|error| PyOSError::new_err(error.to_string()))?;
    Ok(true)
}

/// Checks the suffix and the folder of a replay file.
fn check_replay_path(path: &Path) -> PyResult<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if path.extension().is_none_or(|suffix| suffix != SUFFIX) {
        return Err(invalid_request(format!("path must end in .{SUFFIX}, got '{}'", path.display())));
    }
    if !folder.is_dir() {
        let folder = folder.display();
        return Err(invalid_request(format!("path must be in a folder that exists; there is no '{folder}'")));
    }
    Ok(())
}

/// Records environments of a running pool: the newest episodes of each, without the learner noticing.
///
/// An episode that began before the recorder is left out. The pool keeps what the recorder has not read, in
/// 64 MiB for all recorded environments of a lane together, and drops the oldest episodes when that is full;
/// `save` and `n_complete` read it. `n_lost` is the number of episodes that were dropped unread. Files are
/// replays: `smaclite-pool replay FILE --to FILE.html` makes a page of one.
///
/// Only one thread may call a recorder at a time; a concurrent call raises Busy. After a fork, calls in the
/// child raise Forked.
///
/// Args:
///     pool: the pool's name: that of `smaclite-pool serve --name`, or `Envs.spec.pool`.
///     lane: the lane's name; it may be omitted if the pool has only one lane.
///     env_id: the id of an environment, or a list of at most 64 ids.
///     episodes: how many complete episodes to keep per environment, 1 to 1000.
///
/// Raises:
///     NoSuchPool: no pool of that name is running.
///     ConnectError: the pool has no such lane or environment, or too many followers, or none or more than 64
///         environments are named.
///     InvalidRequest: another argument is invalid.
#[pyclass(frozen, module = "smaclite_pool")]
pub struct Recorder {
    recorder: Exclusive<PoolRecorder>,
}

const TEXTS: Texts = Texts {
    closed: "this recorder is closed; make another one",
    busy: "another thread is using this recorder; only one thread may call it at a time",
    panicked: "an earlier call of this recorder panicked; make another one",
};

/// One id or a list of ids.
pub enum EnvIds {
    Several(Vec<IntArg>),
    One(IntArg),
}

impl FromPyObject<'_, '_> for EnvIds {
    type Error = PyErr;

    fn extract(arg: Borrowed<'_, '_, PyAny>) -> PyResult<EnvIds> {
        match arg.extract()? {
            // What is not an integer is a list of them, or an error that says so of the value itself.
            IntArg::Other(other) => match arg.extract::<Vec<IntArg>>() {
                Err(error) if is_about_argument(&error, arg.py()) => Ok(EnvIds::One(IntArg::Other(other))),
                ids => ids.map(EnvIds::Several),
            },
            one => Ok(EnvIds::One(one)),
        }
    }
}

impl Recorder {
    fn with<R: Send>(
        &self,
        py: Python<'_>,
        action: impl FnOnce(&mut PoolRecorder, WaitOptions<'_>) -> PyResult<R> + Send,
    ) -> PyResult<R> {
        let mut recorder = self.recorder.try_lock()?;
        let recorder = recorder.as_mut().expect("try_lock returns a guard only while it is open");
        interruptible(py, |interrupted| action(recorder, WaitOptions::interrupted_by(interrupted)))
    }
}

fn warn_of_missing(py: Python<'_>, missing: u64) -> PyResult<()> {
    let text = format!(
        "{missing} episodes are missing in the replay: they were dropped before they were read; read more \
         often (n_complete reads), or record fewer environments"
    );
    let text = CString::new(text).unwrap_or_default();
    PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &text, 1)
}

#[pymethods]
impl Recorder {
    #[new]
    #[pyo3(signature = (pool, lane=None, env_id=EnvIds::One(IntArg::Small(0)), *,
        episodes=IntArg::Small(100)))]
    #[pyo3(text_signature = "(pool, lane=None, env_id=0, *, episodes=100)")]
    fn new(
        py: Python<'_>,
        pool: String,
        lane: Option<String>,
        env_id: EnvIds,
        episodes: IntArg,
    ) -> PyResult<Recorder> {
        let env_ids = match env_id {
            EnvIds::One(id) => vec![id],
            EnvIds::Several(ids) => ids,
        };
        let env_ids = env_ids.into_iter().map(|id| to_unsigned("env_id", id));
        let env_ids = env_ids.collect::<PyResult<Vec<usize>>>()?;
        let episodes: usize = to_unsigned("episodes", episodes)?;
        if !(1..=MAX_EPISODES).contains(&episodes) {
            let text = format!("episodes must be between 1 and {MAX_EPISODES}, got {episodes}");
            return Err(invalid_request(text));
        }
        let runtime_dir = runtime_dir()?;
        let recorder = run_on_thread(py, move |cancelled| {
            let wait = WaitOptions::interrupted_by(cancelled);
            PoolRecorder::connect(&runtime_dir, &pool, lane.as_deref(), &env_ids, episodes, wait)
        })?;
        Ok(Recorder { recorder: Exclusive::new(recorder.map_err(connect_error)?, TEXTS) })
    }

    /// Number of complete episodes that were received since the recorder began; it keeps the newest. What was
    /// received stays when the pool ends.
    ///
    /// Raises:
    ///     PoolError: the pool did not answer within 10 seconds. Nothing is lost.
    #[getter]
    fn n_complete(&self, py: Python<'_>) -> PyResult<u64> {
        self.with(py, |recorder, wait| match recorder.read(wait) {
            Ok(()) | Err(ClientError::PoolDied { .. }) => Ok(recorder.n_complete()),
            Err(error) => Err(client_error(error)),
        })
    }

    /// Number of episodes that were lost since the recorder began, because they were not read in time. It
    /// does not read itself: `n_complete` and `save` do.
    #[getter]
    fn n_lost(&self, py: Python<'_>) -> PyResult<u64> {
        self.with(py, |recorder, _| Ok(recorder.n_lost()))
    }

    /// Write the kept episodes, including those that are not over, as a replay. A file of that name is
    /// replaced. If episodes are missing in it, because they were not read in time, a RuntimeWarning says how
    /// many.
    ///
    /// Args:
    ///     path: the file, `NAME.smreplay`.
    ///
    /// Raises:
    ///     InvalidRequest: no episode has begun, or the path has another suffix.
    ///     OSError: the file cannot be written.
    ///     PoolDied: the pool has ended, and no episode is complete.
    ///     PoolError: the pool did not answer within 10 seconds. Nothing is lost.
    ///     Forked: this process is a forked child of the one that made the recorder.
    ///     Closed: the recorder is closed.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        check_replay_path(&path)?;
        let save = |recorder: &mut PoolRecorder, wait: WaitOptions<'_>| {
            save(recorder, &path, wait).map(|saved| (saved, recorder.n_missing()))
        };
        match self.with(py, save)? {
            (true, 0) => Ok(()),
            (true, missing) => warn_of_missing(py, missing),
            (false, _) => {
                Err(invalid_request("no episode began while the pool was recorded; reset it and step first"))
            }
        }
    }

    /// End the recording. Nothing is written. Closing twice has no effect.
    ///
    /// Raises:
    ///     Busy: another thread is using the recorder.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let recorder = self.recorder.take_if_idle().ok_or_else(|| class::Busy::new_err(TEXTS.busy))?;
        py.detach(|| drop(recorder));
        Ok(())
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, PyTuple>) -> PyResult<()> {
        self.close(py)
    }
}
