//! Tests of `universal`: one team fits every scenario, and sees what types are instead of their numbers.

use super::*;
use crate::architecture::{Architecture, Inputs, Workspace};
use crate::config::{Algorithm, Config};
use crate::random::{Purpose, generator, uniform};
use crate::team::{OnScenario, Team, agent_ids};
use smaclite_engine::{Arena, Battle, Faction, Rules, Scratch};
use std::sync::Arc;

fn config(algorithm: Algorithm) -> Config {
    let config = Config { algorithm, last_actions: 0, ..Config::for_agents(3) };
    config.with_network(NetworkKind::Universal)
}

fn inputs(scenario: &Scenario) -> Inputs {
    Inputs::new(scenario, Arena::new(scenario, Rules::Smaclite).sizes(), 0)
}

/// A team whose parameters are all random, so that none has no effect.
fn team(config: &Config, inputs: &Inputs) -> Team {
    let mut team = Team::new(config, inputs);
    let mut generator = generator(7, Purpose::Weights, [0, 0]);
    for params in [&mut team.actor.params, &mut team.critic.params] {
        params.iter_mut().for_each(|param| *param = 0.2 * (uniform(&mut generator) - 0.5));
    }
    team
}

/// What the actor says in a battle after some steps.
fn outputs(scenario: &Scenario, config: &Config, steps: usize) -> Vec<f32> {
    let (inputs, arena) = (inputs(scenario), Arc::new(Arena::new(scenario, Rules::Smaclite)));
    let mut on_scenario = OnScenario::new(config, &inputs).expect("a universal network");
    let team = team(config, &inputs);
    let actor = &on_scenario.specialise(&team).actor;
    let (mut battle, mut scratch) = (Battle::new(Arc::clone(&arena), 3), Scratch::new());
    battle.reset();
    let mut actions = vec![0; scenario.n_agents()];
    for _ in 0..steps {
        smaclite_engine::policy::nearest(&battle, &mut actions);
        battle.step(&actions, &mut scratch).unwrap();
    }
    let sizes = arena.sizes();
    let mut obs = vec![0.0; sizes.n_agents * sizes.obs_size];
    battle.write_obs(Faction::Ally, &mut obs, &mut scratch);
    let mut workspace = Workspace::default();
    actor.forward(&obs, &agent_ids(sizes.n_agents, sizes.n_agents), &mut workspace);
    let rows = workspace.output().chunks_exact(actor.architecture.padded_out());
    rows.flat_map(|row| row[..sizes.n_actions].to_vec()).collect()
}

#[test]
fn one_team_fits_every_standard_scenario() {
    for algorithm in [Algorithm::Mappo, Algorithm::Ippo] {
        let config = config(algorithm);
        let mut sizes = Vec::new();
        for name in Scenario::standard_names().chain(Scenario::generated_names()) {
            let scenario = Scenario::standard(name).unwrap();
            let inputs = inputs(&scenario);
            inputs.check(&config).unwrap_or_else(|error| panic!("{name}: {error}"));
            let team = team(&config, &inputs);
            sizes.push((team.actor.params.len(), team.critic.params.len()));
            let mut on_scenario = OnScenario::new(&config, &inputs).unwrap();
            let params = &on_scenario.specialise(&team).actor.params;
            assert_eq!(params.len(), Architecture::actor(&config, &inputs).n_params(), "{name}");
        }
        assert!(sizes.iter().all(|size| *size == sizes[0]), "{sizes:?}");
    }
}

/// Numbers of types mean nothing: a team sees what the types are. Where all units are of one type,
/// observations may say it, or not. (Of the dead they say nothing.)
#[test]
fn a_type_is_known_whatever_its_number() {
    let check = |name: &str, algorithm, steps, change: fn(&mut Scenario)| {
        let (scenario, config) = (Scenario::standard(name).unwrap(), config(algorithm));
        let mut other = scenario.clone();
        change(&mut other);
        let (one, other) = (outputs(&scenario, &config, steps), outputs(&other, &config, steps));
        assert!(one.len() == other.len() && one.iter().any(|output| output.abs() > 1e-3));
        for (a, b) in one.iter().zip(&other) {
            assert!((a - b).abs() < 1e-5, "{name}: {a} {b}");
        }
    };
    check("MMM", Algorithm::Mappo, 12, |other| {
        other.type_ids.iter_mut().for_each(|id| *id = (*id + 1) % other.num_unit_types);
    });
    check("3m", Algorithm::Ippo, 4, |named| {
        (named.num_unit_types, named.type_ids) = (1, vec![0; named.unit_types.len()]);
    });
}

/// Both are linear: <S p, g> = <p, Sᵀ g> for all p and g, up to what S adds to p = 0, which is nothing.
#[test]
fn gradients_come_back_by_the_transpose() {
    for name in ["3m", "MMM", "2s3z", "zerg_5_vs_5"] {
        let (scenario, config) = (Scenario::standard(name).unwrap(), config(Algorithm::Mappo));
        let inputs = inputs(&scenario);
        let specialisations = Architecture::specialisations(&config, &inputs).unwrap();
        let team = team(&config, &inputs);
        for (of, universal) in specialisations.iter().zip([&team.actor.params, &team.critic.params]) {
            let mut special = Vec::new();
            of.specialise(universal, &mut special);
            let mut random = generator(1, Purpose::Weights, [1, 0]);
            let g: Vec<f32> = special.iter().map(|_| uniform(&mut random) - 0.5).collect();
            let mut back = vec![0.0; universal.len()];
            of.take_back(&g, &mut back);
            let dot = |a: &[f32], b: &[f32]| -> f64 {
                a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
            };
            let (there, here) = (dot(&special, &g), dot(universal, &back));
            assert!((there - here).abs() < 1e-3 * (1.0 + there.abs()), "{name}: {there} {here}");
        }
    }
}
