//! Tests of `mlp`.

use super::*;
use crate::architecture::Architecture;
use crate::gradient_check::{self, randoms};
use crate::linear::orthogonal;
use crate::random::{Purpose, generator};

/// The network with loops, in f64.
fn naive(mlp: &Mlp, params: &[f64], x: &[f64], id: Option<usize>) -> Vec<f64> {
    let mut a = x.to_vec();
    for (i, layer) in mlp.layers.iter().enumerate() {
        let [weight, bias] = layer.ranges().map(|range| &params[range]);
        a = (0..layer.n_out())
            .map(|o| {
                let product: f64 = a.iter().zip(&weight[o * layer.n_in()..]).map(|(a, w)| a * w).sum();
                let mut z = product + bias[o];
                if let (0, Some(id)) = (i, id) {
                    z += params[mlp.id_bias.clone()][id * layer.n_out() + o];
                }
                match mlp.activation {
                    _ if i + 1 == mlp.layers.len() => z,
                    Activation::Relu => z.max(0.0),
                    Activation::Tanh => z.tanh(),
                }
            })
            .collect();
    }
    a
}

fn check(rows: usize, hidden: &[usize], n_ids: usize, activation: Activation) {
    let mlp = Mlp::new(5, hidden, 3, n_ids, activation);
    let ids: Vec<u16> = (0..rows).map(|row| (row % n_ids.max(1)) as u16).collect();
    let outputs = |params: &[f64], x: &[f64], id| naive(&mlp, params, x, (n_ids > 0).then_some(id));
    gradient_check::check(&Architecture::Flat(mlp.clone()), (&randoms(8, rows * 5), &ids), outputs, 1e-4);
}

#[test]
fn gradients_equal_finite_differences() {
    for activation in [Activation::Relu, Activation::Tanh] {
        check(9, &[6, 4], 3, activation);
        check(1, &[7], 0, activation);
        check(20, &[3, 5, 2], 0, activation);
    }
}

#[test]
fn orthogonal_matrices_are_orthogonal() {
    let mut generator = generator(1, Purpose::Weights, [0, 0]);
    for (rows, columns) in [(4, 9), (9, 4), (5, 5), (1, 3)] {
        let weights = orthogonal(rows, columns, &mut generator);
        let at = |vector: usize, k: usize| {
            if rows <= columns { weights[vector * columns + k] } else { weights[k * columns + vector] }
        };
        for i in 0..rows.min(columns) {
            for j in 0..rows.min(columns) {
                let product: f64 = (0..rows.max(columns)).map(|k| at(i, k) * at(j, k)).sum();
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((product - expected).abs() < 1e-12, "{rows} x {columns}: {i} {j} {product}");
            }
        }
    }
}

#[test]
fn padding_is_zero_and_not_among_the_tensors() {
    let mlp = Mlp::new(6, &[4], 3, 2, Activation::Relu);
    let network = Architecture::Flat(mlp.clone());
    let params = network.initial_params(1.0, &mut generator(1, Purpose::Weights, [0, 0]));
    let shapes: Vec<(String, Vec<usize>)> =
        mlp.tensors().into_iter().map(|tensor| (tensor.name, tensor.shape)).collect();
    let named = |name: &str, shape: &[usize]| (name.to_owned(), shape.to_vec());
    assert_eq!(
        shapes,
        [
            named("0.weight", &[4, 6]),
            named("0.bias", &[4]),
            named("1.weight", &[3, 4]),
            named("1.bias", &[3]),
            named("id_bias", &[2, 4]),
        ]
    );
    let [weight, _] = mlp.layers[1].ranges();
    let padding = weight.start + 3 * 4..weight.end;
    assert!(padding.len() == 5 * 4 && params[padding].iter().all(|weight| *weight == 0.0));
}
