//! Seeds of environments: none, one for all, or one for each.

use crate::convert::{IntArg, to_unsigned};
use crate::errors::invalid_request;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyFrozenSet, PyMapping, PySet, PyString};
use smaclite_pool::transport::Seeds;

/// Random bits of a seed that was not given: a double has them all, and so has JSON.
const SEED_BITS: u32 = 53;

/// Those of a request.
pub type OwnedSeeds = Seeds<Vec<Option<u64>>>;

/// A random seed. Python's source and not one of Rust: a forked child would repeat the state of its parent.
pub fn random_seed(py: Python<'_>) -> PyResult<u64> {
    py.import("secrets")?.call_method1("randbits", (SEED_BITS,))?.extract()
}

/// The seeds of `n_envs` environments: of an integer, a sequence of `n_envs` integers or `None`s, or nothing.
pub fn seeds(arg: Option<&Bound<'_, PyAny>>, n_envs: usize) -> PyResult<OwnedSeeds> {
    let Some(arg) = arg else { return Ok(Seeds::Continue) };
    let given = match arg.extract::<IntArg>()? {
        IntArg::Other(_) if is_list(arg) => arg.try_iter()?,
        IntArg::Other(other) => {
            let expected = "seed must be an integer, or a list with one per environment";
            return Err(other.error(expected));
        }
        seed => return Ok(Seeds::From(to_unsigned("seed", seed)?)),
    };
    let mut seeds = Vec::with_capacity(n_envs);
    // An iterator may have no end.
    for seed in given.take(n_envs + 1) {
        let seed = seed?.extract::<Option<IntArg>>()?;
        let name = format!("seed[{}]", seeds.len());
        seeds.push(seed.map(|seed| to_unsigned(&name, seed)).transpose()?);
    }
    if seeds.len() != n_envs {
        let got = match arg.len() {
            Ok(len) => len.to_string(),
            Err(_) if seeds.len() > n_envs => "more".to_owned(),
            Err(_) => seeds.len().to_string(),
        };
        return Err(invalid_request(format!(
            "seed must be an integer, or have one per environment of the request, {n_envs}; got {got}"
        )));
    }
    Ok(Seeds::Each(seeds))
}

/// Whether it is a sequence of seeds. Those of a set have no order, and a dictionary would give its keys.
fn is_list(arg: &Bound<'_, PyAny>) -> bool {
    let is_text = arg.is_instance_of::<PyString>() || arg.is_instance_of::<PyBytes>();
    let is_set = arg.is_instance_of::<PySet>() || arg.is_instance_of::<PyFrozenSet>();
    let is_other =
        is_text || is_set || arg.is_instance_of::<PyByteArray>() || arg.cast::<PyMapping>().is_ok();
    !is_other && arg.try_iter().is_ok()
}
