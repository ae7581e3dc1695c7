//! The forward pass of an actor. A page shows one battle, so plain loops are fast enough; `smaclite-learn`,
//! which computes the same for thousands of rows, has its own.

use safetensors::{Dtype, SafeTensors};
use serde::Deserialize;

/// The non-linearity of hidden layers.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Activation {
    /// `max(x, 0)`.
    #[default]
    Relu,
    /// Hyperbolic tangent.
    Tanh,
}

/// A multi-layer perceptron that all agents share, but for a bias of each in the first layer.
#[derive(Debug)]
pub(crate) struct Network {
    layers: Vec<Layer>,
    /// `[n_agents, width of the first layer]`.
    id_bias: Vec<f32>,
    activation: Activation,
}

/// `weight` is `[n_out, n_in]`, row by row, as PyTorch has it.
#[derive(Debug)]
struct Layer {
    n_in: usize,
    weight: Vec<f32>,
    bias: Vec<f32>,
}

/// Why the weights of a network cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum WeightsError {
    #[error("{0}")]
    Format(#[from] safetensors::SafeTensorError),
    #[error("`{name}` must be F32 {expected:?}, got {dtype:?} {given:?}")]
    Shape { name: String, expected: Vec<usize>, dtype: Dtype, given: Vec<usize> },
    #[error("every layer must have at least one input and output, got the widths {0:?}")]
    Width(Vec<usize>),
    #[error("`{0}` has a number that is not finite")]
    NotFinite(String),
    #[error("the checksum differs, so they are damaged")]
    Checksum,
}

impl Network {
    /// The actor in a file of weights, from its `widths`: inputs, hidden layers, outputs.
    pub fn read(
        bytes: &[u8],
        widths: &[usize],
        n_agents: usize,
        activation: Activation,
    ) -> Result<Network, WeightsError> {
        if widths.contains(&0) {
            return Err(WeightsError::Width(widths.to_vec()));
        }
        let arrays = SafeTensors::deserialize(bytes)?;
        check_sum(bytes, &arrays)?;
        let pairs = widths.windows(2).enumerate();
        let layers = pairs.map(|(i, pair)| {
            let (n_in, n_out) = (pair[0], pair[1]);
            let weight = array(&arrays, format!("actor.{i}.weight"), &[n_out, n_in])?;
            Ok(Layer { n_in, weight, bias: array(&arrays, format!("actor.{i}.bias"), &[n_out])? })
        });
        let layers = layers.collect::<Result<Vec<Layer>, WeightsError>>()?;
        let first = widths.get(1).copied().unwrap_or(0);
        let id_bias = array(&arrays, "actor.id_bias".to_owned(), &[n_agents, first])?;
        Ok(Network { layers, id_bias, activation })
    }

    /// The outputs for what an agent observes.
    pub fn forward(&self, agent: usize, obs: &[f32]) -> Vec<f32> {
        let mut x = obs.to_vec();
        for (i, layer) in self.layers.iter().enumerate() {
            let rows = layer.weight.chunks_exact(layer.n_in).zip(&layer.bias);
            let mut z: Vec<f32> = rows.map(|(row, bias)| dot(row, &x) + bias).collect();
            if i == 0 {
                let own = self.id_bias.chunks_exact(z.len()).nth(agent).unwrap_or_default();
                z.iter_mut().zip(own).for_each(|(z, bias)| *z += bias);
            }
            if i + 1 < self.layers.len() {
                z.iter_mut().for_each(|z| *z = self.activation.of(*z));
            }
            x = z;
        }
        x
    }
}

impl Activation {
    fn of(self, x: f32) -> f32 {
        match self {
            Activation::Relu => x.max(0.0),
            Activation::Tanh => x.tanh(),
        }
    }
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn array(arrays: &SafeTensors<'_>, name: String, shape: &[usize]) -> Result<Vec<f32>, WeightsError> {
    let tensor = arrays.tensor(&name)?;
    if tensor.dtype() != Dtype::F32 || tensor.shape() != shape {
        let (expected, given) = (shape.to_vec(), tensor.shape().to_vec());
        return Err(WeightsError::Shape { name, expected, dtype: tensor.dtype(), given });
    }
    let bytes = tensor.data().as_chunks::<4>().0;
    let values: Vec<f32> = bytes.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    if values.iter().all(|value| value.is_finite()) { Ok(values) } else { Err(WeightsError::NotFinite(name)) }
}

/// Compares the checksum in the metadata with that of names and elements, as `smaclite-learn`'s `tensors.rs`
/// does. Files that learners in Python write have none.
fn check_sum(bytes: &[u8], arrays: &SafeTensors<'_>) -> Result<(), WeightsError> {
    let (_, metadata) = SafeTensors::read_metadata(bytes)?;
    let Some(stored) = metadata.metadata().as_ref().and_then(|metadata| metadata.get("crc32c")) else {
        return Ok(());
    };
    let mut tensors = arrays.tensors();
    tensors.sort_unstable_by(|a, b| a.0.cmp(&b.0)); // a file has them in another order
    let parts = tensors.iter().flat_map(|(name, tensor)| [name.as_bytes(), tensor.data()]);
    let sum = !parts.flatten().fold(u32::MAX, |sum, &byte| crc32c_append(sum, byte));
    if *stored == format!("{sum:08x}") { Ok(()) } else { Err(WeightsError::Checksum) }
}

/// CRC-32C with another byte, bit by bit: a table would be larger than what it saves.
fn crc32c_append(sum: u32, byte: u8) -> u32 {
    const CASTAGNOLI: u32 = 0x82f6_3b78; // reflected
    (0..8).fold(sum ^ u32::from(byte), |sum, _| (sum >> 1) ^ ((sum & 1) * CASTAGNOLI))
}
