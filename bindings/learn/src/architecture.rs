//! Which network a run trains: the one place that knows `mlp` (flat), `units_network` and `universal`.

use crate::config::{Algorithm, Config, ConfigError, NetworkKind, ensure};
use crate::linear::Tensor;
use crate::mlp::{self, Mlp};
use crate::units_network::{self, UnitsNetwork};
use crate::universal::{self, Specialisation};
use rand_pcg::Pcg64Mcg;
use smaclite_engine::{Sizes, TargetLayout, UnitLayout, UniversalForm, UniversalRows};
use smaclite_scenarios::Scenario;
use std::sync::Arc;

/// What networks are built for: the sizes of a team's inputs and outputs, and where they have which unit.
#[derive(Clone, Debug)]
pub(crate) struct Inputs {
    pub sizes: Sizes,
    /// `None` if observations have no units.
    units: Option<Arc<Units>>,
    /// How they become inputs of universal networks: of observations and of the state.
    maps: Result<Arc<[UniversalRows; 2]>, ConfigError>,
}

/// Where observations and the state have which unit, and what actions target.
#[derive(Debug)]
struct Units {
    obs: UnitLayout,
    state: UnitLayout,
    targets: TargetLayout,
}

impl Inputs {
    /// Those of the agents of a scenario with the figures of its rules; `obs_size` includes the last actions.
    pub fn new(scenario: &Scenario, sizes: Sizes, last_actions: usize) -> Inputs {
        let maps = universal::input_maps(scenario, last_actions).map(Arc::new);
        let obs = UnitLayout::of_obs(scenario, sizes.obs_size);
        let units = obs.zip(TargetLayout::new(scenario)).map(|(obs, targets)| {
            let state = UnitLayout::of_state(scenario, sizes.state_size);
            Arc::new(Units { obs, state, targets })
        });
        Inputs { sizes, units, maps }
    }

    /// Checks that the network of a run can be built.
    ///
    /// # Errors
    /// If it is one over units, and observations have none.
    pub fn check(&self, config: &Config) -> Result<(), ConfigError> {
        if config.network == NetworkKind::Universal {
            self.maps.clone()?;
        }
        let is_possible = config.network == NetworkKind::Flat || self.units.is_some();
        let accepted = "`flat` where observations have no units (`obs_starcraft` of `smacv2` is false)";
        ensure(is_possible, "network", accepted, &format!("`{}`", config.network))
    }
}

/// Inputs of which nothing but the sizes is known.
#[cfg(test)]
impl From<Sizes> for Inputs {
    fn from(sizes: Sizes) -> Inputs {
        let accepted = "`flat`, since nothing but the sizes is known";
        let maps = Err(ConfigError::new("network", accepted, "`universal`".into()));
        Inputs { sizes, units: None, maps }
    }
}

/// The architecture of a network.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Architecture {
    Flat(Mlp),
    Units(Box<UnitsNetwork>),
}

/// The memory of a forward and a backward pass of any network.
#[derive(Debug, Default)]
pub(crate) struct Workspace {
    flat: mlp::Workspace,
    units: units_network::Workspace,
    is_units: bool,
}

impl Workspace {
    /// The outputs of the last forward pass, `[rows, padded n_out]`. Before the backward pass they are
    /// replaced by the gradient of the loss with respect to them.
    pub fn output(&mut self) -> &mut [f32] {
        if self.is_units { self.units.output() } else { self.flat.output() }
    }
}

impl Architecture {
    /// The actor of a run: from an agent's observation to a number per action.
    pub fn actor(config: &Config, inputs: &Inputs) -> Architecture {
        Architecture::new(config, inputs, false, true)
    }

    /// The critic: from the state, or an agent's observation, to a value.
    pub fn critic(config: &Config, inputs: &Inputs) -> Architecture {
        Architecture::new(config, inputs, config.algorithm == Algorithm::Mappo, false)
    }

    fn new(config: &Config, inputs: &Inputs, sees_state: bool, is_actor: bool) -> Architecture {
        let Inputs { sizes, units, .. } = inputs;
        let (n_in, n_ids) = if sees_state { (sizes.state_size, 0) } else { (sizes.obs_size, sizes.n_agents) };
        match (config.network, units, &config.hidden[..]) {
            (NetworkKind::Flat, _, hidden) => {
                let n_out = if is_actor { sizes.n_actions } else { 1 };
                Architecture::Flat(Mlp::new(n_in, hidden, n_out, n_ids, config.activation))
            }
            (NetworkKind::Units | NetworkKind::Universal, Some(units), &[width, trunk_width]) => {
                let layout = if sees_state { &units.state } else { &units.obs }.clone();
                let targets = is_actor.then(|| units.targets.clone());
                let widths = [width, trunk_width];
                let network = UnitsNetwork::new(n_in, layout, targets, widths, config.activation);
                Architecture::Units(Box::new(network))
            }
            _ => unreachable!("Config::check and Inputs::check refuse this"),
        }
    }

    /// Actor and critic as they are trained and stored: universal ones are those of no scenario.
    pub fn stored(config: &Config, inputs: &Inputs) -> [Architecture; 2] {
        match (config.network, &config.hidden[..]) {
            (NetworkKind::Universal, &[width, trunk_width]) => {
                let of_obs = UniversalForm::of_obs(config.last_actions);
                let of_critic = match config.algorithm {
                    Algorithm::Mappo => &UniversalForm::of_state(),
                    Algorithm::Ippo => &of_obs,
                };
                [(&of_obs, true), (of_critic, false)].map(|(form, is_actor)| {
                    let widths = [width, trunk_width];
                    let network = universal::network(form, is_actor, widths, config.activation);
                    Architecture::Units(Box::new(network))
                })
            }
            _ => [Architecture::actor(config, inputs), Architecture::critic(config, inputs)],
        }
    }

    /// How stored actors and critics become those on this scenario; `None` if they are the same.
    pub fn specialisations(config: &Config, inputs: &Inputs) -> Option<[Specialisation; 2]> {
        if config.network != NetworkKind::Universal {
            return None;
        }
        let [of_obs, of_state] = &**inputs.maps.as_ref().expect("Inputs::check refuses this");
        let of_critic = if config.algorithm == Algorithm::Mappo { of_state } else { of_obs };
        let on_scenario = [Architecture::actor(config, inputs), Architecture::critic(config, inputs)];
        let [actor, critic] = &Architecture::stored(config, inputs);
        let [on_actor, on_critic] = &on_scenario;
        let specialisation = |stored: &Architecture, special: &Architecture, maps| match (stored, special) {
            (Architecture::Units(stored), Architecture::Units(special)) => {
                Specialisation::new(stored, special, maps)
            }
            _ => unreachable!("universal networks are over units"),
        };
        Some([specialisation(actor, on_actor, of_obs), specialisation(critic, on_critic, of_critic)])
    }

    /// Length of the vector of parameters.
    pub fn n_params(&self) -> usize {
        match self {
            Architecture::Flat(network) => network.n_params(),
            Architecture::Units(network) => network.n_params(),
        }
    }

    /// Outputs per row, padded to a multiple of `WIDTH`.
    pub fn padded_out(&self) -> usize {
        match self {
            Architecture::Flat(network) => network.padded_out(),
            Architecture::Units(network) => network.padded_out(),
        }
    }

    /// The parameter tensors, in their order in the vector.
    pub fn tensors(&self) -> Vec<Tensor> {
        match self {
            Architecture::Flat(network) => network.tensors(),
            Architecture::Units(network) => network.tensors(),
        }
    }

    /// First parameters, zeros but for weights; those of the last layers are scaled by `last_gain`.
    pub fn initial_params(&self, last_gain: f64, generator: &mut Pcg64Mcg) -> Vec<f32> {
        let maps = match self {
            Architecture::Flat(network) => network.maps(last_gain),
            Architecture::Units(network) => network.maps(last_gain),
        };
        let mut params = vec![0.0; self.n_params()];
        maps.into_iter().for_each(|(_, map, gain)| map.initialise(gain, &mut params, generator));
        params
    }

    /// Computes the outputs of all rows of `x`; `ids` has the agent of each.
    pub fn forward(&self, params: &[f32], x: &[f32], ids: &[u16], workspace: &mut Workspace) {
        workspace.is_units = matches!(self, Architecture::Units(_));
        match self {
            Architecture::Flat(network) => {
                network.forward(params, x, ids, &mut workspace.flat);
            }
            Architecture::Units(network) => network.forward(params, x, ids, &mut workspace.units),
        }
    }

    /// Adds the gradient of the loss with respect to the parameters to `gradient`. The forward pass with the
    /// same arguments was the last of this workspace, and its output now is the gradient of the loss with
    /// respect to the output.
    pub fn backward(
        &self,
        params: &[f32],
        x: &[f32],
        ids: &[u16],
        workspace: &mut Workspace,
        gradient: &mut [f32],
    ) {
        match self {
            Architecture::Flat(network) => {
                network.backward(params, x, ids, &mut workspace.flat, gradient);
            }
            Architecture::Units(network) => network.backward(params, &mut workspace.units, gradient),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_engine::{Arena, Rules};
    use smaclite_scenarios::Smacv2;
    use smaclite_units::Keyword;

    #[test]
    fn observations_that_a_network_does_not_know_are_refused() {
        let mut scenario = Scenario::standard("terran_5_vs_5").unwrap();
        let without_units = serde_json::json!({"obs_starcraft": false, "obs_timestep_number": true});
        for (network, options, expected) in [
            (NetworkKind::Flat, without_units.clone(), None),
            (NetworkKind::Units, serde_json::json!({}), None),
            // The rows are those of no unit, so it would see nothing.
            (NetworkKind::Units, without_units.clone(), Some(["`flat` where", "got `units`"])),
            (NetworkKind::Universal, without_units, Some(["`flat` or `units` where", "have no units"])),
            (
                NetworkKind::Universal,
                serde_json::json!({"obs_timestep_number": true}),
                Some(["`flat` or `units` where", "does not know the feature"]),
            ),
            (
                NetworkKind::Universal,
                serde_json::json!({"obs_pathing_grid": true}),
                Some(["`flat` or `units` where", "`walkable_"]),
            ),
            (
                NetworkKind::Universal,
                serde_json::json!({"conic_fov": true}),
                Some(["`flat` or `units` where", "agents have actions to look"]),
            ),
        ] {
            scenario.smacv2 = Some(serde_json::from_value::<Smacv2>(options).unwrap());
            let inputs = Inputs::new(&scenario, Arena::new(&scenario, Rules::Smaclite).sizes(), 0);
            let config = Config::for_agents(5).with_network(network);
            let error = inputs.check(&config).err().map(|error| error.to_string());
            assert_eq!(error.is_some(), expected.is_some(), "{network}: {error:?}");
            let (error, [start, why]) = (error.unwrap_or_default(), expected.unwrap_or_default());
            assert!(expected.is_none() || error.starts_with(&format!("network must be {start}")), "{error}");
            assert!(error.contains(why), "{error}");
        }
    }

    /// Whatever a standard scenario observes, networks of both kinds have an output per action and one value.
    #[test]
    fn networks_fit_every_scenario() {
        for name in Scenario::standard_names().chain(Scenario::generated_names()) {
            let scenario = Scenario::standard(name).unwrap();
            let sizes = Arena::new(&scenario, Rules::Smaclite).sizes();
            let inputs = Inputs::new(&scenario, sizes, 0);
            let networks = NetworkKind::KEYWORDS.iter().map(|(_, network)| *network);
            for (network, algorithm) in
                networks.flat_map(|network| [(network, Algorithm::Mappo), (network, Algorithm::Ippo)])
            {
                let config = Config { algorithm, ..Config::for_scenario(&scenario).with_network(network) };
                let actor = Architecture::actor(&config, &inputs);
                assert_eq!(actor.padded_out(), sizes.n_actions.next_multiple_of(8), "{name}");
                assert_eq!(Architecture::critic(&config, &inputs).padded_out(), 8, "{name}");
            }
        }
    }
}
