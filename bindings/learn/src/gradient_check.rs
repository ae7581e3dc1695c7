//! For tests: the gradients of a network are the finite differences of the same network, written with
//! loops in f64.

use crate::architecture::{Architecture, Workspace};
use crate::random::{Purpose, generator, uniform};

/// Numbers between -1 and 1.
pub(crate) fn randoms(seed: u64, n: usize) -> Vec<f32> {
    let mut generator = generator(seed, Purpose::Weights, [0, 0]);
    (0..n).map(|_| 2.0 * uniform(&mut generator) - 1.0).collect()
}

/// Checks outputs and gradients for the rows of `x`, which are those of the agents `ids`. `outputs` has the
/// parameters, a row and its agent.
pub(crate) fn check(
    network: &Architecture,
    (x, ids): (&[f32], &[u16]),
    outputs: impl Fn(&[f64], &[f64], usize) -> Vec<f64>,
    tolerance: f64,
) {
    let (n_params, padded, n_in) = (network.n_params(), network.padded_out(), x.len() / ids.len());
    let params = randoms(7, n_params);
    // The loss is the sum of the outputs, each times a random number.
    let factors = randoms(9, ids.len() * padded);
    let widened = |values: &[f32]| values.iter().copied().map(f64::from).collect::<Vec<f64>>();
    let (mut wide, wide_x) = (widened(&params), widened(x));
    let loss = |params: &[f64]| -> f64 {
        let rows = wide_x.chunks_exact(n_in).zip(ids).zip(factors.chunks_exact(padded));
        let of_row = |((x, id), factors): ((&[f64], &u16), &[f32])| {
            let outputs = outputs(params, x, usize::from(*id));
            outputs.iter().zip(factors).map(|(z, factor)| z * f64::from(*factor)).sum::<f64>()
        };
        rows.map(of_row).sum()
    };
    let (mut workspace, mut gradient) = (Workspace::default(), vec![0.0; n_params]);
    // Memory of a larger pass before changes nothing.
    let (more, more_ids) = ([x, x].concat(), [ids, ids].concat());
    network.forward(&params, &more, &more_ids, &mut workspace);
    network.backward(&params, &more, &more_ids, &mut workspace, &mut vec![0.0; n_params]);
    network.forward(&params, x, ids, &mut workspace);
    let outputs = workspace.output();
    assert_eq!(outputs.len(), ids.len() * padded);
    let computed: f64 = outputs.iter().zip(&factors).map(|(z, f)| f64::from(*z) * f64::from(*f)).sum();
    assert!((computed - loss(&wide)).abs() < tolerance, "{computed} {}", loss(&wide));
    outputs.copy_from_slice(&factors);
    network.backward(&params, x, ids, &mut workspace, &mut gradient);
    for i in network.tensors().into_iter().flat_map(|tensor| tensor.range) {
        let mut at = |value: f64| {
            wide[i] = value;
            loss(&wide)
        };
        let middle = f64::from(params[i]);
        let expected = (at(middle + 1e-6) - at(middle - 1e-6)) / 2e-6;
        at(middle);
        let error = (f64::from(gradient[i]) - expected).abs();
        assert!(error < tolerance * (1.0 + expected.abs()), "parameter {i}: {} {expected}", gradient[i]);
    }
}
