//! The extension module of the Python package `smaclite_pool`. It converts arguments and results, waits
//! detached from the interpreter, and maps errors. Pools are implemented in `smaclite-ipc`; the public Python
//! names are in `python/smaclite_pool`.

#![deny(unsafe_code)] // except in `views`, whose SAFETY comments say why

mod batch;
mod convert;
mod envs;
mod errors;
mod exit;
mod make;
mod program;
mod query;
mod scenario;
#[allow(unsafe_code)]
mod views;
mod wait;

use pyo3::prelude::*;

/// Native part of `smaclite_pool`. Import the package, not this module.
#[pymodule]
mod _native {
    use super::PyModule;
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::batch::{Batch, Frame};
    #[pymodule_export]
    use super::envs::Envs;
    #[pymodule_export]
    use super::make::{connect, make};
    #[pymodule_export]
    use super::program::run_program;
    #[pymodule_export]
    use super::query::{pools, scenarios, status};
    #[pymodule_export]
    use super::scenario::scenario;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        super::views::load_numpy(module.py())?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        super::batch::add_field_properties(module.py())?;
        super::exit::register_atexit(module)
    }
}
