//! Tests of `loss`: the losses written down in f64, whose finite differences are the gradients.

use super::*;
use crate::random::{Purpose, generator, uniform};

/// The loss of a row as the paper writes it.
fn policy_loss(loss: &PolicyLoss, row: &PolicyRow<'_>, outputs: &[f64]) -> f64 {
    let available = |j: usize| row.mask[j] != 0;
    let total: f64 = (0..outputs.len()).filter(|j| available(*j)).map(|j| outputs[j].exp()).sum();
    let p = |j: usize| if available(j) { outputs[j].exp() / total } else { 0.0 };
    let entropy: f64 = (0..outputs.len()).map(p).filter(|p| *p > 0.0).map(|p| -p * p.ln()).sum();
    let (ratio, clip) = (p(row.action) / f64::from(row.old_log_prob).exp(), f64::from(loss.clip));
    let advantage = f64::from(row.advantage);
    let surrogate = (ratio * advantage).min(ratio.clamp(1.0 - clip, 1.0 + clip) * advantage);
    -surrogate - f64::from(loss.entropy) * entropy
}

#[test]
fn the_policy_gradient_equals_finite_differences() {
    let mut generator = generator(5, Purpose::Weights, [0, 0]);
    let (mut n_clipped, mut n_free) = (0, 0);
    for round in 0..200 {
        let mask: Vec<u8> = (0..16).map(|j| u8::from(j == 3 || uniform(&mut generator) < 0.5)).collect();
        let outputs: Vec<f32> = (0..16).map(|_| 4.0 * uniform(&mut generator) - 2.0).collect();
        let entropy = if round % 2 == 0 { 0.0 } else { 0.3 };
        let loss = PolicyLoss { clip: 0.2, entropy, scale: 0.5 };
        let row = PolicyRow {
            mask: &mask,
            action: 3,
            old_log_prob: -0.5 - 2.0 * uniform(&mut generator),
            advantage: 2.0 * uniform(&mut generator) - 1.0,
        };
        let wide: Vec<f64> = outputs.iter().map(|z| f64::from(*z)).collect();
        let (mut gradient, mut stats) = (outputs.clone(), PolicyStats::default());
        loss.differentiate(&row, &mut gradient, &mut [0.0; 16], &mut stats);
        for j in 0..16 {
            let at = |change: f64| {
                let mut outputs = wide.clone();
                outputs[j] += change;
                policy_loss(&loss, &row, &outputs)
            };
            let expected = 0.5 * (at(1e-6) - at(-1e-6)) / 2e-6;
            assert!(
                (f64::from(gradient[j]) - expected).abs() < 2e-5,
                "{round} {j}: {} {expected}",
                gradient[j]
            );
        }
        let total = stats.loss - f64::from(entropy) * stats.entropy;
        assert!((total - policy_loss(&loss, &row, &wide)).abs() < 1e-5);
        if stats.clipped > 0.0 { n_clipped += 1 } else { n_free += 1 }
    }
    assert!(n_clipped > 20 && n_free > 20, "both branches are tested: {n_clipped} {n_free}");
}

#[test]
fn the_value_gradient_equals_finite_differences() {
    let loss = ValueLoss { clip: 0.2, huber: 1.5, scale: 0.25 };
    let huber = |x: f64| if x.abs() <= 1.5 { x * x / 2.0 } else { 1.5 * (x.abs() - 0.75) };
    let naive = |value: f64, old: f64, target: f64| {
        huber(value - target).max(huber(value.clamp(old - 0.2, old + 0.2) - target))
    };
    let mut generator = generator(6, Purpose::Weights, [0, 0]);
    for _ in 0..1000 {
        let mut random = || 4.0 * uniform(&mut generator) - 2.0;
        let (value, target) = (random(), random());
        let old = value + 0.3 * random();
        let at = |change: f64| naive(f64::from(value) + change, f64::from(old), f64::from(target));
        let (computed, derivative) = loss.differentiate(value, old, target);
        assert!((f64::from(computed) - at(0.0)).abs() < 1e-5);
        let expected = 0.25 * (at(1e-7) - at(-1e-7)) / 2e-7;
        let error = (f64::from(derivative) - expected).abs();
        assert!(error < 1e-5, "{value} {old} {target}: {derivative} {expected}");
    }
}
