//! Affine maps Z = X Wᵀ + b of rows, the gradient of them, and what they are made of. The products are
//! faer's; bias and activation are one pass over their result. `mlp` derives the gradient.

use crate::config::Activation;
use crate::math::{tanh, vectorised};
use crate::random::normal;
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use rand_pcg::Pcg64Mcg;
use std::ops::Range;

/// A parameter tensor in the vector of parameters.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tensor {
    /// Such as `0.weight`, `0.bias` or `id_bias`.
    pub name: String,
    /// Without padding.
    pub shape: Vec<usize>,
    /// Its elements; padding follows them.
    pub range: Range<usize>,
}

/// A map of which networks are made, and where its parameters lie in the vector of a network's
/// parameters. `weight` is `[n_out, n_in]`, row-major as in PyTorch.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Linear {
    n_in: usize,
    /// Padded: the rows of W behind the others are zeros, because nothing depends on them.
    n_out: usize,
    /// Without padding.
    n_used: usize,
    weight: Range<usize>,
    /// Empty if the map has none.
    bias: Range<usize>,
}

/// A map of a network: its name in files, and by what its first weights are scaled.
pub(crate) type NamedMap<'a> = (String, &'a Linear, f64);

impl Linear {
    /// Places the parameters behind `end`, which then is their end.
    pub fn new(n_in: usize, n_out: usize, end: &mut usize) -> Linear {
        Linear::padded(n_in, n_out, n_out, end)
    }

    /// The same with outputs up to `padded` that nothing depends on.
    pub fn padded(n_in: usize, n_used: usize, padded: usize, end: &mut usize) -> Linear {
        let weight = *end..*end + n_in * padded;
        let bias = weight.end..weight.end + padded;
        *end = bias.end;
        Linear { n_in, n_out: padded, n_used, weight, bias }
    }

    /// The same without a bias: another map, which is added, has one.
    pub fn without_bias(n_in: usize, n_out: usize, end: &mut usize) -> Linear {
        let weight = *end..*end + n_in * n_out;
        *end = weight.end;
        Linear { n_in, n_out, n_used: n_out, bias: weight.end..weight.end, weight }
    }

    /// Inputs per row.
    pub fn n_in(&self) -> usize {
        self.n_in
    }

    /// Outputs per row, padded.
    pub fn n_out(&self) -> usize {
        self.n_out
    }

    /// Its tensors, without those that have no elements.
    pub fn tensors(&self, name: &str) -> impl Iterator<Item = Tensor> + use<> {
        let Linear { n_in, n_used, weight, bias, .. } = self.clone();
        let named = |part: &str, shape: Vec<usize>, start: usize| {
            let len = shape.iter().product::<usize>();
            Tensor { name: format!("{name}.{part}"), shape, range: start..start + len }
        };
        let weight = named("weight", vec![n_used, n_in], weight.start);
        let bias = (!bias.is_empty()).then(|| named("bias", vec![n_used], bias.start));
        [Some(weight), bias].into_iter().flatten().filter(|tensor| !tensor.range.is_empty())
    }

    /// First parameters: an orthogonal W times `gain`, and zeros.
    pub fn initialise(&self, gain: f64, params: &mut [f32], generator: &mut Pcg64Mcg) {
        let weights = orthogonal(self.n_used, self.n_in, generator);
        for (param, weight) in params[self.weight.clone()].iter_mut().zip(weights) {
            *param = (gain * weight) as f32;
        }
    }

    /// Where W and b are, for tests that compute with other numbers.
    #[cfg(test)]
    pub fn ranges(&self) -> [Range<usize>; 2] {
        [self.weight.clone(), self.bias.clone()]
    }

    fn weight_of<'a>(&self, params: &'a [f32]) -> MatRef<'a, f32> {
        matrix(&params[self.weight.clone()], self.n_out, self.n_in)
    }

    /// The elements of W.
    pub fn weights<'a>(&self, params: &'a [f32]) -> &'a [f32] {
        &params[self.weight.clone()]
    }

    /// b.
    pub fn bias<'a>(&self, params: &'a [f32]) -> &'a [f32] {
        &params[self.bias.clone()]
    }

    /// The gradients of W and b.
    pub fn gradients<'a>(&self, gradient: &'a mut [f32]) -> [&'a mut [f32]; 2] {
        let (before, from_bias) = gradient.split_at_mut(self.bias.start);
        [&mut before[self.weight.clone()], &mut from_bias[..self.bias.len()]]
    }

    /// Z = X Wᵀ + b, and f(Z) with an activation.
    pub fn forward(&self, params: &[f32], x: &[f32], z: &mut [f32], activation: Option<Activation>) {
        self.forward_by_id(params, x, &[], &[], z, activation);
    }

    /// The same, with a second bias that the id of the row selects, if there are any.
    pub fn forward_by_id(
        &self,
        params: &[f32],
        x: &[f32],
        id_bias: &[f32],
        ids: &[u16],
        z: &mut [f32],
        activation: Option<Activation>,
    ) {
        self.products(params, x, z);
        let bias = self.bias(params);
        vectorised(
            #[inline(always)]
            || add_bias(z, bias, id_bias, ids, activation),
        );
    }

    /// X Wᵀ.
    pub fn products(&self, params: &[f32], x: &[f32], z: &mut [f32]) {
        let rows = z.len() / self.n_out;
        let (x, weight) = (matrix(x, rows, self.n_in), self.weight_of(params));
        multiply_rows(matrix_mut(z, rows, self.n_out), Accum::Replace, x, weight.transpose());
    }

    /// Adds dL/dW = Gᵀ X and dL/db, the sum of the rows of G.
    pub fn backward(&self, x: &[f32], g: &[f32], gradient: &mut [f32]) {
        self.backward_weights(x, g, gradient);
        if !self.bias.is_empty() {
            self.backward_bias(g, gradient);
        }
    }

    /// Adds dL/dW.
    pub fn backward_weights(&self, x: &[f32], g: &[f32], gradient: &mut [f32]) {
        let rows = g.len() / self.n_out;
        let (x, g) = (matrix(x, rows, self.n_in), matrix(g, rows, self.n_out));
        let into = matrix_mut(&mut gradient[self.weight.clone()], self.n_out, self.n_in);
        multiply_rows(into, Accum::Add, g.transpose(), x);
    }

    /// Adds dL/db, from G or from sums of its rows.
    pub fn backward_bias(&self, g: &[f32], gradient: &mut [f32]) {
        let bias = &mut gradient[self.bias.clone()];
        vectorised(
            #[inline(always)]
            || sum_rows(bias, g),
        );
    }

    /// dL/dX = G W, written to or added to `lower`.
    pub fn lower(&self, params: &[f32], g: &[f32], accum: Accum, lower: &mut [f32]) {
        let rows = g.len() / self.n_out;
        let into = matrix_mut(lower, rows, self.n_in);
        multiply_rows(into, accum, matrix(g, rows, self.n_out), self.weight_of(params));
    }
}

/// [`multiply`], also of nothing: a kind of units of which none is seen has no rows, and an input may have
/// no columns.
fn multiply_rows(mut to: MatMut<'_, f32>, accum: Accum, a: MatRef<'_, f32>, b: MatRef<'_, f32>) {
    if a.ncols() > 0 {
        multiply(to, accum, a, b);
    } else if let Accum::Replace = accum {
        to.fill(0.0);
    }
}

/// Rows as a matrix.
fn matrix(values: &[f32], rows: usize, columns: usize) -> MatRef<'_, f32> {
    MatRef::from_row_major_slice(values, rows, columns)
}

/// The same to write to.
fn matrix_mut(values: &mut [f32], rows: usize, columns: usize) -> MatMut<'_, f32> {
    MatMut::from_row_major_slice_mut(values, rows, columns)
}

/// `to = a b` or `to += a b`. The order of faer's sums in a product of a matrix and a vector depends on the
/// address of the vector, which differs from run to run; so those are computed here.
fn multiply(mut to: MatMut<'_, f32>, accum: Accum, a: MatRef<'_, f32>, b: MatRef<'_, f32>) {
    if to.nrows() > 1 && to.ncols() > 1 {
        return matmul(to, accum, a, b, 1.0, Par::Seq);
    }
    for i in 0..to.nrows() {
        for j in 0..to.ncols() {
            let product: f32 = (0..a.ncols()).map(|k| a[(i, k)] * b[(k, j)]).sum();
            to[(i, j)] = if let Accum::Add = accum { to[(i, j)] + product } else { product };
        }
    }
}

/// Adds the bias to every row, and that of the row's agent if there are ids; then applies the activation.
#[inline(always)]
fn add_bias(z: &mut [f32], bias: &[f32], id_bias: &[f32], ids: &[u16], activation: Option<Activation>) {
    let width = bias.len();
    for (i, row) in z.chunks_exact_mut(width).enumerate() {
        if !id_bias.is_empty() {
            let id = usize::from(ids[i]);
            row.iter_mut().zip(&id_bias[id * width..][..width]).for_each(|(z, bias)| *z += bias);
        }
        let row = row.iter_mut().zip(bias);
        match activation {
            None => row.for_each(|(z, bias)| *z += bias),
            Some(Activation::Relu) => row.for_each(|(z, bias)| *z = (*z + bias).max(0.0)),
            Some(Activation::Tanh) => row.for_each(|(z, bias)| *z = tanh(*z + bias)),
        }
    }
}

/// Adds all rows to `to`.
#[inline(always)]
fn sum_rows(to: &mut [f32], rows: &[f32]) {
    for row in rows.chunks_exact(to.len()) {
        to.iter_mut().zip(row).for_each(|(to, value)| *to += value);
    }
}

/// Adds each row to that of its number in `to`.
pub(crate) fn sum_rows_by(to: &mut [f32], rows: &[f32], numbers: impl Iterator<Item = usize>, width: usize) {
    vectorised(
        #[inline(always)]
        || {
            for (row, number) in rows.chunks_exact(width).zip(numbers) {
                let to = &mut to[number * width..][..width];
                to.iter_mut().zip(row).for_each(|(to, value)| *to += value);
            }
        },
    );
}

/// Multiplies dL/dA by the derivative of the activation, given its outputs.
pub(crate) fn differentiate(delta: &mut [f32], outputs: &[f32], activation: Activation) {
    let both = delta.iter_mut().zip(outputs);
    vectorised(
        #[inline(always)]
        || match activation {
            Activation::Relu => both.for_each(|(d, a)| *d = if *a > 0.0 { *d } else { 0.0 }),
            Activation::Tanh => both.for_each(|(d, a)| *d *= 1.0 - a * a),
        },
    );
}

/// Memory for `len` numbers, which only grows.
pub(crate) fn fit<T: Clone + Default>(memory: &mut Vec<T>, len: usize) -> &mut [T] {
    memory.resize(memory.len().max(len), T::default());
    &mut memory[..len]
}

/// A random `[rows, columns]` matrix, row-major, with orthonormal rows or, if there are more rows than
/// columns, orthonormal columns: Gaussian vectors, made orthogonal one after the other (Gram and Schmidt).
/// The second pass removes what rounding left of the first.
pub(crate) fn orthogonal(rows: usize, columns: usize, generator: &mut Pcg64Mcg) -> Vec<f64> {
    let (count, len) = (rows.min(columns), rows.max(columns));
    let mut vectors: Vec<Vec<f64>> = Vec::with_capacity(count);
    while vectors.len() < count {
        let mut vector: Vec<f64> = (0..len).map(|_| normal(generator)).collect();
        for other in vectors.iter().chain(&vectors) {
            let projection: f64 = vector.iter().zip(other).map(|(a, b)| a * b).sum();
            vector.iter_mut().zip(other).for_each(|(a, b)| *a -= projection * b);
        }
        let norm = vector.iter().map(|a| a * a).sum::<f64>().sqrt();
        if norm > 1e-6 {
            vector.iter_mut().for_each(|a| *a /= norm);
            vectors.push(vector);
        }
    }
    let at = |i: usize, j: usize| if rows <= columns { vectors[i][j] } else { vectors[j][i] };
    (0..rows * columns).map(|k| at(k / columns, k % columns)).collect()
}
