//! What others read of a run, `weights.safetensors`: the weights of its networks.

use crate::adam::Adam;
use crate::architecture::Architecture;
use crate::team::{Network, Team};
use crate::tensors::{Array, Arrays, FileError, read, write_arrays};
use std::path::Path;

/// Writes the weights of both networks, `actor.0.weight` and so on, in the shapes of PyTorch.
pub(crate) fn write_weights(path: &Path, team: &Team) -> Result<(), FileError> {
    let networks = [("actor", &team.actor), ("critic", &team.critic)];
    write_arrays(path, &networks.into_iter().flat_map(tensors).collect::<Vec<_>>())
}

/// Writes the weights of an actor alone, named as in such a file.
pub(crate) fn write_actor(path: &Path, actor: &Network) -> Result<(), FileError> {
    write_arrays(path, &tensors(("actor", actor)).collect::<Vec<_>>())
}

fn tensors<'a>((prefix, network): (&'a str, &'a Network)) -> impl Iterator<Item = Array> + 'a {
    network.architecture.tensors().into_iter().map(move |tensor| {
        let name = format!("{prefix}.{}", tensor.name);
        Array::new(name, &tensor.shape, &network.params[tensor.range])
    })
}

/// Reads the actor of such a file.
pub(crate) fn read_actor(path: &Path, architecture: Architecture) -> Result<Network, FileError> {
    actor_of(path, &read(path)?, architecture)
}

/// The same of the bytes of such a file, which were read before.
pub(crate) fn actor_of(path: &Path, bytes: &[u8], architecture: Architecture) -> Result<Network, FileError> {
    let arrays = Arrays::decode(path, bytes)?;
    let mut params = vec![0.0; architecture.n_params()];
    for tensor in architecture.tensors() {
        let name = format!("actor.{}", tensor.name);
        let values: Vec<f32> = arrays.shaped(&name, &tensor.shape)?;
        if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            return Err(arrays.damaged(format!("`{name}` contains {value}")));
        }
        params[tensor.range].copy_from_slice(&values);
    }
    let adam = Adam::new(0);
    Ok(Network { architecture, params, adam })
}
