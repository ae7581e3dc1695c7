//! Datasets: recipes that are expanded to arrays in memory, or to files of NumPy.

use crate::convert::{IntArg, string_list, to_dict, to_unsigned};
use crate::errors::{class, invalid_request, shown};
use crate::habits::{Place, hint, no_attribute};
use crate::make::MAX_THREADS;
use crate::wait::{interruptible, run_on_thread};
use numpy::PyArray1;
use pyo3::exceptions::{PyMemoryError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};
use smaclite_engine::{BattleSetup, Opponents, Rules};
use smaclite_lab::{ARRAYS, ArrayName, Dataset as Recipe, DatasetError, PerRow};
use smaclite_pool::PoolOptions;
use smaclite_pool::fields::Axis;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;

/// Name, dtype, shape and meaning of every array.
pub fn table() -> Vec<(&'static str, &'static str, String, &'static str)> {
    let axis = |axis: &Axis| match axis {
        Axis::Agent => "n_agents",
        Axis::Obs => "obs_size",
        Axis::State => "state_size",
        _ => "n_actions",
    };
    let row = |spec: &smaclite_lab::ArraySpec| {
        let first = if spec.per == PerRow::Step { "T" } else { "E" };
        let axes: Vec<&str> = std::iter::once(first).chain(spec.axes.iter().map(axis)).collect();
        (spec.name, spec.dtype.name(), axes.join(", "), spec.meaning)
    };
    ARRAYS.iter().map(row).collect()
}

fn dataset_error(error: DatasetError) -> PyErr {
    let text = shown(&error);
    match error {
        // `FileNotFoundError` and the like, by its kind.
        DatasetError::Io { error: ref source, .. } => io::Error::new(source.kind(), text).into(),
        DatasetError::Memory { .. } => PyMemoryError::new_err(text),
        DatasetError::Scenario(_) => class::ScenarioError::new_err(text),
        DatasetError::FolderExists { .. } => invalid_request(text),
        _ => class::PoolError::new_err(text),
    }
}

/// A dataset for offline learning: the recipe that `smaclite-pool dataset record` wrote.
///
///     dataset = smaclite_pool.Dataset("3m.smdata")
///     arrays = dataset.expand(fields=["obs", "avail_actions", "actions"])
///
/// The file has the scenario, and the seed and the actions of every episode. `expand` plays the episodes
/// again and gets the same bits on every machine.
///
/// Args:
///     path: a file of `smaclite-pool dataset record`.
///
/// Raises:
///     PoolError: the file is not a dataset, is damaged or is of another version; the text says where.
///     OSError: it cannot be read.
#[pyclass(frozen, module = "smaclite_pool")]
pub struct Dataset {
    recipe: Arc<Recipe>,
    path: PathBuf,
}

#[pymethods]
impl Dataset {
    #[new]
    #[pyo3(signature = (path))]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Dataset> {
        let file = path.clone();
        let recipe = run_on_thread(py, move |_| Recipe::read(&file))?.map_err(dataset_error)?;
        Ok(Dataset { recipe: Arc::new(recipe), path })
    }

    /// Play all episodes again and return their arrays. Other Python threads run meanwhile.
    ///
    /// Rows are steps in the order of the episodes, or episodes; `DATASET_ARRAYS` lists the arrays. What was
    /// expanded is compared with the hashes in the file.
    ///
    /// Args:
    ///     out: a new folder, for a file NAME.npy per array and the card as card.json; the arrays that are
    ///         returned are read-only and mapped from these files. None: the arrays are in memory.
    ///     fields: the names of the arrays; None for all.
    ///     threads: 1 to 1024; they change no bit. None for the CPU cores available to this process.
    ///
    /// Returns:
    ///     A dict from names to arrays.
    ///
    /// Raises:
    ///     InvalidRequest: there is no such array, the folder exists, or `threads` is out of range.
    ///     PoolError: this release plays an episode otherwise than the one that recorded it.
    ///     OSError: the folder cannot be written.
    ///     MemoryError: the arrays are larger than the memory; name fewer `fields`, or give `out`.
    #[pyo3(signature = (out=None, fields=None, *, threads=None))]
    fn expand<'py>(
        &self,
        py: Python<'py>,
        out: Option<PathBuf>,
        fields: Option<Bound<'py, PyAny>>,
        threads: Option<IntArg>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let names = fields.map(|fields| string_list("fields", "['obs', 'actions']", &fields)).transpose()?;
        let arrays = match names {
            None => ArrayName::ALL.to_vec(),
            Some(names) => {
                let arrays = names.iter().map(|name| ArrayName::from_name(name));
                arrays.collect::<Result<Vec<_>, _>>().map_err(invalid_request)?
            }
        };
        let threads = match threads {
            None => PoolOptions::default().threads,
            Some(threads) => to_unsigned("threads", threads)?,
        };
        if !(1..=MAX_THREADS).contains(&threads) {
            return Err(invalid_request(format!(
                "threads must be between 1 and {MAX_THREADS}, got {threads}"
            )));
        }
        match out {
            None => self.in_memory(py, &arrays, threads),
            Some(folder) => {
                interruptible(py, |interrupted| {
                    let written = self.recipe.expand_to(&folder, &arrays, threads, interrupted);
                    written.map_err(dataset_error)
                })?;
                let (load, mapped) = (py.import("numpy")?.getattr("load")?, PyDict::new(py));
                mapped.set_item("mmap_mode", "r")?;
                let loaded = PyDict::new(py);
                for array in arrays {
                    let name = array.spec().name;
                    let file = folder.join(format!("{name}.npy"));
                    loaded.set_item(name, load.call((file,), Some(&mapped))?)?;
                }
                Ok(loaded)
            }
        }
    }

    /// What was played, as a dict: `scenario`, `rules`, `opponents`, `sizes`, `episodes`, `steps`,
    /// `win_rate`, `truncated_rate`, `returns` and `lengths` (mean, deviation and quantiles), `unique_pairs`,
    /// `coverage` (the share of different pairs of state and joint action) and `policies`.
    #[getter]
    fn card<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        to_dict(py, self.recipe.card())
    }

    /// The hash of all arrays, 32 hexadecimal digits: datasets with equal hashes are equal.
    #[getter]
    fn hash(&self) -> String {
        self.recipe.hash()
    }

    /// The program that recorded it, with its version.
    #[getter]
    fn program(&self) -> &str {
        self.recipe.program()
    }

    /// The name of the standard scenario that it plays, for `make`; None if it plays a scenario file.
    #[getter]
    fn scenario(&self) -> Option<&str> {
        self.recipe.setup().files.is_standard().then_some(self.recipe.card().scenario.as_str())
    }

    /// Arguments of `make` for environments that play by the same rules: `rules`, `episode_limit` and
    /// `opponent`.
    #[getter]
    fn settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        #[derive(serde::Serialize)]
        struct Settings<'a> {
            rules: Rules,
            episode_limit: Option<u32>,
            opponent: &'a Opponents,
        }
        let BattleSetup { rules, opponents, .. } = self.recipe.setup();
        let episode_limit = self.recipe.episode_limit();
        to_dict(py, &Settings { rules: *rules, episode_limit, opponent: opponents })
    }

    /// The episodes, as a dict of arrays with an entry per episode: `seed` uint64, `start` and `length` int64
    /// (rows of the arrays that have one per step), and `policy` int64 (index of `card["policies"]`).
    #[getter]
    fn episodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let episodes = || self.recipe.episodes().iter();
        let seeds: Vec<u64> = episodes().map(|episode| episode.seed).collect();
        let starts = (0..self.recipe.episodes().len()).map(|i| self.recipe.steps_of(i).start as i64);
        let dict = PyDict::new(py);
        dict.set_item("seed", PyArray1::from_vec(py, seeds))?;
        dict.set_item("start", PyArray1::from_iter(py, starts))?;
        dict.set_item("length", PyArray1::from_iter(py, episodes().map(|e| i64::from(e.length))))?;
        dict.set_item("policy", PyArray1::from_iter(py, episodes().map(|e| i64::from(e.policy))))?;
        Ok(dict)
    }

    /// Called where there is no attribute of that name.
    fn __getattr__(slf: &Bound<'_, Self>, name: &str) -> PyResult<Py<PyAny>> {
        Err(no_attribute(&slf.get_type(), Place::Dataset, name))
    }

    fn __getitem__(&self, name: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        let name = name.to_string();
        let names = ArrayName::ALL.iter().map(|array| array.spec().name);
        let hint = match ArrayName::from_name(&name) {
            Ok(_) => format!("use expand()[\"{name}\"], or expand(fields=[\"{name}\"]) for it alone"),
            Err(_) => hint(Place::Dataset, &name, names),
        };
        Err(PyTypeError::new_err(format!(
            "a dataset is a recipe and has no arrays before it is expanded; {hint}"
        )))
    }

    fn __repr__(&self) -> String {
        let (steps, episodes) = (self.recipe.n_steps(), self.recipe.episodes().len());
        format!("<smaclite_pool.Dataset {}: {steps} steps, {episodes} episodes>", self.path.display())
    }
}

impl Dataset {
    fn in_memory<'py>(
        &self,
        py: Python<'py>,
        arrays: &[ArrayName],
        threads: usize,
    ) -> PyResult<Bound<'py, PyDict>> {
        let expanded = interruptible(py, |interrupted| {
            self.recipe.expand(arrays, threads, interrupted).map_err(dataset_error)
        })?;
        let dict = PyDict::new(py);
        for (array, values) in expanded {
            let mut shape = array.row_shape(&self.recipe.sizes());
            let n_rows = match array.spec().per {
                PerRow::Step => self.recipe.n_steps(),
                PerRow::Episode => self.recipe.episodes().len(),
            };
            shape.insert(0, n_rows);
            let (words, n_bytes) = values.into_words();
            let dtype = array.spec().dtype;
            let memory = PyArray1::from_vec(py, words).call_method1("view", (dtype.name(),))?;
            let flat = memory.get_item(PySlice::new(py, 0, (n_bytes / dtype.size()) as isize, 1))?;
            dict.set_item(array.spec().name, flat.call_method1("reshape", (shape,))?)?;
        }
        Ok(dict)
    }
}
