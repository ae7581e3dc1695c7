//! The units of one kind: their rows are gathered, embedded and pooled, and the way back.

use super::passes::{activate, add_of_sample, sum_by_sample};
use crate::config::Activation;
use crate::linear::{Linear, NamedMap, differentiate, fit};
use crate::math::{WIDTH, vectorised};
use faer::Accum;
use smaclite_engine::UnitRows;
use std::f64::consts::SQRT_2;

/// Stands for the row of a unit that is not seen.
pub(super) const UNSEEN: u32 = u32::MAX;

/// The maps of a kind: c_k, A_k, and d_k, B_k.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Encoder {
    rows: UnitRows,
    /// The length of a row.
    row_width: usize,
    width: usize,
    first: Linear,
    second: Linear,
}

/// The memory of the rows of a kind.
#[derive(Debug, Default)]
pub(super) struct EncoderMemory {
    /// By sample, where its rows begin; then their end.
    pub begins: Vec<u32>,
    /// The sample of each row.
    samples: Vec<u32>,
    /// By sample and unit, the row, or [`UNSEEN`].
    pub row_of: Vec<u32>,
    /// `[rows, row_width]`.
    x: Vec<f32>,
    /// `[samples, W]`: o + c_k.
    base: Vec<f32>,
    /// `[rows, W]`, as the following three.
    hidden: Vec<f32>,
    pub embedding: Vec<f32>,
    pub d_embedding: Vec<f32>,
    d_hidden: Vec<f32>,
    /// `[samples, W]`: the row with the maximum.
    largest: Vec<u32>,
}

impl EncoderMemory {
    fn rows(&self) -> usize {
        self.samples.len()
    }
}

impl Encoder {
    pub fn new(rows: &UnitRows, width: usize, end: &mut usize) -> Encoder {
        let row_width = rows.width();
        let first = Linear::new(row_width, width, end);
        Encoder { rows: rows.clone(), row_width, width, first, second: Linear::new(width, width, end) }
    }

    pub fn count(&self) -> usize {
        self.rows.count
    }

    pub fn maps(&self, name: &str) -> [NamedMap<'_>; 2] {
        // The first is half of a sum, as the own embedding.
        [(format!("{name}.0"), &self.first, 1.0), (format!("{name}.1"), &self.second, SQRT_2)]
    }

    /// Copies the rows of the units that are seen, so that the others cost nothing.
    pub fn gather<'a>(&self, inputs: impl Iterator<Item = &'a [f32]>, memory: &mut EncoderMemory) {
        let EncoderMemory { begins, samples, row_of, x, .. } = memory;
        begins.clear();
        samples.clear();
        row_of.clear();
        x.clear();
        for (sample, input) in inputs.enumerate() {
            begins.push(samples.len() as u32);
            for unit in 0..self.rows.count {
                if !self.rows.is_seen(input, unit) {
                    row_of.push(UNSEEN);
                    continue;
                }
                row_of.push(samples.len() as u32);
                samples.push(sample as u32);
                self.rows.row(input, unit).for_each(|part| x.extend_from_slice(part));
            }
        }
        begins.push(samples.len() as u32);
    }

    /// The embeddings of all rows, from the own embeddings o of all samples.
    pub fn forward(&self, params: &[f32], own: &[f32], activation: Activation, memory: &mut EncoderMemory) {
        let len = memory.rows() * self.width;
        let EncoderMemory { samples, x, base, hidden, embedding, .. } = memory;
        let (hidden, embedding) = (fit(hidden, len), fit(embedding, len));
        let (base, bias) = (fit(base, own.len()), self.first.bias(params));
        base.copy_from_slice(own);
        self.first.products(params, x, hidden);
        vectorised(
            #[inline(always)]
            || {
                base.chunks_exact_mut(bias.len())
                    .for_each(|row| row.iter_mut().zip(bias).for_each(|(to, bias)| *to += bias));
                add_of_sample(hidden, base, samples, bias.len());
                activate(hidden, activation);
            },
        );
        self.second.forward(params, hidden, embedding, Some(activation));
    }

    /// Writes the sum and the maximum of each sample's embeddings, zeros if it sees none, to the columns
    /// from `column` on of rows of `stride`.
    pub fn pool(&self, memory: &mut EncoderMemory, to: &mut [f32], stride: usize, column: usize) {
        let width = self.width;
        let EncoderMemory { begins, embedding, largest, .. } = memory;
        let largest = fit(largest, to.len() / stride * width);
        let pooled =
            to.chunks_exact_mut(stride).map(|row| row[column..column + 2 * width].split_at_mut(width));
        vectorised(
            #[inline(always)]
            || {
                for ((sample, (sum, max)), largest) in pooled.enumerate().zip(largest.chunks_exact_mut(width))
                {
                    let rows = begins[sample] as usize..begins[sample + 1] as usize;
                    let of_rows = &embedding[rows.start * width..rows.end * width];
                    let whole = width / WIDTH * WIDTH;
                    for j in (0..whole).step_by(WIDTH) {
                        let part = j..j + WIDTH;
                        let (s, m, l) = pool_columns::<WIDTH>(of_rows, rows.start as u32, width, j);
                        sum[part.clone()].copy_from_slice(&s);
                        max[part.clone()].copy_from_slice(&m);
                        largest[part].copy_from_slice(&l);
                    }
                    for j in whole..width {
                        let (s, m, l) = pool_columns::<1>(of_rows, rows.start as u32, width, j);
                        (sum[j], max[j], largest[j]) = (s[0], m[0], l[0]);
                    }
                }
            },
        );
    }

    /// Before the way back: no gradient yet.
    pub fn clear(&self, memory: &mut EncoderMemory) {
        let len = memory.rows() * self.width;
        fit(&mut memory.d_embedding, len).fill(0.0);
    }

    /// Adds what [`pool`](Self::pool) passes back to the gradients of the embeddings.
    pub fn unpool(&self, memory: &mut EncoderMemory, d_pooled: &[f32], stride: usize, column: usize) {
        let width = self.width;
        let EncoderMemory { begins, d_embedding, largest, .. } = memory;
        vectorised(
            #[inline(always)]
            || {
                for (sample, row) in d_pooled.chunks_exact(stride).enumerate() {
                    let (sum, max) = row[column..column + 2 * width].split_at(width);
                    let largest = &largest[sample * width..][..width];
                    for row in begins[sample]..begins[sample + 1] {
                        let d = &mut d_embedding[row as usize * width..][..width];
                        for j in 0..width {
                            d[j] += sum[j] + if largest[j] == row { max[j] } else { 0.0 };
                        }
                    }
                }
            },
        );
    }

    /// Adds the gradients of the maps, and those of the own embeddings to `d_own`.
    pub fn backward(
        &self,
        params: &[f32],
        activation: Activation,
        memory: &mut EncoderMemory,
        d_own: &mut [f32],
        gradient: &mut [f32],
    ) {
        let len = memory.rows() * self.width;
        let EncoderMemory { samples, x, base, hidden, embedding, d_embedding, d_hidden, .. } = memory;
        let (embedding, hidden) = (&embedding[..len], &hidden[..len]);
        let (d_embedding, d_hidden) = (&mut d_embedding[..len], fit(d_hidden, len));
        differentiate(d_embedding, embedding, activation);
        self.second.backward(hidden, d_embedding, gradient);
        self.second.lower(params, d_embedding, Accum::Replace, d_hidden);
        differentiate(d_hidden, hidden, activation);
        self.first.backward_weights(x, d_hidden, gradient);
        let d_base = &mut base[..d_own.len()];
        sum_by_sample(d_base, d_hidden, samples, self.width);
        self.first.backward_bias(d_base, gradient);
        crate::math::add(d_own, d_base);
    }
}

/// Sum, maximum and the first row with the maximum of `N` columns of rows, which stay in registers meanwhile.
/// The first row has the number `first`.
#[inline(always)]
fn pool_columns<const N: usize>(
    rows: &[f32],
    first: u32,
    width: usize,
    column: usize,
) -> ([f32; N], [f32; N], [u32; N]) {
    let (mut sum, mut max, mut largest) = ([0.0; N], [f32::NEG_INFINITY; N], [UNSEEN; N]);
    for (row, number) in rows.chunks_exact(width).zip(first..) {
        let row = &row[column..column + N];
        for j in 0..N {
            let is_larger = row[j] > max[j];
            sum[j] += row[j];
            max[j] = if is_larger { row[j] } else { max[j] };
            largest[j] = if is_larger { number } else { largest[j] };
        }
    }
    (sum, if rows.is_empty() { [0.0; N] } else { max }, largest)
}
