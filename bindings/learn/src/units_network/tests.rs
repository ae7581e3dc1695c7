//! Tests of networks over units: their gradients, and what must hold of units whose rows change places or
//! are not seen.

use super::*;
use crate::architecture::Architecture;
use crate::gradient_check::{self, randoms};
use crate::random::{Purpose, generator};
use smaclite_engine::UnitRows;
use std::collections::HashMap;

/// Enemies and allies have rows of 3 and 2 numbers, those of allies in two parts that lie apart; the rest
/// stands in two places. Four agents, the third of which heals, as column 9 says of a fifth feature; and five
/// targets, more than there are enemies.
const N_IN: usize = 16;

fn layout() -> UnitLayout {
    UnitLayout {
        enemies: UnitRows { count: 2, parts: vec![(1, 3)] },
        allies: UnitRows { count: 3, parts: vec![(7, 1), (11, 1)] },
        rest: vec![0..1, 10..11, 14..16],
    }
}

fn targets() -> TargetLayout {
    TargetLayout { first: 3, count: 5, heals: vec![10], healers: vec![] }
}

fn critic(activation: Activation) -> UnitsNetwork {
    UnitsNetwork::new(N_IN, layout(), None, [6, 5], activation)
}

fn actor(activation: Activation) -> UnitsNetwork {
    UnitsNetwork::new(N_IN, layout(), Some(targets()), [6, 5], activation)
}

/// Inputs of four agents in some environments: the third heals, and a third of the units are not seen.
fn inputs(rows: usize) -> (Vec<f32>, Vec<u16>) {
    let mut x = randoms(3, rows * N_IN);
    let ids: Vec<u16> = (0..rows).map(|row| (row % 4) as u16).collect();
    for (i, (input, id)) in x.chunks_exact_mut(N_IN).zip(&ids).enumerate() {
        input[10] = f32::from(u8::from(*id == 2));
        match i % 5 {
            0 => input[1..4].fill(0.0),
            1 => input[8] = 0.0,
            2 => input[1..7].fill(0.0),
            3 => (input[7], input[9]) = (0.0, 0.0),
            _ => {}
        }
    }
    (x, ids)
}

/// The tensors in f64, by name.
struct Naive {
    tensors: HashMap<String, Vec<f64>>,
    activation: Activation,
}

impl Naive {
    fn of(network: &UnitsNetwork, params: &[f64]) -> Naive {
        let tensors = network.tensors().into_iter();
        let named = tensors.map(|tensor| (tensor.name, params[tensor.range].to_vec()));
        Naive { tensors: named.collect(), activation: network.activation }
    }

    fn f(&self, z: Vec<f64>) -> Vec<f64> {
        let f = |z: f64| match self.activation {
            Activation::Relu => z.max(0.0),
            Activation::Tanh => z.tanh(),
        };
        z.into_iter().map(f).collect()
    }

    fn map(&self, name: &str, x: &[f64], n_out: usize) -> Vec<f64> {
        let weight = self.tensors.get(&format!("{name}.weight")).map_or(&[][..], Vec::as_slice);
        let bias = self.tensors.get(&format!("{name}.bias"));
        let dot = |o: usize| x.iter().zip(&weight[o * x.len()..]).map(|(x, w)| x * w).sum::<f64>();
        (0..n_out).map(|o| dot(o) + bias.map_or(0.0, |bias| bias[o])).collect()
    }

    /// The outputs of a row.
    fn outputs(&self, network: &UnitsNetwork, x: &[f64], agent: usize) -> Vec<f64> {
        let width = network.own.n_out();
        let layout = &network.layout;
        let rest: Vec<f64> = layout.rest.iter().flat_map(|columns| x[columns.clone()].to_vec()).collect();
        let own = self.map("own", &rest, width);
        let mut pooled = self.f(own.clone());
        let mut embeddings = Vec::new();
        for (name, rows) in KINDS.iter().zip([&layout.enemies, &layout.allies]) {
            let embedding = |unit: usize| {
                let part = |(start, width): &(usize, usize)| x[start + unit * width..][..*width].to_vec();
                let parts: Vec<Vec<f64>> = rows.parts.iter().map(part).collect();
                parts[0].iter().any(|value| *value != 0.0).then(|| {
                    let first = self.map(&format!("{name}.0"), &parts.concat(), width);
                    let first = self.f(first.iter().zip(&own).map(|(a, b)| a + b).collect());
                    self.f(self.map(&format!("{name}.1"), &first, width))
                })
            };
            let of_kind: Vec<Option<Vec<f64>>> = (0..rows.count).map(embedding).collect();
            let (seen, width) = (|| of_kind.iter().flatten(), if rows.count > 0 { width } else { 0 });
            pooled.extend((0..width).map(|j| seen().map(|e| e[j]).sum::<f64>()));
            pooled.extend((0..width).map(|j| seen().map(|e| e[j]).reduce(f64::max).unwrap_or(0.0)));
            embeddings.push(of_kind);
        }
        let trunk_width = network.trunk[1].n_out();
        let trunk = self.f(self.map("trunk.0", &pooled, trunk_width));
        let trunk = self.f(self.map("trunk.1", &trunk, trunk_width));
        let mut outputs = self.map("head", &trunk, network.n_head);
        let Some(targets) = &network.targets else { return outputs };
        let heals = targets.heals.iter().any(|column| x[*column] != 0.0);
        for target in 0..targets.count {
            let kind = if heals { ALLIES } else { ENEMIES };
            let name = format!("{}.target", KINDS[kind]);
            let unit = if heals { TargetLayout::ally_row(agent, target) } else { Some(target) };
            let embedding = unit.and_then(|unit| embeddings[kind].get(unit)?.clone());
            let of_unit = self.map(&format!("{name}.unit"), &embedding.unwrap_or(vec![0.0; width]), width);
            let of_trunk = self.map(&format!("{name}.trunk"), &trunk, width);
            let hidden = self.f(of_unit.iter().zip(&of_trunk).map(|(a, b)| a + b).collect());
            outputs.extend(self.map(&format!("{name}.score"), &hidden, 1));
        }
        outputs
    }
}

fn check(network: UnitsNetwork, rows: usize) {
    let (x, ids) = inputs(rows);
    let outputs = |params: &[f64], x: &[f64], agent| Naive::of(&network, params).outputs(&network, x, agent);
    gradient_check::check(&Architecture::Units(Box::new(network.clone())), (&x, &ids), outputs, 1e-3);
}

#[test]
fn gradients_equal_finite_differences() {
    for activation in [Activation::Relu, Activation::Tanh] {
        for rows in [1, 9] {
            check(actor(activation), rows);
            check(critic(activation), rows);
        }
    }
}

#[test]
fn a_state_without_enemies_or_rest_has_gradients_too() {
    let of_agents = UnitLayout {
        enemies: UnitRows::default(),
        allies: UnitRows { count: 4, parts: vec![(0, 4)] },
        rest: vec![],
    };
    check(UnitsNetwork::new(N_IN, of_agents, None, [3, 4], Activation::Relu), 5);
}

/// The outputs of rows of agents with the first parameters of an actor, its last layers not small.
fn outputs(x: &[f32], ids: &[u16]) -> Vec<Vec<f32>> {
    let network = Architecture::Units(Box::new(actor(Activation::Relu)));
    let params = network.initial_params(1.0, &mut generator(5, Purpose::Weights, [0, 0]));
    let mut workspace = crate::architecture::Workspace::default();
    network.forward(&params, x, ids, &mut workspace);
    workspace.output().chunks_exact(network.padded_out()).map(|row| row[..8].to_vec()).collect()
}

fn assert_near(a: &[f32], b: &[f32]) {
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} {b:?}");
}

#[test]
fn targets_change_places_with_their_units() {
    let (mut x, ids) = (randoms(11, N_IN), [1]);
    x[10] = 0.0;
    let before = outputs(&x, &ids).remove(0);
    assert!((before[3] - before[4]).abs() > 1e-3, "{before:?}");
    let mut exchanged = x.clone();
    exchanged[1..7].rotate_left(3); // enemy 0 and enemy 1
    let after = outputs(&exchanged, &ids).remove(0);
    let mut expected = before.clone();
    expected.swap(3, 4);
    assert_near(&after, &expected);
    (x[7], x[9], x[11], x[13]) = (x[9], x[7], x[13], x[11]); // two allies, who are no targets
    assert_near(&outputs(&x, &ids)[0], &before);
}

/// Agent 1 has rows of the allies 0, 2 and 3.
#[test]
fn healers_target_the_rows_of_allies() {
    let (mut x, ids) = (randoms(12, N_IN), [1]);
    x[10] = 1.0;
    let before = outputs(&x, &ids).remove(0);
    assert!((before[3] - before[6]).abs() > 1e-3, "{before:?}");
    let mut exchanged = x.clone();
    (exchanged[7], exchanged[9], exchanged[11], exchanged[13]) = (x[9], x[7], x[13], x[11]);
    let mut expected = before.clone();
    expected.swap(3, 6); // the first ally, and the last
    assert_near(&outputs(&exchanged, &ids)[0], &expected);
    x[1..7].rotate_left(3); // two enemies, who are no targets
    assert_near(&outputs(&x, &ids)[0], &before);
}

#[test]
fn units_that_are_not_seen_do_not_matter() {
    let network = critic(Activation::Relu);
    let params = randoms(13, network.n_params());
    let value = |x: &[f32]| {
        let mut workspace = Workspace::default();
        network.forward(&params, x, &[], &mut workspace);
        workspace.output()[0]
    };
    let mut x = randoms(14, N_IN);
    x[7] = 0.0; // an ally that is dead: what else stands in its row is ignored
    let before = value(&x);
    x[11] += 1.0;
    assert_eq!(value(&x), before);
    x[8] += 1.0; // another, who lives
    assert!(value(&x) != before);
    // Nothing is seen, and the outputs are numbers.
    let (mut x, ids) = (vec![0.0; 4 * N_IN], [0, 1, 2, 3]);
    x[2 * N_IN + 10] = 1.0;
    for row in outputs(&x, &ids) {
        assert!(row.iter().all(|value| value.is_finite()));
        assert!(row[4..].iter().all(|value| *value == row[3]), "{row:?}");
    }
}

/// Rows are computed alike whatever else is in the batch.
#[test]
fn rows_do_not_depend_on_others() {
    let (x, ids) = inputs(12);
    for (row, together) in outputs(&x, &ids).iter().enumerate() {
        assert_near(&outputs(&x[row * N_IN..][..N_IN], &ids[row..=row])[0], together);
    }
}

#[test]
fn tensors_are_named_and_cover_all_parameters() {
    let network = actor(Activation::Relu);
    let tensors = network.tensors();
    let names: Vec<&str> = tensors.iter().map(|tensor| tensor.name.as_str()).collect();
    assert_eq!(names.first_chunk(), Some(&["own.weight", "own.bias", "enemies.0.weight", "enemies.0.bias"]));
    assert_eq!(names.last_chunk(), Some(&["allies.target.score.bias", "head.weight", "head.bias"]));
    let padding = 5 * (5 + 1); // of the head, which has 3 outputs
    let covered: usize = tensors.iter().map(|tensor| tensor.range.len()).sum();
    assert_eq!(covered + padding, network.n_params());
    let shapes = tensors.iter().map(|tensor| (tensor.shape.iter().product::<usize>(), tensor.range.len()));
    assert!(shapes.into_iter().all(|(elements, len)| elements == len));
}
