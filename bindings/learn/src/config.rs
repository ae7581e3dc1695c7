//! The hyperparameters of a run. docs/how-to/training.md describes them and why their defaults win.

mod enemies;
mod keywords;

pub use enemies::{Enemies, SelfPlay};
pub use keywords::{Activation, Algorithm, NetworkKind};
use serde::{Deserialize, Serialize};
use smaclite_engine::MAX_LAST_ACTIONS;
use smaclite_scenarios::Scenario;
use smaclite_units::file::shortened;

/// The hyperparameters. Together with the scenario, the seed decides every bit of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Seed of weights, environments, actions and minibatches.
    pub seed: u64,
    /// Environment steps of the run, over which the annealed values change.
    pub steps: u64,
    /// What the critic sees.
    pub algorithm: Algorithm,
    /// How many of its own last actions an agent observes, 0 to 16; the pool appends them to `obs`.
    #[serde(default)] // older runs have none
    pub last_actions: usize,
    /// Number of environments, 1 to 65536.
    pub num_envs: usize,
    /// Steps of each environment per update, 1 to 65536.
    pub horizon: usize,
    /// Passes over the data of an update, 1 to 1000.
    pub epochs: usize,
    /// Gradient steps per epoch, 1 to 1000.
    pub minibatches: usize,
    /// The network of actor and critic.
    #[serde(default, skip_serializing_if = "NetworkKind::is_flat")] // older runs have none
    pub network: NetworkKind,
    /// Widths of the hidden layers of both networks, 1 to 8 layers of 2 to 4096; of networks over units two
    /// widths, that of the embedding of a unit and that of the layers behind.
    pub hidden: Vec<usize>,
    /// The non-linearity of the hidden layers.
    pub activation: Activation,
    /// Step size of the actor.
    pub actor_lr: f64,
    /// Step size of the critic.
    pub critic_lr: f64,
    /// The step sizes fall linearly to this share of their first value, 0 to 1; 1 is no annealing.
    pub lr_end: f64,
    /// Added to the denominator of Adam.
    pub adam_eps: f64,
    /// Discount per step, 0 to 1.
    pub gamma: f64,
    /// Decay of the generalised advantage estimate, 0 to 1.
    pub lambda: f64,
    /// Advantages are divided by their standard deviation, or by this share of that of the returns if it is
    /// larger, 0 to 10. Without it, the advantages of a team that has settled become noise of full size.
    #[serde(default)] // older runs have none
    pub advantage_floor: f64,
    /// How far the probability ratio may leave 1.
    pub clip: f64,
    /// How far a value may leave its old one, in standard deviations of the returns.
    pub value_clip: f64,
    /// Where the Huber loss becomes linear, in standard deviations of the returns.
    pub huber: f64,
    /// Weight of the entropy of an agent's actions at the beginning.
    pub entropy: f64,
    /// Weight of the entropy at the end.
    pub entropy_end: f64,
    /// The longest gradient of each network.
    pub max_grad_norm: f64,
    /// The run is evaluated at multiples of that many steps, at least 1, and at its end; `None` for never. It
    /// changes no bit of the training.
    #[serde(default, skip_serializing_if = "Option::is_none")] // older runs have none
    pub evaluate_every: Option<u64>,
    /// Who plays the enemies.
    #[serde(default, skip_serializing_if = "Enemies::are_scripts")]
    pub enemies: Enemies,
    /// The environments of each map are in proportion to its weight, above 0; none if all are equal.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub map_weights: Vec<f64>,
}

/// The default weight of the entropy at the beginning, divided by the number of agents. The more agents
/// explore at once, the less can each of them learn from the reward that they share; with the quotient, teams
/// of 2 and of 27 explore as long as they should.
pub const TEAM_ENTROPY: f64 = 0.15;

/// The fewest agents of a fixed team whose critic sees the state by default. An observation says little of a
/// battle of many units whose reward the team shares; in a small team, it says what the agent itself is worth
/// to it. How strong drawn teams are, the state says, so there the critic always sees it.
pub const STATE_CRITIC_AGENTS: usize = 5;

impl Config {
    /// The default hyperparameters in a scenario.
    pub fn for_scenario(scenario: &Scenario) -> Config {
        let mut config = Config::for_agents(scenario.n_agents());
        if scenario.draws_teams() {
            config.algorithm = Algorithm::Mappo;
            // A fixed battle is nearly the same every time, so what an agent did says where in it it is. In
            // drawn battles agents learn to go on with what they did.
            config.last_actions = 0;
        }
        config.with_network(NetworkKind::for_scenario(scenario))
    }

    /// With this network, and the defaults that depend on it.
    #[must_use]
    pub fn with_network(self, network: NetworkKind) -> Config {
        Config { network, hidden: network.default_hidden(), actor_lr: network.default_actor_lr(), ..self }
    }

    /// The default hyperparameters for a fixed team of that many agents.
    pub fn for_agents(n_agents: usize) -> Config {
        Config {
            seed: 0,
            steps: 2_000_000,
            algorithm: if n_agents >= STATE_CRITIC_AGENTS { Algorithm::Mappo } else { Algorithm::Ippo },
            last_actions: 4,
            num_envs: 64,
            horizon: 64,
            epochs: 4,
            minibatches: 8,
            network: NetworkKind::Flat,
            hidden: NetworkKind::Flat.default_hidden(),
            activation: Activation::Relu,
            actor_lr: NetworkKind::Flat.default_actor_lr(),
            critic_lr: 1e-3,
            lr_end: 0.05,
            adam_eps: 1e-5,
            gamma: 0.99,
            lambda: 0.95,
            advantage_floor: 0.3,
            clip: 0.2,
            value_clip: 0.2,
            huber: 10.0,
            entropy: TEAM_ENTROPY / n_agents.max(1) as f64,
            entropy_end: 0.0,
            max_grad_norm: 1.0,
            evaluate_every: None,
            enemies: Enemies::Scripts,
            map_weights: Vec::new(),
        }
    }
}

/// A hyperparameter out of range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name} must be {accepted}, got {given}")]
pub struct ConfigError {
    name: &'static str,
    accepted: &'static str,
    given: String,
}

impl Config {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the first hyperparameter that is out of its range.
    pub fn check(&self) -> Result<(), ConfigError> {
        self.check_sizes()?;
        self.check_factors()?;
        self.enemies.check()
    }

    /// Checks that a run can have so many maps.
    ///
    /// # Errors
    /// If there is none, or more than environments; or if there are several, and the networks are those of
    /// one.
    pub fn check_maps(&self, count: usize) -> Result<(), ConfigError> {
        ensure(count <= self.num_envs, "num_envs", "at least the number of maps", &self.num_envs)?;
        ensure(count > 0, "maps", "at least one", &count)?;
        let weights = &self.map_weights;
        let are_valid = weights.iter().all(|weight| *weight > 0.0 && weight.is_finite());
        let accepted = "one number above 0 per map";
        ensure(
            are_valid && [0, count].contains(&weights.len()),
            "map_weights",
            accepted,
            &format!("{weights:?}"),
        )?;
        let is_universal = count == 1 || self.network == NetworkKind::Universal;
        ensure(is_universal, "network", "`universal` with several maps", &format!("`{}`", self.network))
    }

    /// Divides the environments among so many maps, by their weights, so that each has at least one.
    #[must_use]
    pub fn envs_of_maps(&self, count: usize) -> Vec<usize> {
        let equal = vec![1.0; count];
        let weights = if self.map_weights.is_empty() { &equal } else { &self.map_weights };
        // Sums of large weights would overflow. A power of two changes no other digits.
        let scale = if weights.iter().any(|weight| *weight > 1.0) { 2.0f64.powi(-100) } else { 1.0 };
        let weights: Vec<f64> = weights.iter().map(|weight| weight * scale).collect();
        let total: f64 = weights.iter().sum();
        let (mut sum, mut begin) = (0.0, 0);
        let divide = |(map, weight): (usize, &f64)| {
            sum += weight;
            // The last end is exact, whatever was rounded before.
            let end = if map + 1 == weights.len() {
                self.num_envs
            } else {
                (self.num_envs as f64 * sum / total) as usize
            };
            end - std::mem::replace(&mut begin, end)
        };
        let mut envs: Vec<usize> = weights.iter().enumerate().map(divide).collect();
        while let Some(none) = envs.iter().position(|&envs| envs == 0)
            && let Some(most) = (0..count).rev().max_by_key(|&map| envs[map]).filter(|&map| envs[map] > 1)
        {
            envs[none] += 1;
            envs[most] -= 1;
        }
        envs
    }

    fn check_sizes(&self) -> Result<(), ConfigError> {
        let count = |name, value: usize, accepted, max: usize| {
            ensure((1..=max).contains(&value), name, accepted, &value)
        };
        ensure((1..=1 << 48).contains(&self.steps), "steps", "between 1 and 2^48", &self.steps)?;
        let history = self.last_actions <= MAX_LAST_ACTIONS;
        ensure(history, "last_actions", "between 0 and 16", &self.last_actions)?;
        count("num_envs", self.num_envs, "between 1 and 65536", 1 << 16)?;
        count("horizon", self.horizon, "between 1 and 65536", 1 << 16)?;
        let every = self.evaluate_every.unwrap_or(1);
        ensure(every > 0, "evaluate_every", "at least 1", &every)?;
        let samples = self.num_envs * self.horizon;
        ensure(samples <= 1 << 20, "num_envs times horizon", "at most 1048576", &samples)?;
        count("epochs", self.epochs, "between 1 and 1000", 1000)?;
        count("minibatches", self.minibatches, "between 1 and 1000", 1000)?;
        let (layers, accepted) = match self.network {
            NetworkKind::Flat => (1..=8, "1 to 8 widths between 2 and 4096"),
            NetworkKind::Units | NetworkKind::Universal => {
                (2..=2, "2 widths between 2 and 4096 for networks over units (`flat` ones have others, too)")
            }
        };
        let scripts = self.network != NetworkKind::Universal || self.enemies.are_scripts();
        ensure(scripts, "network", "`flat` or `units` where a team plays the enemies", &"`universal`")?;
        let widths = self.hidden.iter().all(|width| (2..=4096).contains(width));
        let given = format!("{:?}", self.hidden);
        ensure(layers.contains(&self.hidden.len()) && widths, "hidden", accepted, &given)
    }

    fn check_factors(&self) -> Result<(), ConfigError> {
        let rates = [("actor_lr", self.actor_lr), ("critic_lr", self.critic_lr), ("adam_eps", self.adam_eps)];
        for (name, value) in rates {
            ensure(value > 0.0 && value <= 1.0, name, "above 0 and at most 1", &value)?;
        }
        let shares = [("gamma", self.gamma), ("lambda", self.lambda), ("lr_end", self.lr_end)];
        for (name, value) in shares {
            ensure((0.0..=1.0).contains(&value), name, "between 0 and 1", &value)?;
        }
        let weights = [
            ("entropy", self.entropy),
            ("entropy_end", self.entropy_end),
            ("advantage_floor", self.advantage_floor),
        ];
        for (name, value) in weights {
            ensure((0.0..=10.0).contains(&value), name, "between 0 and 10", &value)?;
        }
        let limits = [
            ("clip", self.clip),
            ("value_clip", self.value_clip),
            ("huber", self.huber),
            ("max_grad_norm", self.max_grad_norm),
        ];
        for (name, value) in limits {
            ensure(value > 0.0 && value <= 1e6, name, "above 0 and at most 1000000", &value)?;
        }
        Ok(())
    }

    /// A value that changes linearly over the run, after `steps` steps.
    pub fn annealed(&self, begin: f64, end: f64, steps: u64) -> f64 {
        let share = (steps as f64 / self.steps as f64).min(1.0);
        begin + (end - begin) * share
    }
}

impl ConfigError {
    /// With a longer text of what was given.
    pub(crate) fn new(name: &'static str, accepted: &'static str, given: String) -> ConfigError {
        ConfigError { name, accepted, given }
    }
}

pub(crate) fn ensure(
    holds: bool,
    name: &'static str,
    accepted: &'static str,
    given: &dyn std::fmt::Display,
) -> Result<(), ConfigError> {
    if holds { Ok(()) } else { Err(ConfigError { name, accepted, given: shortened(&given.to_string()) }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_in_range_and_nan_is_not() {
        assert_eq!(Config::for_agents(3).check(), Ok(()));
        let config = Config { gamma: f64::NAN, ..Config::for_agents(3) };
        assert_eq!(config.check().unwrap_err().to_string(), "gamma must be between 0 and 1, got NaN");
        let config = Config { last_actions: 17, ..Config::for_agents(3) };
        assert_eq!(config.check().unwrap_err().to_string(), "last_actions must be between 0 and 16, got 17");
        let config = Config { hidden: vec![64, 1], ..Config::for_agents(3) };
        assert!(config.check().unwrap_err().to_string().ends_with("between 2 and 4096, got [64, 1]"));
        let config = Config { max_grad_norm: f64::INFINITY, ..Config::for_agents(3) };
        assert!(config.check().is_err());
    }

    /// Without units in observations, a network over units would see nothing.
    #[test]
    fn networks_are_over_units_where_observations_have_some() {
        let network = |scenario: &Scenario| Config::for_scenario(scenario).network;
        let mut scenario = Scenario::standard("zerg_5_vs_5").expect("a standard scenario");
        assert_eq!(network(&scenario), NetworkKind::Units);
        let config = Config::for_scenario(&scenario);
        assert_eq!((config.hidden, config.actor_lr), (vec![32, 64], 1.4e-3));
        scenario.smacv2.as_mut().expect("it is generated").obs_starcraft = false;
        assert_eq!(network(&scenario), NetworkKind::Flat);
        assert_eq!(network(&Scenario::standard("2s3z").expect("a standard scenario")), NetworkKind::Units);
    }

    /// The critic sees the state of large teams and of drawn ones, which do not see what they did.
    #[test]
    fn defaults_are_those_of_the_scenario() {
        for (name, algorithm, last_actions, entropy) in [
            ("3s_vs_5z", Algorithm::Ippo, 4, 0.15 / 3.0),
            ("5m_vs_6m", Algorithm::Mappo, 4, 0.15 / 5.0),
            ("8m", Algorithm::Mappo, 4, 0.15 / 8.0),
            ("zerg_5_vs_5", Algorithm::Mappo, 0, 0.15 / 5.0),
            ("zerg_10_vs_11", Algorithm::Mappo, 0, 0.15 / 10.0),
        ] {
            let config = Config::for_scenario(&Scenario::standard(name).expect("a standard scenario"));
            let found = (config.algorithm, config.last_actions, config.entropy);
            assert_eq!(found, (algorithm, last_actions, entropy), "{name}");
        }
    }

    #[test]
    fn environments_are_divided_by_weight() {
        let config = |num_envs, weights: &[f64]| Config {
            num_envs,
            map_weights: weights.to_vec(),
            ..Config::for_agents(3).with_network(NetworkKind::Universal)
        };
        assert_eq!(config(64, &[]).envs_of_maps(1), [64]);
        assert_eq!(config(64, &[]).envs_of_maps(3), [21, 21, 22]);
        assert_eq!(config(64, &[1.0, 1.0, 2.0]).envs_of_maps(3), [16, 16, 32]);
        assert_eq!(config(10, &[0.1, 0.2, 0.7]).envs_of_maps(3), [1, 2, 7]);
        assert_eq!(config(10, &[0.1, 0.2, 0.7]).check_maps(3), Ok(()));
        let error = |config: Config, count| config.check_maps(count).unwrap_err().to_string();
        // Whether a map had none depended on their order.
        assert_eq!(config(64, &[1000.0, 1.0, 1.0]).envs_of_maps(3), [62, 1, 1]);
        assert_eq!(config(64, &[1.0, 1.0, 1000.0]).envs_of_maps(3), [1, 1, 62]);
        assert_eq!(config(3, &[1.0, 1000.0, 1.0]).envs_of_maps(3), [1, 1, 1]);
        // These overflowed.
        assert_eq!(config(64, &[1e307; 2]).envs_of_maps(2), [32, 32]);
        assert_eq!(config(64, &[1e308; 2]).envs_of_maps(2), [32, 32]);
        assert_eq!(config(64, &[1e300, f64::MAX, 1.0]).envs_of_maps(3), [1, 62, 1]);
        assert_eq!(config(64, &[1.0, 1e-308, 3.0]).envs_of_maps(3), [16, 1, 47]);
        assert_eq!(config(64, &[5e-324, 5e-324]).envs_of_maps(2), [32, 32]);
        assert_eq!(error(config(2, &[]), 3), "num_envs must be at least the number of maps, got 2");
        let expected = "map_weights must be one number above 0 per map, got ";
        for weights in [&[1.0, 0.0][..], &[1.0, f64::NAN], &[1.0, -1.0], &[1.0], &[1.0, f64::INFINITY]] {
            assert!(error(config(10, weights), 2).starts_with(expected), "{weights:?}");
        }
    }

    #[test]
    fn annealing_is_linear_and_ends() {
        let config = Config { steps: 200, ..Config::for_agents(3) };
        let at = |steps| config.annealed(1.0, 0.5, steps);
        assert_eq!([at(0), at(100), at(200), at(300)], [1.0, 0.75, 0.5, 0.5]);
    }
}
