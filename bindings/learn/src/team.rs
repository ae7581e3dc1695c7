//! What is trained: the networks of actor and critic, their optimisers, and the statistics of the returns.

use crate::adam::Adam;
use crate::architecture::{Architecture, Inputs, Workspace};
use crate::config::Config;
use crate::normaliser::{Normaliser, preserve_predictions};
use crate::random::{Purpose, generator};
use crate::universal::Specialisation;

/// The first policy is almost uniform, so that it explores.
const ACTOR_GAIN: f64 = 0.01;
const CRITIC_GAIN: f64 = 1.0;

/// A network and its optimiser.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    pub(crate) architecture: Architecture,
    pub(crate) params: Vec<f32>,
    pub(crate) adam: Adam,
}

impl Network {
    fn new(architecture: Architecture, gain: f64, seed: u64, number: u64) -> Network {
        let params = architecture.initial_params(gain, &mut generator(seed, Purpose::Weights, [number, 0]));
        let adam = Adam::new(params.len());
        Network { architecture, params, adam }
    }

    /// The same network, for playing alone.
    pub(crate) fn without_optimiser(&self) -> Network {
        let (architecture, params) = (self.architecture.clone(), self.params.clone());
        Network { architecture, params, adam: Adam::new(0) }
    }

    /// Computes the outputs of all rows of `x`; `ids` has the agent of each.
    pub(crate) fn forward(&self, x: &[f32], ids: &[u16], workspace: &mut Workspace) {
        self.architecture.forward(&self.params, x, ids, workspace);
    }

    /// Adds the gradient of the parameters, after the forward pass of the same rows.
    pub(crate) fn backward(&self, x: &[f32], ids: &[u16], workspace: &mut Workspace, gradient: &mut [f32]) {
        self.architecture.backward(&self.params, x, ids, workspace, gradient);
    }
}

/// Actor and critic of a team.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Team {
    pub actor: Network,
    pub critic: Network,
    pub normaliser: Normaliser,
}

impl Team {
    /// A team with first weights.
    pub fn new(config: &Config, inputs: &Inputs) -> Team {
        let [actor, critic] = Architecture::stored(config, inputs);
        Team {
            actor: Network::new(actor, ACTOR_GAIN, config.seed, 0),
            critic: Network::new(critic, CRITIC_GAIN, config.seed, 1),
            normaliser: Normaliser::default(),
        }
    }

    /// Takes returns into account, without a change of any prediction.
    pub fn observe_returns(&mut self, returns: impl Iterator<Item = f32> + Clone) {
        let old = self.normaliser.mean_and_deviation();
        self.normaliser.update(returns);
        let new = self.normaliser.mean_and_deviation();
        let tensors = self.critic.architecture.tensors();
        let last = tensors.iter().filter(|tensor| tensor.name != "id_bias").collect::<Vec<_>>();
        if let [.., weight, bias] = last[..] {
            let (before, from_bias) = self.critic.params.split_at_mut(bias.range.start);
            let bias = &mut from_bias[..bias.range.len()];
            preserve_predictions(old, new, &mut before[weight.range.clone()], bias);
        }
    }
}

/// A team of universal networks on one scenario.
#[derive(Debug)]
pub(crate) struct OnScenario {
    specialisations: [Specialisation; 2],
    /// With no optimisers.
    team: Team,
}

impl OnScenario {
    /// `None` if networks are those of one scenario.
    pub fn new(config: &Config, inputs: &Inputs) -> Option<OnScenario> {
        let specialisations = Architecture::specialisations(config, inputs)?;
        let network = |architecture| Network { architecture, params: Vec::new(), adam: Adam::new(0) };
        let actor = network(Architecture::actor(config, inputs));
        let critic = network(Architecture::critic(config, inputs));
        Some(OnScenario { specialisations, team: Team { actor, critic, normaliser: Normaliser::default() } })
    }

    /// Takes over the present parameters, and returns the team with them.
    pub fn specialise(&mut self, universal: &Team) -> &Team {
        let [actor, critic] = &self.specialisations;
        actor.specialise(&universal.actor.params, &mut self.team.actor.params);
        critic.specialise(&universal.critic.params, &mut self.team.critic.params);
        &self.team
    }

    /// The team, with the parameters that were taken over last.
    pub fn team(&self) -> &Team {
        &self.team
    }

    /// Of actor and critic.
    pub fn specialisations(&self) -> &[Specialisation; 2] {
        &self.specialisations
    }

    /// The actor alone, which plays.
    pub fn into_actor(mut self, universal: &Network) -> Network {
        self.specialisations[0].specialise(&universal.params, &mut self.team.actor.params);
        self.team.actor
    }
}

/// The agent of each row of `n_rows` rows, environment after environment.
pub(crate) fn agent_ids(n_rows: usize, n_agents: usize) -> Vec<u16> {
    (0..n_rows).map(|row| (row % n_agents) as u16).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Algorithm;
    use smaclite_engine::Sizes;

    #[test]
    fn a_change_of_the_returns_changes_no_prediction() {
        let sizes = Sizes { n_agents: 2, n_actions: 7, obs_size: 4, state_size: 5, ..Sizes::default() };
        for algorithm in [Algorithm::Mappo, Algorithm::Ippo] {
            let mut team = Team::new(&Config { algorithm, ..Config::for_agents(3) }, &sizes.into());
            let x: Vec<f32> = (0..20).map(|i| i as f32 / 10.0).collect();
            let predict = |team: &Team| {
                let mut workspace = Workspace::default();
                let ids = agent_ids(4, 2);
                let n_in = if algorithm == Algorithm::Mappo { 5 } else { 4 };
                team.critic.forward(&x[..4 * n_in], &ids, &mut workspace);
                let (mean, deviation) = team.normaliser.mean_and_deviation();
                let values = workspace.output().iter().step_by(8);
                values.map(|value| f64::from(*value) * deviation + mean).collect::<Vec<f64>>()
            };
            let before = predict(&team);
            team.observe_returns([10.0, 30.0].into_iter());
            assert_eq!(team.normaliser.mean_and_deviation().0.round(), 20.0);
            for (before, after) in before.into_iter().zip(predict(&team)) {
                assert!((before - after).abs() < 1e-4, "{before} {after}");
            }
        }
    }
}
