//! Networks over units that fit every scenario.
//!
//! A universal network reads rows of one form (`UniversalForm` of smaclite_engine), which say what the type
//! of a unit is by its figures. A row u of that form follows from the row x of a scenario by u = M x + m, so
//! an affine map of u is one of x,
//!
//!   W u + b = (W M) x + (b + W m),
//!
//! and on each scenario a universal network is an ordinary network over units, with other parameters. A
//! [`Specialisation`] computes these, and takes gradients back: with G and g those of W M and b + W m, the
//! chain rule gives G Mᵀ + g mᵀ for W and g for b. Everything that plays or differentiates a network over
//! units serves universal ones too.

use crate::config::{Activation, ConfigError, NetworkKind};
use crate::linear::Tensor;
use crate::units_network::UnitsNetwork;
use smaclite_engine::{RowMap, TargetLayout, UnitLayout, UnitRows, UniversalForm, UniversalRows, action};
use smaclite_scenarios::Scenario;
use std::ops::Range;

/// The maps of observations and of the state of a scenario, with so many last actions.
///
/// # Errors
/// If the scenario's observations do not have the features, or not the actions, that all have.
pub(crate) fn input_maps(
    scenario: &Scenario,
    last_actions: usize,
) -> Result<[UniversalRows; 2], ConfigError> {
    let maps = |form: UniversalForm| {
        form.rows(scenario).map_err(|why| {
            let accepted = "`flat` or `units` where not all is as on the standard maps";
            ConfigError::new("network", accepted, format!("`{}`: {why}", NetworkKind::Universal))
        })
    };
    Ok([maps(UniversalForm::of_obs(last_actions))?, maps(UniversalForm::of_state())?])
}

/// An actor or a critic for rows of this form, whose parameters those of every scenario are made of.
pub(crate) fn network(
    form: &UniversalForm,
    is_actor: bool,
    widths: [usize; 2],
    activation: Activation,
) -> UnitsNetwork {
    let [enemies, allies, rest] = form.widths();
    let row = |start, width| UnitRows { count: 1, parts: vec![(start, width)] };
    let (begin, end) = (enemies + allies, enemies + allies + rest);
    let layout = UnitLayout {
        enemies: row(0, enemies),
        allies: row(enemies, allies),
        rest: std::iter::once(begin..end).filter(|rest| !rest.is_empty()).collect(),
    };
    // A column that says who heals: so there are tensors for targets among allies.
    let targets = TargetLayout { first: action::FIRST_TARGET, count: 1, heals: vec![0], healers: vec![] };
    UnitsNetwork::new(end, layout, is_actor.then_some(targets), widths, activation)
}

/// From the parameters of a universal network to those on a scenario, and gradients back.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Specialisation {
    parts: Vec<Part>,
    /// Lengths of the vectors of parameters.
    n_universal: usize,
    n_special: usize,
}

#[derive(Clone, Debug, PartialEq)]
enum Part {
    /// The same elements.
    Copy { from: Range<usize>, to: Range<usize> },
    /// A map of rows, and its bias.
    Rows { from: [Range<usize>; 2], to: [Range<usize>; 2], map: RowMap },
}

impl Specialisation {
    pub fn new(universal: &UnitsNetwork, special: &UnitsNetwork, maps: &UniversalRows) -> Specialisation {
        let (all, of_scenario) = (universal.tensors(), special.tensors());
        let range = |tensors: &[Tensor], name: &str| {
            let found = tensors.iter().find(|tensor| tensor.name == name);
            found.map_or(0..0, |tensor| tensor.range.clone())
        };
        let pooled = special.tensors().into_iter().find(|tensor| tensor.name == "trunk.0.weight");
        // Allies are pooled last, and an agent may have none.
        let pooled = RowMap::prefix(pooled.map_or(0, |tensor| tensor.shape[1]), universal.pooled_width());
        let maps = [
            ("own", &maps.rest),
            ("enemies.0", &maps.enemies),
            ("allies.0", &maps.allies),
            ("trunk.0", &pooled),
        ];
        let mut parts = Vec::new();
        for (layer, map) in maps {
            let both = |tensors: &[Tensor]| {
                ["weight", "bias"].map(|part| range(tensors, &format!("{layer}.{part}")))
            };
            let to = both(&of_scenario);
            let from = both(&all);
            if !to[1].is_empty() {
                let [in_form, on_scenario] = map.widths();
                let n_out = from[1].len();
                assert_eq!([from[0].len(), to[0].len()], [n_out * in_form, n_out * on_scenario], "{layer}");
                assert_eq!(to[1].len(), n_out, "{layer}");
                parts.push(Part::Rows { from, to, map: map.clone() });
            }
        }
        let is_map =
            |name: &str| maps.iter().any(|(layer, _)| name.rsplit_once('.').map(|(l, _)| l) == Some(*layer));
        for tensor in of_scenario.iter().filter(|tensor| !is_map(&tensor.name)) {
            let from = range(&all, &tensor.name);
            assert_eq!(from.len(), tensor.range.len(), "{} is the same on all maps", tensor.name);
            parts.push(Part::Copy { from, to: tensor.range.clone() });
        }
        Specialisation { parts, n_universal: universal.n_params(), n_special: special.n_params() }
    }

    /// The parameters on the scenario.
    pub fn specialise(&self, universal: &[f32], special: &mut Vec<f32>) {
        assert_eq!(universal.len(), self.n_universal, "parameters of a universal network");
        special.clear();
        special.resize(self.n_special, 0.0);
        for part in &self.parts {
            match part {
                Part::Copy { from, to } => special[to.clone()].copy_from_slice(&universal[from.clone()]),
                Part::Rows { from, to, map } => {
                    let [weight, bias] = from.each_ref().map(|range| &universal[range.clone()]);
                    map.forward([weight, bias], two_of(special, to));
                }
            }
        }
    }

    /// Adds the gradient of the parameters on the scenario to that of all.
    pub fn take_back(&self, special: &[f32], universal: &mut [f32]) {
        for part in &self.parts {
            match part {
                Part::Copy { from, to } => {
                    crate::math::add(&mut universal[from.clone()], &special[to.clone()])
                }
                Part::Rows { from, to, map } => {
                    let [weight, bias] = to.each_ref().map(|range| &special[range.clone()]);
                    map.backward([weight, bias], two_of(universal, from));
                }
            }
        }
    }
}

/// The weights and the biases of a map, which follow one another.
fn two_of<'a>(params: &'a mut [f32], [weight, bias]: &[Range<usize>; 2]) -> [&'a mut [f32]; 2] {
    let (before, from_bias) = params.split_at_mut(bias.start);
    [&mut before[weight.clone()], &mut from_bias[..bias.len()]]
}

#[cfg(test)]
mod tests;
