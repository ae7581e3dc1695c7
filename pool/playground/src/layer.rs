//! The layers of which networks are made, read from a file of weights.

use safetensors::{Dtype, SafeTensors};
use serde::Deserialize;
use smaclite_engine::{MAX_LAST_ACTIONS, NotUniversal, RowMap};

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

    /// What this layer, of rows of the one form of all scenarios, is for rows of a scenario.
    pub fn on(&self, rows: &RowMap) -> Layer {
        let [_, n_in] = rows.widths();
        let (mut weight, mut bias) = (vec![0.0; n_in * self.bias.len()], vec![0.0; self.bias.len()]);
        rows.forward([&self.weight, &self.bias], [&mut weight, &mut bias]);
        Layer { n_in, weight, bias }
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
    #[error("`last_actions` must be between 0 and {MAX_LAST_ACTIONS}, got {0}")]
    LastActions(usize),
    #[error("observations have no units, but the network is one over units")]
    NoUnits,
    #[error("{0}")]
    NotUniversal(#[from] NotUniversal),
    #[error("every layer must have at least one input and output, got the widths {0:?}")]
    Width(Vec<usize>),
    #[error("`{0}` has a number that is not finite")]
    NotFinite(String),
    #[error("the checksum differs, so they are damaged")]
    Checksum,
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

/// A tensor of this name and shape.
pub(crate) fn array(
    arrays: &SafeTensors<'_>,
    name: String,
    shape: &[usize],
) -> Result<Vec<f32>, WeightsError> {
    let tensor = arrays.tensor(&name)?;
    if tensor.dtype() != Dtype::F32 || tensor.shape() != shape {
        let (expected, given) = (shape.to_vec(), tensor.shape().to_vec());
        return Err(WeightsError::Shape { name, expected, dtype: tensor.dtype(), given });
    }
    let bytes = tensor.data().as_chunks::<4>().0;
    let values: Vec<f32> = bytes.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    if values.iter().all(|value| value.is_finite()) { Ok(values) } else { Err(WeightsError::NotFinite(name)) }
}
