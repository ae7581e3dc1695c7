//! The forward pass of an actor. A page shows one battle, so plain loops are fast enough; `smaclite-learn`,
//! which computes the same for thousands of rows, has its own.

use crate::units_network::UnitsNetwork;
use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Deserializer};
use smaclite_engine::{TargetLayout, UnitLayout};

/// Which network `run.json` names.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum NetworkKind {
    #[default]
    Flat,
    Units,
}

/// With a message that names the key, which serde's would not.
impl<'de> Deserialize<'de> for NetworkKind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<NetworkKind, D::Error> {
        let value = serde_json::Value::deserialize(deserializer)?;
        match value.as_str() {
            Some("flat") => Ok(NetworkKind::Flat),
            Some("units") => Ok(NetworkKind::Units),
            _ => {
                Err(serde::de::Error::custom(format!("`network` must be \"flat\" or \"units\", got {value}")))
            }
        }
    }
}

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

/// The network of an actor.
#[derive(Debug)]
pub(crate) enum Network {
    Flat(FlatNetwork),
    Units(Box<UnitsNetwork>),
}

/// A multi-layer perceptron that all agents share, but for a bias of each in the first layer.
#[derive(Debug)]
pub(crate) struct FlatNetwork {
    layers: Vec<Layer>,
    /// `[n_agents, width of the first layer]`.
    id_bias: Vec<f32>,
    activation: Activation,
}

/// `weight` is `[n_out, n_in]`, row by row, as PyTorch has it.
#[derive(Debug)]
pub(crate) struct Layer {
    n_in: usize,
    weight: Vec<f32>,
    bias: Vec<f32>,
}

impl Layer {
    /// The layer of this name in a file of weights, with these inputs and outputs.
    pub fn read(
        arrays: &SafeTensors<'_>,
        name: &str,
        n_in: usize,
        n_out: usize,
    ) -> Result<Layer, WeightsError> {
        let bias = array(arrays, format!("actor.{name}.bias"), &[n_out])?;
        Ok(Layer { bias, ..Layer::without_bias(arrays, name, n_in, n_out)? })
    }

    /// The same of one without a bias.
    pub fn without_bias(
        arrays: &SafeTensors<'_>,
        name: &str,
        n_in: usize,
        n_out: usize,
    ) -> Result<Layer, WeightsError> {
        let weight = array(arrays, format!("actor.{name}.weight"), &[n_out, n_in])?;
        Ok(Layer { n_in, weight, bias: vec![0.0; n_out] })
    }

    pub fn forward(&self, x: &[f32]) -> Vec<f32> {
        let rows = self.weight.chunks_exact(self.n_in).zip(&self.bias);
        rows.map(|(row, bias)| dot(row, x) + bias).collect()
    }
}

/// Why the weights of a network cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum WeightsError {
    #[error("{0}")]
    Format(#[from] safetensors::SafeTensorError),
    #[error("`{name}` must be F32 {expected:?}, got {dtype:?} {given:?}")]
    Shape { name: String, expected: Vec<usize>, dtype: Dtype, given: Vec<usize> },
    #[error("a network over units has two widths, got {0:?}")]
    Widths(Vec<usize>),
    #[error("observations have no units, but the network is one over units")]
    NoUnits,
    #[error("every layer must have at least one input and output, got the widths {0:?}")]
    Width(Vec<usize>),
    #[error("`{0}` has a number that is not finite")]
    NotFinite(String),
    #[error("the checksum differs, so they are damaged")]
    Checksum,
}

impl Network {
    /// The actor in a file of weights, from its `widths`: inputs, hidden layers, outputs.
    pub fn flat(
        bytes: &[u8],
        widths: &[usize],
        n_agents: usize,
        activation: Activation,
    ) -> Result<Network, WeightsError> {
        check_widths(widths)?;
        let arrays = checked(bytes)?;
        FlatNetwork::read(&arrays, widths, n_agents, activation).map(Network::Flat)
    }

    /// The same of a network over units, from the widths of its hidden layers.
    pub fn over_units(
        bytes: &[u8],
        layouts: Option<(UnitLayout, TargetLayout)>,
        hidden: &[usize],
        activation: Activation,
    ) -> Result<Network, WeightsError> {
        check_widths(hidden)?;
        let (layout, targets) = layouts.ok_or(WeightsError::NoUnits)?;
        let &[width, trunk_width] = hidden else { return Err(WeightsError::Widths(hidden.to_vec())) };
        let arrays = checked(bytes)?;
        let network = UnitsNetwork::read(&arrays, layout, targets, [width, trunk_width], activation)?;
        Ok(Network::Units(Box::new(network)))
    }

    /// The outputs for what an agent observes.
    pub fn forward(&self, agent: usize, obs: &[f32]) -> Vec<f32> {
        match self {
            Network::Flat(network) => network.forward(agent, obs),
            Network::Units(network) => network.forward(agent, obs),
        }
    }
}

fn check_widths(widths: &[usize]) -> Result<(), WeightsError> {
    if widths.contains(&0) { Err(WeightsError::Width(widths.to_vec())) } else { Ok(()) }
}

fn checked(bytes: &[u8]) -> Result<SafeTensors<'_>, WeightsError> {
    let arrays = SafeTensors::deserialize(bytes)?;
    check_sum(bytes, &arrays)?;
    Ok(arrays)
}

impl FlatNetwork {
    fn read(
        arrays: &SafeTensors<'_>,
        widths: &[usize],
        n_agents: usize,
        activation: Activation,
    ) -> Result<FlatNetwork, WeightsError> {
        let pairs = widths.windows(2).enumerate();
        let layers = pairs.map(|(i, pair)| Layer::read(arrays, &i.to_string(), pair[0], pair[1]));
        let layers = layers.collect::<Result<Vec<Layer>, WeightsError>>()?;
        let first = widths.get(1).copied().unwrap_or(0);
        let id_bias = array(arrays, "actor.id_bias".to_owned(), &[n_agents, first])?;
        Ok(FlatNetwork { layers, id_bias, activation })
    }

    fn forward(&self, agent: usize, obs: &[f32]) -> Vec<f32> {
        let mut x = obs.to_vec();
        for (i, layer) in self.layers.iter().enumerate() {
            let mut z = layer.forward(&x);
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
    pub fn of(self, x: f32) -> f32 {
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
