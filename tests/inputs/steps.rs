//! Steps battles of a scenario under all rule sets: a file that was accepted must make a battle whose
//! numbers are finite.

use smaclite_engine::policy::Random;
use smaclite_engine::{Arena, Battle, Faction, Rules, Scratch};
use smaclite_scenarios::Scenario;
use std::sync::Arc;

const STEPS: usize = 4;

pub fn run(scenario: &Scenario) {
    for rules in Rules::ALL {
        let arena = Arc::new(Arena::new(scenario, rules));
        let sizes = arena.sizes();
        let mut battle = Battle::new(arena, 1);
        let mut scratch = Scratch::new();
        let mut policy = Random::new(2);
        let mut actions = vec![0; sizes.n_agents];
        let mut obs = vec![f32::NAN; sizes.n_agents * sizes.obs_size];
        let mut state = vec![f32::NAN; sizes.state_size];
        for _ in 0..STEPS {
            policy.act(&battle, &mut actions);
            let step = battle.step(&actions, &mut scratch).expect("legal actions");
            battle.write_obs(Faction::Ally, &mut obs, &mut scratch);
            battle.write_state(Faction::Ally, &mut state);
            assert!(step.reward.is_finite(), "reward {}", step.reward);
            assert!(obs.iter().chain(&state).all(|x| x.is_finite()), "{rules}: {obs:?} {state:?}");
            if step.terminated || step.truncated {
                battle.reset();
            }
        }
    }
}
