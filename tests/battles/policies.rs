//! What scripted policies choose, for the agents and for the enemies.

use std::fmt::Write as _;
use std::sync::Arc;

use smaclite_engine::policy::{Scripted, Tactic};
use smaclite_engine::{Arena, Battle, Rules, Scratch};
use smaclite_scenarios::Scenario;
use xxhash_rust::xxh3::Xxh3;

/// Healers, several types, walls, ranges that differ, and more enemies than agents.
const MAPS: [&str; 5] = ["MMM", "2c_vs_64zg", "3s_vs_5z", "1c3s5z", "bane_vs_bane"];

/// A hash of the agents' actions and of where all units are, over some episodes.
fn fingerprint(map: &str, agents: Tactic, enemies: &str) -> u64 {
    let scenario = Scenario::standard(map).expect("a standard scenario");
    let arena = Arena::new(&scenario, Rules::Smaclite);
    let mut battle = Battle::new(Arc::new(arena.with_opponents(enemies.parse().expect("an opponent"))), 1);
    let (mut player, mut scratch) = (Scripted::new(agents, 1), Scratch::new());
    let mut actions = vec![0; battle.arena().sizes().n_agents];
    let mut hash = Xxh3::new();
    for _ in 0..80 {
        if battle.is_over() {
            battle.reset();
        }
        player.act(&battle, &mut actions);
        actions.iter().for_each(|action| hash.update(&action.to_le_bytes()));
        battle.step(&actions, &mut scratch).expect("legal actions");
        let units = battle.units().pos.iter().flat_map(|at| at.to_array());
        units.for_each(|x| hash.update(&x.to_bits().to_le_bytes()));
    }
    hash.digest()
}

/// Results against a policy can be compared only while it plays as it did.
#[test]
fn policies_choose_as_they_did() {
    let mut found = String::new();
    for map in MAPS {
        for tactic in Tactic::ALL {
            let name = tactic.name();
            let [agents, enemies] =
                [fingerprint(map, tactic, "attack_move"), fingerprint(map, Tactic::Nearest, name)];
            writeln!(found, "{map} {name} as agents {agents:016x}, as enemies {enemies:016x}").expect("text");
        }
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/golden/policies.txt");
    let kept = std::fs::read_to_string(path).unwrap_or_default();
    assert_eq!(found, kept, "a policy that chooses otherwise is another one");
}
