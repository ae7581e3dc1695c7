//! Tests of `mlp`: the same network written with loops in f64, whose finite differences are the gradient.

use super::*;
use crate::linear::orthogonal;
use crate::random::{Purpose, generator, uniform};

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
    let mut generator = generator(7, Purpose::Weights, [0, 0]);
    let mut random = |n: usize| (0..n).map(|_| 2.0 * uniform(&mut generator) - 1.0).collect::<Vec<f32>>();
    let (params, x) = (random(mlp.n_params()), random(rows * 5));
    let ids: Vec<u16> = (0..rows).map(|row| (row % n_ids.max(1)) as u16).collect();
    // The loss is the sum of the outputs, each times a random number.
    let factors = random(rows * mlp.padded_out());
    let wide: Vec<f64> = params.iter().map(|p| f64::from(*p)).collect();
    let loss = |params: &[f64]| -> f64 {
        let of_row = |row: usize| {
            let x: Vec<f64> = x[row * 5..][..5].iter().map(|x| f64::from(*x)).collect();
            let outputs = naive(&mlp, params, &x, (n_ids > 0).then_some(row % n_ids.max(1)));
            let factors = &factors[row * mlp.padded_out()..];
            outputs.iter().zip(factors).map(|(z, factor)| z * f64::from(*factor)).sum::<f64>()
        };
        (0..rows).map(of_row).sum()
    };
    let (mut workspace, mut gradient) = (Workspace::default(), vec![0.0; mlp.n_params()]);
    mlp.forward(&params, &x, &ids, &mut workspace);
    let outputs = workspace.output();
    let computed: f64 = outputs.iter().zip(&factors).map(|(z, f)| f64::from(*z) * f64::from(*f)).sum();
    assert!((computed - loss(&wide)).abs() < 1e-4, "{computed} {}", loss(&wide));
    outputs.copy_from_slice(&factors);
    mlp.backward(&params, &x, &ids, &mut workspace, &mut gradient);
    for i in 0..mlp.n_params() {
        let at = |change: f64| {
            let mut params = wide.clone();
            params[i] += change;
            loss(&params)
        };
        let expected = (at(1e-6) - at(-1e-6)) / 2e-6;
        let error = (f64::from(gradient[i]) - expected).abs();
        assert!(error < 1e-4 * (1.0 + expected.abs()), "parameter {i}: {} {expected}", gradient[i]);
    }
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
    let params = mlp.initial_params(1.0, &mut generator(1, Purpose::Weights, [0, 0]));
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
