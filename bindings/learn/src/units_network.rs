//! Networks over units: the same maps for every unit of a kind, so that what is learnt of one holds for all,
//! and their order does not matter (deep sets; Zaheer et al., 2017).
//!
//! **Forward.** An input has a row x_i for each unit of each kind k, enemies and allies, and the rest y,
//! which belongs to no other unit. With f the activation,
//!
//! - o = A y + c, the own embedding,
//! - r_i = f(A_k x_i + c_k + o) and e_i = f(B_k r_i + d_k) for every unit that is seen, the embeddings,
//! - p = (f(o), for each kind Σ_i e_i and max_i e_i), zeros where no unit is seen,
//! - t = f(T₂ f(T₁ p + ..) + ..), the trunk,
//! - z = F t + g, the outputs that target no unit: the other actions, or the value of a critic,
//! - q_i = f(U_k e_i + V_k t + u_k) and z_i = s_k · q_i + h_k for the actions that target unit i of kind k.
//!
//! Units that are not seen have zeros only as rows. They do not enter sums and maxima, and as targets they
//! have e_i = 0. An agent's targets are enemies, or allies if it heals; `TargetLayout` (smaclite_engine) says
//! which action means which unit, and which agents heal. Agents share all parameters and have none of their
//! own.
//!
//! **Backward.** With dv for dL/dv: the gradients of an affine map are those of `mlp`, for the rows of all
//! units at once; d before f is that behind f times f', which follows from the output. What enters several
//! terms collects their gradients:
//!
//! - dt = Fᵀ dz + Σ_k V_kᵀ Σ_i dq_i, with dq_i = dz_i s_k times f';
//! - de_i = U_kᵀ dq_i + d(Σ) + d(max), the last only in the elements where e_i was the first maximum;
//! - do = d f(o) times f' + Σ_k Σ_i dr_i, with dr_i = B_kᵀ de_i, where de_i and dr_i are before f.
//!
//! **Memory.** Rows of samples lie one after the other. `encoder` copies the rows of a kind that are seen
//! beside one another, so each map is one product of matrices for all units of all samples, and units that
//! are dead or far away cost nothing. `scorer` has the targets, `passes` what both use.

mod encoder;
mod passes;
mod scorer;

use crate::config::Activation;
use crate::linear::{Linear, NamedMap, Tensor, differentiate, fit};
use crate::math::{WIDTH, zeros};
use encoder::{Encoder, EncoderMemory};
use faer::Accum;
use passes::activate;
use scorer::{Pass, Scorer, ScorerMemory};
use smaclite_engine::{TargetLayout, UnitLayout};
use std::f64::consts::SQRT_2;

/// Names of the kinds, in their order.
const KINDS: [&str; 2] = ["enemies", "allies"];
const ENEMIES: usize = 0;
const ALLIES: usize = 1;

/// The architecture of a network over units, and where its parameters lie in their vector.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct UnitsNetwork {
    layout: UnitLayout,
    /// `None` for a critic.
    targets: Option<TargetLayout>,
    /// The length of an input.
    n_in: usize,
    activation: Activation,
    own: Linear,
    /// By kind; `None` if there are no such units.
    encoders: [Option<Encoder>; 2],
    trunk: [Linear; 2],
    /// By kind; `None` if no action targets such units.
    scorers: [Option<Scorer>; 2],
    /// The last one, so that a critic's last tensors are those of its value.
    head: Linear,
    /// Outputs of `head`, without padding.
    n_head: usize,
    n_params: usize,
}

/// The memory of a forward and a backward pass. It holds no state between passes, and only grows.
#[derive(Debug, Default)]
pub(crate) struct Workspace {
    samples: usize,
    /// By sample, whether its actions target allies.
    heals: Vec<bool>,
    /// `[samples, width of the rest]`.
    rest: Vec<f32>,
    /// `[samples, W]`.
    own: Vec<f32>,
    d_own: Vec<f32>,
    encoders: [EncoderMemory; 2],
    /// `[samples, W (1 + 2 kinds)]`.
    pooled: Vec<f32>,
    d_pooled: Vec<f32>,
    /// `[samples, H]`.
    trunk: [Vec<f32>; 2],
    d_trunk: [Vec<f32>; 2],
    scorers: [ScorerMemory; 2],
    head: Vec<f32>,
    output: Vec<f32>,
}

impl Workspace {
    /// The outputs of the last forward pass, `[rows, padded n_out]`. Before the backward pass they are
    /// replaced by the gradient of the loss with respect to them.
    pub fn output(&mut self) -> &mut [f32] {
        &mut self.output
    }
}

impl UnitsNetwork {
    /// A network for inputs of `n_in` numbers with this layout. `widths` are those of embeddings and of the
    /// trunk. An actor has an output per action, a critic, without targets, one.
    pub fn new(
        n_in: usize,
        layout: UnitLayout,
        targets: Option<TargetLayout>,
        [width, trunk_width]: [usize; 2],
        activation: Activation,
    ) -> UnitsNetwork {
        let mut end = 0;
        let own = Linear::new(layout.rest_width(), width, &mut end);
        let encoders = [&layout.enemies, &layout.allies]
            .map(|rows| (rows.count > 0).then(|| Encoder::new(rows, width, &mut end)));
        let pooled = width * (1 + 2 * encoders.iter().flatten().count());
        let trunk = [pooled, trunk_width].map(|n_in| Linear::new(n_in, trunk_width, &mut end));
        let is_target = |kind: usize| match &targets {
            Some(targets) if kind == ALLIES => targets.has_healers(),
            targets => targets.is_some(),
        };
        let scorers = [ENEMIES, ALLIES].map(|kind| {
            let is_scored = encoders[kind].is_some() && is_target(kind);
            is_scored.then(|| Scorer::new(width, trunk_width, &mut end))
        });
        let n_head = targets.as_ref().map_or(1, |targets| targets.first);
        let head = Linear::padded(trunk_width, n_head, n_head.next_multiple_of(WIDTH), &mut end);
        let n_params = end;
        UnitsNetwork {
            layout,
            targets,
            n_in,
            activation,
            own,
            encoders,
            trunk,
            scorers,
            head,
            n_head,
            n_params,
        }
    }

    /// Length of the vector of parameters.
    pub fn n_params(&self) -> usize {
        self.n_params
    }

    /// What enters the trunk.
    pub fn pooled_width(&self) -> usize {
        self.trunk[0].n_in()
    }

    /// Outputs per row, padded to a multiple of [`WIDTH`].
    pub fn padded_out(&self) -> usize {
        (self.n_head + self.n_targets()).next_multiple_of(WIDTH)
    }

    fn n_targets(&self) -> usize {
        self.targets.as_ref().map_or(0, |targets| targets.count)
    }

    /// The parameter tensors, in their order in the vector.
    pub fn tensors(&self) -> Vec<Tensor> {
        self.maps(1.0).iter().flat_map(|(name, map, _)| map.tensors(name)).collect()
    }

    /// The maps. First weights are orthogonal, scaled as those of an `Mlp`. Where two maps are added, each
    /// has half of the square of √2.
    pub fn maps(&self, last_gain: f64) -> Vec<NamedMap<'_>> {
        let named = |name: &str, map, gain| (name.to_owned(), map, gain);
        let mut maps = vec![named("own", &self.own, 1.0)];
        for (name, encoder) in KINDS.iter().zip(&self.encoders) {
            maps.extend(encoder.iter().flat_map(|encoder| encoder.maps(name)));
        }
        let [lower, upper] = &self.trunk;
        maps.extend([named("trunk.0", lower, SQRT_2), named("trunk.1", upper, SQRT_2)]);
        for (name, scorer) in KINDS.iter().zip(&self.scorers) {
            maps.extend(scorer.iter().flat_map(|scorer| scorer.maps(name, last_gain)));
        }
        maps.push(named("head", &self.head, last_gain));
        maps
    }

    /// Computes the outputs of all rows of `x`, `[rows, n_in]`; see [`Workspace::output`]. `ids` has the
    /// agent of each row, or nothing for a critic.
    pub fn forward(&self, params: &[f32], x: &[f32], ids: &[u16], workspace: &mut Workspace) {
        self.gather(x, ids, workspace);
        let (samples, width, f) = (workspace.samples, self.own.n_out(), self.activation);
        let Workspace { rest, own, encoders, pooled, trunk: [lower, upper], .. } = workspace;
        let own = fit(own, samples * width);
        self.own.forward(params, rest, own, None);
        let stride = self.trunk[0].n_in();
        let pooled = fit(pooled, samples * stride);
        for (to, own) in pooled.chunks_exact_mut(stride).zip(own.chunks_exact(width)) {
            to[..width].copy_from_slice(own);
            activate(&mut to[..width], f);
        }
        for ((_, encoder, memory), column) in
            with_memory(&self.encoders, encoders).zip((width..).step_by(2 * width))
        {
            encoder.forward(params, own, f, memory);
            encoder.pool(memory, pooled, stride, column);
        }
        let trunk_len = samples * self.trunk[1].n_out();
        let (lower, upper) = (fit(lower, trunk_len), fit(upper, trunk_len));
        self.trunk[0].forward(params, pooled, lower, Some(f));
        self.trunk[1].forward(params, lower, upper, Some(f));
        self.write_outputs(params, ids, workspace);
    }

    /// Copies from the inputs what is multiplied.
    fn gather(&self, x: &[f32], ids: &[u16], workspace: &mut Workspace) {
        let inputs = || x.chunks_exact(self.n_in);
        let Workspace { samples, heals, rest, encoders, .. } = workspace;
        *samples = inputs().len();
        rest.clear();
        for input in inputs() {
            self.layout.rest.iter().for_each(|columns| rest.extend_from_slice(&input[columns.clone()]));
        }
        for (_, encoder, memory) in with_memory(&self.encoders, encoders) {
            encoder.gather(inputs(), memory);
        }
        heals.clear();
        if let Some(targets) = &self.targets {
            assert!(ids.len() == *samples, "one agent per row");
            heals.extend(inputs().zip(ids).map(|(input, agent)| targets.heals(usize::from(*agent), input)));
        }
    }

    /// From the trunk to the outputs.
    fn write_outputs(&self, params: &[f32], ids: &[u16], workspace: &mut Workspace) {
        let Workspace { samples, heals, encoders, trunk: [_, trunk], scorers, head, output, .. } = workspace;
        let (padded, n_head) = (self.padded_out(), self.n_head);
        let trunk = &trunk[..*samples * self.trunk[1].n_out()];
        let head = fit(head, *samples * self.head.n_out());
        self.head.forward(params, trunk, head, None);
        zeros(output, *samples * padded);
        for (to, head) in output.chunks_exact_mut(padded).zip(head.chunks_exact(self.head.n_out())) {
            to[..n_head].copy_from_slice(&head[..n_head]);
        }
        let pass = Pass { params, trunk, activation: self.activation };
        for (kind, scorer, memory) in with_memory(&self.scorers, scorers) {
            let (of_kind, n_targets) = (&encoders[kind], self.n_targets());
            let count = self.encoders[kind].as_ref().map_or(0, Encoder::count);
            let row_of = |sample: usize, target: usize| {
                let unit = match kind {
                    ENEMIES => Some(target),
                    _ => TargetLayout::ally_row(usize::from(ids[sample]), target),
                };
                let unit = unit.filter(|unit| *unit < count);
                let row = unit.map_or(encoder::UNSEEN, |unit| of_kind.row_of[sample * count + unit]);
                (heals[sample] == (kind == ALLIES)).then_some(row)
            };
            scorer.find(*samples, n_targets, row_of, memory);
            let outputs = output.chunks_exact_mut(padded).map(|row| &mut row[n_head..n_head + n_targets]);
            scorer.forward(pass, of_kind, memory, outputs);
        }
    }

    /// Adds the gradient of the loss with respect to the parameters to `gradient`. The forward pass of the
    /// same inputs was the last of this workspace, and its output now is the gradient of the loss with
    /// respect to the output.
    pub fn backward(&self, params: &[f32], workspace: &mut Workspace, gradient: &mut [f32]) {
        self.backward_outputs(params, workspace, gradient);
        let (samples, width, f) = (workspace.samples, self.own.n_out(), self.activation);
        let Workspace { rest, d_own, encoders, pooled, d_pooled, trunk, d_trunk, .. } = workspace;
        let (stride, trunk_len) = (self.trunk[0].n_in(), samples * self.trunk[1].n_out());
        let [lower, upper] = trunk.each_ref().map(|outputs| &outputs[..trunk_len]);
        let [d_lower, d_upper] = d_trunk.each_mut().map(|delta| fit(delta, trunk_len));
        let (pooled, d_pooled) = (&pooled[..samples * stride], fit(d_pooled, samples * stride));
        differentiate(d_upper, upper, f);
        self.trunk[1].backward(lower, d_upper, gradient);
        self.trunk[1].lower(params, d_upper, Accum::Replace, d_lower);
        differentiate(d_lower, lower, f);
        self.trunk[0].backward(pooled, d_lower, gradient);
        self.trunk[0].lower(params, d_lower, Accum::Replace, d_pooled);
        let d_own = fit(d_own, samples * width);
        let rows = d_pooled.chunks_exact(stride).zip(pooled.chunks_exact(stride));
        for (d_own, (d_pooled, pooled)) in d_own.chunks_exact_mut(width).zip(rows) {
            d_own.copy_from_slice(&d_pooled[..width]);
            differentiate(d_own, &pooled[..width], f);
        }
        for ((_, encoder, memory), column) in
            with_memory(&self.encoders, encoders).zip((width..).step_by(2 * width))
        {
            encoder.unpool(memory, d_pooled, stride, column);
            encoder.backward(params, f, memory, d_own, gradient);
        }
        self.own.backward(rest, d_own, gradient);
    }

    /// From the gradients of the outputs, those of the trunk and of the embeddings.
    fn backward_outputs(&self, params: &[f32], workspace: &mut Workspace, gradient: &mut [f32]) {
        let Workspace {
            samples,
            encoders,
            trunk: [_, trunk],
            d_trunk: [_, d_trunk],
            scorers,
            head,
            output,
            ..
        } = workspace;
        let (padded, n_head, n_targets) = (self.padded_out(), self.n_head, self.n_targets());
        let trunk_len = *samples * self.trunk[1].n_out();
        let (trunk, d_trunk) = (&trunk[..trunk_len], fit(d_trunk, trunk_len));
        let d_head = &mut head[..*samples * self.head.n_out()];
        for (d_head, d_output) in d_head.chunks_exact_mut(self.head.n_out()).zip(output.chunks_exact(padded))
        {
            d_head.fill(0.0);
            d_head[..n_head].copy_from_slice(&d_output[..n_head]);
        }
        self.head.backward(trunk, d_head, gradient);
        self.head.lower(params, d_head, Accum::Replace, d_trunk);
        for (_, encoder, memory) in with_memory(&self.encoders, encoders) {
            encoder.clear(memory);
        }
        let pass = Pass { params, trunk, activation: self.activation };
        for (kind, scorer, memory) in with_memory(&self.scorers, scorers) {
            let d_outputs = output.chunks_exact(padded).map(|row| &row[n_head..n_head + n_targets]);
            let of_kind = &mut encoders[kind];
            scorer.backward(pass, d_outputs, of_kind, memory, d_trunk, gradient);
        }
    }
}

/// The parts of the kinds that there are, with their numbers and their memory.
fn with_memory<'a, P, M>(
    parts: &'a [Option<P>; 2],
    memories: &'a mut [M; 2],
) -> impl Iterator<Item = (usize, &'a P, &'a mut M)> {
    let both = parts.iter().zip(memories).enumerate();
    both.filter_map(|(kind, (part, memory))| Some((kind, part.as_ref()?, memory)))
}

#[cfg(test)]
mod tests;
