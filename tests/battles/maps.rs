//! The standard scenarios are the 23 maps of SMAC, with the same sizes, so that code written for SMAC runs
//! unchanged.

use smaclite_engine::{Arena, Rules};
use smaclite_scenarios::Scenario;

/// SMAC's sizes: name, agents, enemies, episode limit, actions, sizes of observation and state.
const MAPS: [(&str, [usize; 6]); 23] = [
    ("10m_vs_11m", [10, 11, 150, 17, 105, 243]),
    ("1c3s5z", [9, 9, 180, 15, 162, 270]),
    ("25m", [25, 25, 150, 31, 250, 950]),
    ("27m_vs_30m", [27, 30, 180, 36, 285, 1170]),
    ("2c_vs_64zg", [2, 64, 400, 70, 332, 342]),
    ("2m_vs_1z", [2, 1, 150, 7, 16, 26]),
    ("2s3z", [5, 5, 120, 11, 80, 120]),
    ("2s_vs_1sc", [2, 1, 300, 7, 17, 27]),
    ("3m", [3, 3, 60, 9, 30, 48]),
    ("3s5z", [8, 8, 150, 14, 128, 216]),
    ("3s5z_vs_3s6z", [8, 9, 170, 15, 136, 230]),
    ("3s_vs_3z", [3, 3, 150, 9, 36, 54]),
    ("3s_vs_4z", [3, 4, 200, 10, 42, 61]),
    ("3s_vs_5z", [3, 5, 250, 11, 48, 68]),
    ("5m_vs_6m", [5, 6, 70, 12, 55, 98]),
    ("6h_vs_8z", [6, 8, 150, 14, 78, 140]),
    ("8m", [8, 8, 120, 14, 80, 168]),
    ("8m_vs_9m", [8, 9, 120, 15, 85, 179]),
    ("bane_vs_bane", [24, 24, 200, 30, 336, 984]),
    ("corridor", [6, 24, 400, 30, 156, 282]),
    ("MMM", [10, 10, 150, 16, 160, 290]),
    ("MMM2", [10, 12, 180, 18, 176, 322]),
    ("so_many_baneling", [7, 32, 100, 38, 202, 397]),
];

#[test]
fn sizes_are_those_of_smac() {
    let found: Vec<(&str, [usize; 6])> = Scenario::standard_names()
        .map(|name| {
            let scenario = Scenario::standard(name).unwrap_or_else(|| panic!("{name} must be readable"));
            let arena = Arena::new(&scenario, Rules::default());
            let (s, limit) = (arena.sizes(), arena.episode_limit().unwrap_or(0) as usize);
            (name, [s.n_agents, s.n_enemies, limit, s.n_actions, s.obs_size, s.state_size])
        })
        .collect();
    assert_eq!(found, MAPS);
}
