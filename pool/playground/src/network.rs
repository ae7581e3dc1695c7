//! The forward pass of an actor. A page shows one battle, so plain loops are fast enough; `smaclite-learn`,
//! which computes the same for thousands of rows, has its own.

use crate::layer::{Activation, Layer, WeightsError, array};
use crate::units_network::UnitsNetwork;
use safetensors::SafeTensors;
use serde::{Deserialize, Deserializer};
use smaclite_engine::{TargetLayout, UnitLayout, UniversalRows};

/// Which network `run.json` names.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum NetworkKind {
    #[default]
    Flat,
    Units,
    /// Over units, with weights that fit every scenario.
    Universal,
}

smaclite_units::keywords!(
    NetworkKind,
    "network",
    "flat" => Flat,
    "units" => Units,
    "universal" => Universal,
);

/// With a message that names the key, which serde's would not.
impl<'de> Deserialize<'de> for NetworkKind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<NetworkKind, D::Error> {
        let value = serde_json::Value::deserialize(deserializer)?;
        let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        text.parse().map_err(serde::de::Error::custom)
    }
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

    /// The same of a network over units, from the widths of its hidden layers; `rows` are how those of the
    /// scenario become rows of a universal network.
    pub fn over_units(
        bytes: &[u8],
        layouts: Option<(UnitLayout, TargetLayout)>,
        hidden: &[usize],
        activation: Activation,
        rows: Option<&UniversalRows>,
    ) -> Result<Network, WeightsError> {
        check_widths(hidden)?;
        let (layout, targets) = layouts.ok_or(WeightsError::NoUnits)?;
        let &[width, trunk_width] = hidden else { return Err(WeightsError::Widths(hidden.to_vec())) };
        let arrays = checked(bytes)?;
        let network = UnitsNetwork::read(&arrays, layout, targets, [width, trunk_width], activation, rows)?;
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
