//! Seeds of a reset: none, one for all environments, or one per environment.

use crate::batch::Batch;
use crate::convert::{IntArg, to_unsigned};
use crate::errors::{class, invalid_request};
use crate::wait::{Deadline, wait_detached};
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyFrozenSet, PyMapping, PySet, PyString};
use smaclite_ipc::{Client, Order};
use std::collections::BTreeMap;
use std::time::Duration;

/// Random bits of a seed that was not given: a double has them all, and so has JSON.
const SEED_BITS: u32 = 53;

/// How environments are seeded.
pub enum Seeds {
    /// Environment i with the seed + i; with `None`, its generator continues.
    From(Option<u64>),
    /// One per environment of the request, in its order.
    Each(Vec<Option<u64>>),
}

/// A random seed. Python's source and not one of Rust: a forked child would repeat the state of its parent.
pub fn random_seed(py: Python<'_>) -> PyResult<u64> {
    py.import("secrets")?.call_method1("randbits", (SEED_BITS,))?.extract()
}

impl Seeds {
    /// Of an integer, a sequence of `n_envs` integers or `None`s, or nothing.
    pub fn new(arg: Option<&Bound<'_, PyAny>>, n_envs: usize) -> PyResult<Seeds> {
        let Some(arg) = arg else { return Ok(Seeds::From(None)) };
        let given = match arg.extract::<IntArg>()? {
            IntArg::Other(_) if is_list(arg) => arg.try_iter()?,
            seed => return Ok(Seeds::From(Some(to_unsigned("seed", seed)?))),
        };
        let mut seeds = Vec::with_capacity(n_envs);
        for seed in given {
            let seed = seed?.extract::<Option<IntArg>>()?;
            let name = format!("seed[{}]", seeds.len());
            seeds.push(seed.map(|seed| to_unsigned(&name, seed)).transpose()?);
        }
        if seeds.len() != n_envs {
            let got = seeds.len();
            return Err(invalid_request(format!(
                "seed must be an integer, or have one per environment that is reset, {n_envs}; got {got}"
            )));
        }
        Ok(Seeds::Each(seeds))
    }

    /// The seed of all environments, where they cannot have one each.
    pub fn one(self) -> PyResult<Option<u64>> {
        match self {
            Seeds::From(seed) => Ok(seed),
            Seeds::Each(_) => Err(invalid_request(
                "with snapshots, seed must be one integer or None, got one per environment",
            )),
        }
    }

    /// Resets all environments or those of `ids`, to levels if there are any.
    ///
    /// A request has one seed, and environment i gets that seed + i. Seeds that are not such a sequence take
    /// a request per sequence in them: at most one per environment, at least one for `[7, 8, 9]`. The first
    /// names all environments, so that all is refused or nothing. It is incomplete until the last is sent.
    pub fn reset(
        self,
        py: Python<'_>,
        client: &mut Client,
        is_incomplete: &mut bool,
        ids: Option<&[i32]>,
        levels: Option<&[f32]>,
        timeout: Option<Duration>,
    ) -> PyResult<Batch> {
        let deadline = Deadline::after(timeout);
        let is_synchronous = client.description().settings.is_synchronous();
        let mut request = |seed: Option<u64>, ids: Option<&[i32]>, levels: Option<&[f32]>| {
            wait_detached(py, deadline.left(), |wait| {
                client.request(Order::Reset { seed, levels }, ids, wait)
            })
        };
        let seeds = match self {
            Seeds::From(seed) => return request(seed, ids, levels).map(Batch::new),
            Seeds::Each(seeds) => seeds,
        };
        let groups = groups(&seeds, ids);
        if groups.len() > 1 && !is_synchronous {
            return Err(invalid_request(
                "seed must be an integer or consecutive integers where batches have fewer environments than \
                 the lane; reset environments one by one by `env_id`, each to (seed - id) % 2**64",
            ));
        }
        let was_incomplete = *is_incomplete;
        let (mut newest, last) = (None, groups.len().saturating_sub(1));
        for (group, (base, places)) in groups.into_iter().enumerate() {
            *is_incomplete = group < last; // before it is sent: the wait for the last one can be continued
            drop(newest.take()); // its caller does not get it, so it must not count as held
            // Those of other groups follow.
            if group == 0 {
                let reset = request(base, ids, levels);
                if reset.as_ref().is_err_and(|error| error.is_instance_of::<class::InvalidRequest>(py)) {
                    *is_incomplete = was_incomplete; // nothing has changed
                }
                newest = Some(reset?);
                continue;
            }
            let of_group: Vec<i32> = places.iter().map(|place| id_of(ids, *place)).collect();
            let levels = levels.map(|levels| rows(levels, seeds.len(), &places));
            newest = Some(request(base, Some(&of_group), levels.as_deref())?);
        }
        newest.map(Batch::new).ok_or_else(|| invalid_request("seed must have at least one integer, got none"))
    }
}

/// Whether it is a sequence of seeds. Those of a set have no order, and a dictionary would give its keys.
fn is_list(arg: &Bound<'_, PyAny>) -> bool {
    let is_text = arg.is_instance_of::<PyString>() || arg.is_instance_of::<PyBytes>();
    let is_set = arg.is_instance_of::<PySet>() || arg.is_instance_of::<PyFrozenSet>();
    let is_other =
        is_text || is_set || arg.is_instance_of::<PyByteArray>() || arg.cast::<PyMapping>().is_ok();
    !is_other && arg.try_iter().is_ok()
}

/// The places in the request by the seed less the id of the environment. Those without a seed come first: a
/// reset of all environments then leaves the generators of these as they are.
fn groups(seeds: &[Option<u64>], ids: Option<&[i32]>) -> BTreeMap<Option<u64>, Vec<usize>> {
    let mut groups = BTreeMap::<Option<u64>, Vec<usize>>::new();
    for (place, seed) in seeds.iter().enumerate() {
        // Modulo 2^64, as the pool adds.
        let base = seed.map(|seed| seed.wrapping_sub(id_of(ids, place) as u64));
        groups.entry(base).or_default().push(place);
    }
    groups
}

fn id_of(ids: Option<&[i32]>, place: usize) -> i32 {
    ids.map_or(place as i32, |ids| ids[place])
}

/// The levels at some of `count` places.
fn rows(levels: &[f32], count: usize, places: &[usize]) -> Vec<f32> {
    let size = levels.len() / count;
    places.iter().flat_map(|place| &levels[place * size..][..size]).copied().collect()
}
