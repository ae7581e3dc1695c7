//! The extension module behind the Python package `smaclite_pool`: it converts, waits without the interpreter, and maps
//! errors. What a pool is and does lives in `smaclite-ipc`; the names users import are in `python/smaclite_pool`.

#![deny(unsafe_code)] // `views` says why it may

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

/// Native part of `smaclite_pool`; import the package, not this module.
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
        super::views::ready_numpy(module.py())?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        super::batch::add_fields(module.py())?;
        super::scenario::add_constants(module)?;
        super::exit::close_at_exit(module)
    }
}
