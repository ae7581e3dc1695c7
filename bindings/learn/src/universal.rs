//! Networks over units that fit every scenario.
//!
//! The rows of units differ between scenarios in what they say of a unit's type (`type_2` is another type on
//! every map), in whether they have a shield, and in how many actions there are. A universal network reads
//! rows of one form: every feature that a scenario may have, and, in place of the number of the type, its
//! *figures*; of a last action only whether it had a target.
//!
//! A row u of that form follows from the row x of a scenario by u = M x + m: M copies features and gives each
//! type its figures, and m are those of a type that observations do not name, because it is the only one. So
//! an affine map of u is one of x,
//!
//!   W u + b = (W M) x + (b + W m),
//!
//! and on each scenario a universal network is an ordinary network over units, with other parameters. A
//! [`Specialisation`] computes these, and takes gradients back: with G and g those of W M and b + W m, the
//! chain rule gives G Mᵀ + g mᵀ for W and g for b. Everything that plays or differentiates a network over
//! units serves universal ones too.

mod form;

use crate::config::{Activation, ConfigError, NetworkKind};
use crate::linear::Tensor;
use crate::units_network::UnitsNetwork;
use form::{Form, RowMap};
use smaclite_engine::{TargetLayout, UnitLayout, UnitRows, obs_features, state_features};
use smaclite_scenarios::Scenario;
use std::ops::Range;

/// How rows of a scenario become rows of the one form.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct InputMaps {
    enemies: RowMap,
    allies: RowMap,
    rest: RowMap,
}

impl InputMaps {
    /// Those of observations and of the state, with so many last actions.
    ///
    /// # Errors
    /// If the scenario's observations do not have the features, or not the actions, that all have.
    pub fn new(scenario: &Scenario, last_actions: usize) -> Result<[InputMaps; 2], ConfigError> {
        InputMaps::find(scenario, last_actions).map_err(|why| {
            let accepted = "`flat` or `units` where not all is as on the standard maps";
            ConfigError::new("network", accepted, format!("`{}`: {why}", NetworkKind::Universal.name()))
        })
    }

    fn find(scenario: &Scenario, last_actions: usize) -> Result<[InputMaps; 2], String> {
        let targets = TargetLayout::new(scenario).ok_or("observations have no units")?;
        if targets.first != form::FIRST_TARGET {
            return Err("agents have actions to look".into());
        }
        let [obs, state] = forms(last_actions);
        let of_obs = obs.maps(scenario, &obs_features(scenario))?;
        Ok([of_obs, state.maps(scenario, &state_features(scenario))?])
    }
}

/// The forms of observations and of the state.
fn forms(last_actions: usize) -> [Forms; 2] {
    [Forms::of_obs(last_actions), Forms::of_state()]
}

/// The forms of an input.
struct Forms {
    enemies: Form,
    allies: Form,
    rest: Form,
}

impl Forms {
    fn of_obs(last_actions: usize) -> Forms {
        let seen = ["distance", "dx", "dy", "health", "shield"];
        let own = ["north", "south", "east", "west", "health", "shield", "x", "y"];
        Forms {
            enemies: Form::new(&[&["targetable"], &seen[..]].concat(), true, 0),
            allies: Form::new(&[&["visible"], &seen[..]].concat(), true, 0),
            rest: Form::new(&own, true, last_actions),
        }
    }

    fn of_state() -> Forms {
        let enemies = ["health", "rel_x", "rel_y", "shield"];
        Forms {
            enemies: Form::new(&enemies, true, 0),
            allies: Form::new(&[&enemies[..], &["energy/cooldown"]].concat(), true, 1),
            rest: Form::new(&[], false, 0),
        }
    }

    fn maps(
        &self,
        scenario: &Scenario,
        blocks: &[smaclite_engine::FeatureBlock],
    ) -> Result<InputMaps, String> {
        let reader = form::Reader::new(scenario, blocks);
        Ok(InputMaps {
            enemies: reader.enemies(&self.enemies)?,
            allies: reader.allies(&self.allies)?,
            rest: reader.rest(&self.rest)?,
        })
    }

    /// A network for rows of these forms, whose parameters those of every scenario are made of.
    fn network(
        &self,
        targets: Option<TargetLayout>,
        widths: [usize; 2],
        activation: Activation,
    ) -> UnitsNetwork {
        let mut end = 0;
        let mut place = |form: &Form| {
            end += form.width();
            end - form.width()
        };
        let mut row = |form: &Form| UnitRows { count: 1, parts: vec![(place(form), form.width())] };
        let (enemies, allies) = (row(&self.enemies), row(&self.allies));
        let rest: Range<usize> = place(&self.rest)..end;
        let rest = if rest.is_empty() { vec![] } else { vec![rest] };
        UnitsNetwork::new(end, UnitLayout { enemies, allies, rest }, targets, widths, activation)
    }
}

/// The actor that all scenarios specialise.
pub(crate) fn actor(last_actions: usize, widths: [usize; 2], activation: Activation) -> UnitsNetwork {
    // A column that says who heals: so there are tensors for targets among allies.
    let targets = TargetLayout { first: form::FIRST_TARGET, count: 1, heals: vec![0], healers: vec![] };
    Forms::of_obs(last_actions).network(Some(targets), widths, activation)
}

/// The critic that all scenarios specialise: of the state, or of observations.
pub(crate) fn critic(
    sees_state: bool,
    last_actions: usize,
    widths: [usize; 2],
    activation: Activation,
) -> UnitsNetwork {
    let [obs, state] = forms(last_actions);
    if sees_state { state } else { obs }.network(None, widths, activation)
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
    pub fn new(universal: &UnitsNetwork, special: &UnitsNetwork, maps: &InputMaps) -> Specialisation {
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
                map.check([&from, &to].map(|[weight, bias]| (weight.len(), bias.len())));
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
                    map.forward(weight, bias, special, to);
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
                    map.backward(weight, bias, universal, from);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
