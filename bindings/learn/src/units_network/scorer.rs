//! The actions that target a unit: the number of each follows from the embedding of the unit and the trunk.

use super::encoder::{EncoderMemory, UNSEEN};
use super::passes::{activate, add_of_sample, dot, sum_by_sample};
use crate::config::Activation;
use crate::linear::{Linear, NamedMap, differentiate, fit};
use crate::math::vectorised;
use faer::Accum;

/// The maps of a kind of targets: U_k; u_k, V_k; and s_k.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scorer {
    unit: Linear,
    trunk: Linear,
    score: Linear,
}

/// What both passes read.
#[derive(Clone, Copy)]
pub(super) struct Pass<'a> {
    pub params: &'a [f32],
    /// `[samples, H]`.
    pub trunk: &'a [f32],
    pub activation: Activation,
}

/// The memory of the targets of a kind. A target is a unit that is seen; those of a sample that are not seen
/// have one in common, whose embedding is zero.
#[derive(Debug, Default)]
pub(super) struct ScorerMemory {
    /// By sample and action, the target; [`UNSEEN`] in samples whose actions target another kind.
    target_of: Vec<u32>,
    /// The row of the unit of each target, or [`UNSEEN`].
    rows: Vec<u32>,
    /// The sample of each target.
    samples: Vec<u32>,
    /// `[samples, W]`: V_k t + u_k.
    base: Vec<f32>,
    /// `[targets, W]`, as the following three.
    embedding: Vec<f32>,
    hidden: Vec<f32>,
    d_embedding: Vec<f32>,
    d_hidden: Vec<f32>,
    /// `[targets]`.
    scores: Vec<f32>,
}

impl ScorerMemory {
    /// Replaces the scores by their gradients, and keeps only targets with one: most actions that target a
    /// unit are unavailable, and nothing depends on their numbers.
    fn collect<'a>(&mut self, d_outputs: impl Iterator<Item = &'a [f32]>, width: usize) {
        let ScorerMemory { target_of, rows, samples, embedding, hidden, scores, .. } = self;
        scores[..rows.len()].fill(0.0);
        let mut targets = target_of.iter();
        for d_outputs in d_outputs {
            for (d, target) in d_outputs.iter().zip(targets.by_ref()) {
                if *target != UNSEEN {
                    scores[*target as usize] += d;
                }
            }
        }
        let mut kept = 0;
        for target in 0..rows.len() {
            if scores[target] != 0.0 {
                (scores[kept], rows[kept], samples[kept]) = (scores[target], rows[target], samples[target]);
                let row = target * width..(target + 1) * width;
                embedding.copy_within(row.clone(), kept * width);
                hidden.copy_within(row, kept * width);
                kept += 1;
            }
        }
        rows.truncate(kept);
        samples.truncate(kept);
    }
}

impl Scorer {
    pub fn new(width: usize, trunk_width: usize, end: &mut usize) -> Scorer {
        Scorer {
            unit: Linear::without_bias(width, width, end),
            trunk: Linear::new(trunk_width, width, end),
            score: Linear::new(width, 1, end),
        }
    }

    pub fn maps(&self, name: &str, last_gain: f64) -> [NamedMap<'_>; 3] {
        let named = |part, map, gain| (format!("{name}.target.{part}"), map, gain);
        // The first two are halves of a sum.
        [
            named("unit", &self.unit, 1.0),
            named("trunk", &self.trunk, 1.0),
            named("score", &self.score, last_gain),
        ]
    }

    /// Finds the targets of `count` actions per sample. `row_of` returns the row of a sample's target, or
    /// [`UNSEEN`]; `None` if the sample's actions target another kind.
    pub fn find(
        &self,
        n_samples: usize,
        count: usize,
        row_of: impl Fn(usize, usize) -> Option<u32>,
        memory: &mut ScorerMemory,
    ) {
        let ScorerMemory { target_of, rows, samples, .. } = memory;
        target_of.clear();
        rows.clear();
        samples.clear();
        for sample in 0..n_samples {
            let mut unseen = UNSEEN;
            for target in 0..count {
                let Some(row) = row_of(sample, target) else {
                    target_of.push(UNSEEN);
                    continue;
                };
                if row == UNSEEN && unseen != UNSEEN {
                    target_of.push(unseen);
                    continue;
                }
                if row == UNSEEN {
                    unseen = rows.len() as u32;
                }
                target_of.push(rows.len() as u32);
                rows.push(row);
                samples.push(sample as u32);
            }
        }
    }

    /// Writes the numbers of all actions to `outputs`, one row per sample.
    pub fn forward<'a>(
        &self,
        Pass { params, trunk, activation }: Pass<'_>,
        of_kind: &EncoderMemory,
        memory: &mut ScorerMemory,
        outputs: impl Iterator<Item = &'a mut [f32]>,
    ) {
        let width = self.unit.n_out();
        let ScorerMemory { target_of, rows, samples, base, embedding, hidden, scores, .. } = memory;
        let len = rows.len() * width;
        let (embedding, hidden, scores) = (fit(embedding, len), fit(hidden, len), fit(scores, rows.len()));
        let base = fit(base, trunk.len() / self.trunk.n_in() * width);
        for (to, row) in embedding.chunks_exact_mut(width).zip(&*rows) {
            match *row {
                UNSEEN => to.fill(0.0),
                row => to.copy_from_slice(&of_kind.embedding[row as usize * width..][..width]),
            }
        }
        self.trunk.forward(params, trunk, base, None);
        self.unit.products(params, embedding, hidden);
        let (score, bias) = (self.score.weights(params), self.score.bias(params)[0]);
        vectorised(
            #[inline(always)]
            || {
                add_of_sample(hidden, base, samples, width);
                activate(hidden, activation);
                let rows = hidden.chunks_exact(width);
                scores.iter_mut().zip(rows).for_each(|(to, row)| *to = dot(row, score) + bias);
            },
        );
        let mut targets = target_of.iter();
        for outputs in outputs {
            for (to, target) in outputs.iter_mut().zip(targets.by_ref()) {
                if *target != UNSEEN {
                    *to = scores[*target as usize];
                }
            }
        }
    }

    /// Adds the gradients of the maps, of the trunk and of the embeddings, from those of the actions'
    /// numbers.
    pub fn backward<'a>(
        &self,
        Pass { params, trunk, activation }: Pass<'_>,
        d_outputs: impl Iterator<Item = &'a [f32]>,
        of_kind: &mut EncoderMemory,
        memory: &mut ScorerMemory,
        d_trunk: &mut [f32],
        gradient: &mut [f32],
    ) {
        let width = self.unit.n_out();
        memory.collect(d_outputs, width);
        let len = memory.rows.len() * width;
        let ScorerMemory { rows, samples, base, embedding, hidden, d_embedding, d_hidden, scores, .. } =
            memory;
        let (embedding, hidden) = (&embedding[..len], &hidden[..len]);
        let (d_embedding, d_hidden) = (fit(d_embedding, len), fit(d_hidden, len));
        let scores = &scores[..rows.len()];
        self.differentiate_scores(params, scores, hidden, d_hidden, gradient);
        differentiate(d_hidden, hidden, activation);
        self.unit.backward(embedding, d_hidden, gradient);
        self.unit.lower(params, d_hidden, Accum::Replace, d_embedding);
        for (d, row) in d_embedding.chunks_exact(width).zip(&*rows) {
            if *row != UNSEEN {
                let to = &mut of_kind.d_embedding[*row as usize * width..][..width];
                to.iter_mut().zip(d).for_each(|(to, d)| *to += d);
            }
        }
        let d_base = &mut base[..trunk.len() / self.trunk.n_in() * width];
        sum_by_sample(d_base, d_hidden, samples, width);
        self.trunk.backward(trunk, d_base, gradient);
        self.trunk.lower(params, d_base, Accum::Add, d_trunk);
    }

    /// From the gradients of the scores, those of s_k and of what it is multiplied by.
    fn differentiate_scores(
        &self,
        params: &[f32],
        d_scores: &[f32],
        hidden: &[f32],
        d_hidden: &mut [f32],
        gradient: &mut [f32],
    ) {
        let (score, width) = (self.score.weights(params), self.unit.n_out());
        let [d_score, d_bias] = self.score.gradients(gradient);
        vectorised(
            #[inline(always)]
            || {
                let rows = hidden.chunks_exact(width).zip(d_hidden.chunks_exact_mut(width));
                for (d, (hidden, d_hidden)) in d_scores.iter().zip(rows) {
                    d_bias[0] += d;
                    for j in 0..width {
                        d_score[j] += d * hidden[j];
                        d_hidden[j] = d * score[j];
                    }
                }
            },
        );
    }
}
