//! The extension module of the Python package `smaclite_pool`. It converts arguments and results, waits
//! detached from the interpreter, and maps errors. Pools are implemented in `smaclite-ipc`; the public Python
//! names are in `python/smaclite_pool`.

#![deny(unsafe_code)] // except in `views`, whose SAFETY comments say why

mod arrays;
mod batch;
mod capability_battle;
mod convert;
mod dataset;
mod envs;
mod errors;
mod exclusive;
mod exit;
mod habits;
mod lane_spec;
mod make;
mod policy;
mod program;
mod query;
mod recorder;
mod scenario;
mod seeds;
mod snapshot;
mod spectator;
mod team;
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
    use super::batch::Batch;
    #[pymodule_export]
    use super::capability_battle::CapabilityBattle;
    #[pymodule_export]
    use super::dataset::Dataset;
    #[pymodule_export]
    use super::envs::Envs;
    #[pymodule_export]
    use super::envs::render::Renderer;
    #[pymodule_export]
    use super::habits::check_settings;
    #[pymodule_export]
    use super::make::{connect, make};
    #[pymodule_export]
    use super::policy::ScriptedPolicy;
    #[pymodule_export]
    use super::program::run_program;
    #[pymodule_export]
    use super::query::{pools, scenarios, status};
    #[pymodule_export]
    use super::recorder::Recorder;
    #[pymodule_export]
    use super::scenario::scenario;
    #[pymodule_export]
    use super::snapshot::{pack_snapshot, snapshot_columns};
    #[pymodule_export]
    use super::spectator::Spectator;
    #[pymodule_export]
    use super::team::{TeamNetwork, read_team};
    #[pymodule_export]
    use super::views::Frame;

    // Numbers of the actions of an agent.
    #[pymodule_export]
    const NO_OP: usize = smaclite_engine::action::NO_OP;
    #[pymodule_export]
    const STOP: usize = smaclite_engine::action::STOP;
    #[pymodule_export]
    const NORTH: usize = smaclite_engine::action::NORTH;
    #[pymodule_export]
    const SOUTH: usize = smaclite_engine::action::SOUTH;
    #[pymodule_export]
    const EAST: usize = smaclite_engine::action::EAST;
    #[pymodule_export]
    const WEST: usize = smaclite_engine::action::WEST;
    #[pymodule_export]
    const FIRST_TARGET: usize = smaclite_engine::action::FIRST_TARGET;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        super::views::load_numpy(module.py())?;
        super::errors::load_classes(module.py());
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("SNAPSHOT_COLUMNS", super::snapshot::table())?;
        module.add("DATASET_ARRAYS", super::dataset::table())?;
        let rewards = crate::convert::to_dict(module.py(), &smaclite_engine::Rewards::DEFAULT)?;
        module.add("REWARD_DEFAULTS", rewards)?;
        let opponents = smaclite_engine::Opponent::ALL.map(smaclite_engine::Opponent::name);
        module.add("OPPONENTS", pyo3::types::PyTuple::new(module.py(), opponents)?)?;
        let teams: Vec<&str> = smaclite_learn::zoo_teams().collect();
        module.add("ZOO", pyo3::types::PyTuple::new(module.py(), teams)?)?;
        super::batch::add_field_properties(module.py())?;
        super::exit::register_atexit(module)
    }
}
