//! Multi-layer perceptrons: what they compute, and the gradient of it. The parameters of a network are one
//! vector, so an optimiser, a sum of gradients or a copy is one loop.
//!
//! A layer maps the rows of its input X, one per sample, to Z = X Wᵀ + b; hidden layers then apply the
//! activation, A = f(Z). The first layer has a second bias that the sample's agent selects. It equals a
//! one-hot agent id among the inputs, without the products with zeros.
//!
//! Backwards, with G = dL/dZ of a layer, the chain rule gives
//!
//! - dL/dW = Gᵀ X,
//! - dL/db = the sum of the rows of G; of an agent's bias, the sum of that agent's rows,
//! - dL/dX = G W, which is dL/dA of the layer below, whose G is dL/dA * f'(Z), element by element.
//!
//! Both activations have a derivative that follows from the output: 1 where A > 0 for max(x, 0), and 1 - A²
//! for tanh. So Z is overwritten by A.
//!
//! The products are faer's; bias and activation are one pass over their result. The number of outputs is
//! padded to a multiple of [`WIDTH`] with rows of W that stay zero, because nothing depends on them.

use crate::config::Activation;
use crate::linear::{Linear, NamedMap, Tensor, differentiate, fit, sum_rows_by};
use crate::math::WIDTH;
use faer::Accum;
use std::f64::consts::SQRT_2;
use std::ops::Range;

/// The architecture of a network, and where its parameters lie in their vector.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mlp {
    layers: Vec<Linear>,
    /// `[n_ids, width of the first layer]`; empty without agent ids.
    id_bias: Range<usize>,
    activation: Activation,
    n_params: usize,
}

/// The memory of a forward and a backward pass. It holds no state between passes, and only grows.
#[derive(Debug, Default)]
pub(crate) struct Workspace {
    /// Rows of the last forward pass, and its outputs per row.
    shape: (usize, usize),
    /// The output of each layer.
    outputs: Vec<Vec<f32>>,
    /// dL/dZ of each layer.
    deltas: Vec<Vec<f32>>,
}

impl Workspace {
    /// The outputs of the last forward pass, `[rows, padded n_out]`. Before the backward pass they are
    /// replaced by the gradient of the loss with respect to them.
    pub fn output(&mut self) -> &mut [f32] {
        let (rows, width) = self.shape;
        self.outputs.last_mut().map_or(&mut [], |output| &mut output[..rows * width])
    }

    fn fit(&mut self, mlp: &Mlp, rows: usize) {
        let n_layers = mlp.layers.len();
        self.shape = (rows, mlp.padded_out());
        self.outputs.resize_with(n_layers, Vec::new);
        self.deltas.resize_with(n_layers, Vec::new);
        for (i, layer) in mlp.layers.iter().enumerate() {
            fit(&mut self.outputs[i], rows * layer.n_out());
            fit(&mut self.deltas[i], rows * layer.n_out());
        }
    }
}

impl Mlp {
    /// A network with these widths, and `n_ids` agents that have a bias each (0 for none).
    pub fn new(n_in: usize, hidden: &[usize], n_out: usize, n_ids: usize, activation: Activation) -> Mlp {
        let (mut below, mut end) = (n_in, 0);
        let mut layers = Vec::with_capacity(hidden.len() + 1);
        for &width in hidden {
            layers.push(Linear::new(std::mem::replace(&mut below, width), width, &mut end));
        }
        layers.push(Linear::padded(below, n_out, n_out.next_multiple_of(WIDTH), &mut end));
        let id_bias = end..end + n_ids * layers[0].n_out();
        Mlp { layers, activation, n_params: id_bias.end, id_bias }
    }

    /// Length of the vector of parameters.
    pub fn n_params(&self) -> usize {
        self.n_params
    }

    /// Outputs per row, padded to a multiple of [`WIDTH`].
    pub fn padded_out(&self) -> usize {
        self.layers.last().map_or(0, Linear::n_out)
    }

    /// The parameter tensors, in their order in the vector.
    pub fn tensors(&self) -> Vec<Tensor> {
        let mut tensors: Vec<Tensor> =
            self.maps(1.0).iter().flat_map(|(name, layer, _)| layer.tensors(name)).collect();
        if !self.id_bias.is_empty() {
            let width = self.layers[0].n_out();
            let (shape, range) = (vec![self.id_bias.len() / width, width], self.id_bias.clone());
            tensors.push(Tensor { name: "id_bias".to_owned(), shape, range });
        }
        tensors
    }

    /// The layers. First weights are orthogonal, scaled by √2 in hidden layers and by `last_gain` in the
    /// last. An orthogonal matrix keeps the length of its input, and √2 makes up for the half that
    /// max(x, 0) drops, so signals neither vanish nor grow with depth (Saxe, McClelland and Ganguli, 2013).
    pub fn maps(&self, last_gain: f64) -> Vec<NamedMap<'_>> {
        let gain = |i| if i + 1 == self.layers.len() { last_gain } else { SQRT_2 };
        self.layers.iter().enumerate().map(|(i, layer)| (i.to_string(), layer, gain(i))).collect()
    }

    /// Computes the outputs of all rows of `x`, `[rows, n_in]`; see [`Workspace::output`]. `ids` has the
    /// agent of each row, or nothing if the network has no agents.
    pub fn forward(&self, params: &[f32], x: &[f32], ids: &[u16], workspace: &mut Workspace) {
        let rows = x.len() / self.layers[0].n_in();
        assert!(self.id_bias.is_empty() || ids.len() == rows, "one agent per row");
        workspace.fit(self, rows);
        for (i, layer) in self.layers.iter().enumerate() {
            let (below, rest) = workspace.outputs.split_at_mut(i);
            let z = &mut rest[0][..rows * layer.n_out()];
            let input = below.last().map_or(x, |input| &input[..rows * layer.n_in()]);
            let id_bias = if i == 0 { &params[self.id_bias.clone()] } else { &[] };
            let activation = (i + 1 < self.layers.len()).then_some(self.activation);
            layer.forward_by_id(params, input, id_bias, ids, z, activation);
        }
    }

    /// Adds the gradient of the loss with respect to the parameters to `gradient`. The forward pass of `x`
    /// was the last of this workspace, and its output now is the gradient of the loss with respect to the
    /// output.
    pub fn backward(
        &self,
        params: &[f32],
        x: &[f32],
        ids: &[u16],
        workspace: &mut Workspace,
        gradient: &mut [f32],
    ) {
        let Workspace { shape: (rows, _), ref mut outputs, ref mut deltas } = *workspace;
        // The caller has replaced the output of the last layer by its delta.
        let last = self.layers.len() - 1;
        std::mem::swap(&mut outputs[last], &mut deltas[last]);
        for (i, layer) in self.layers.iter().enumerate().rev() {
            let (lower, upper) = deltas.split_at_mut(i);
            let delta = &upper[0][..rows * layer.n_out()];
            let below = i.checked_sub(1).map(|below| &outputs[below][..rows * layer.n_in()]);
            layer.backward(below.unwrap_or(x), delta, gradient);
            if let (Some(below), Some(lower)) = (below, lower.last_mut()) {
                let lower = &mut lower[..rows * layer.n_in()];
                layer.lower(params, delta, Accum::Replace, lower);
                differentiate(lower, below, self.activation);
            } else if !self.id_bias.is_empty() {
                let ids = ids.iter().map(|id| usize::from(*id));
                sum_rows_by(&mut gradient[self.id_bias.clone()], delta, ids, layer.n_out());
            }
        }
    }
}

#[cfg(test)]
mod tests;
