//! The embedded scenarios and terrains are those of the published environment, and of the SMAC maps that it
//! lacks.

use smaclite_scenarios::{Faction, Scenario, ScenarioFiles, Terrain};

/// name, allies and enemies by type, attack point, one-hot types by id, shields (ally, enemy), step limit
type Row = (&'static str, &'static str, &'static str, [f64; 2], &'static str, (bool, bool), u32);

const SCENARIOS: [Row; 23] = [
    ("10m_vs_11m", "10 MARINE", "11 MARINE", [9.0, 16.0], "", (false, false), 150),
    (
        "1c3s5z",
        "1 COLOSSUS 3 STALKER 5 ZEALOT",
        "1 COLOSSUS 3 STALKER 5 ZEALOT",
        [9.0, 16.0],
        "COLOSSUS STALKER ZEALOT",
        (true, true),
        180,
    ),
    ("25m", "25 MARINE", "25 MARINE", [9.0, 16.0], "", (false, false), 150),
    ("27m_vs_30m", "27 MARINE", "30 MARINE", [9.0, 16.0], "", (false, false), 180),
    ("2c_vs_64zg", "2 COLOSSUS", "64 ZERGLING", [16.0, 16.0], "", (true, false), 400),
    ("2m_vs_1z", "2 MARINE", "1 ZEALOT", [16.0, 12.0], "", (false, true), 150),
    ("2s3z", "2 STALKER 3 ZEALOT", "2 STALKER 3 ZEALOT", [9.0, 16.0], "STALKER ZEALOT", (true, true), 120),
    ("2s_vs_1sc", "2 STALKER", "1 SPINE_CRAWLER", [13.92, 20.04], "", (true, false), 300),
    ("3m", "3 MARINE", "3 MARINE", [9.0, 16.0], "", (false, false), 60),
    ("3s5z", "3 STALKER 5 ZEALOT", "3 STALKER 5 ZEALOT", [9.0, 16.0], "STALKER ZEALOT", (true, true), 150),
    (
        "3s5z_vs_3s6z",
        "3 STALKER 5 ZEALOT",
        "3 STALKER 6 ZEALOT",
        [9.0, 16.0],
        "STALKER ZEALOT",
        (true, true),
        170,
    ),
    ("3s_vs_3z", "3 STALKER", "3 ZEALOT", [9.0, 16.0], "", (true, true), 150),
    ("3s_vs_4z", "3 STALKER", "4 ZEALOT", [9.0, 16.0], "", (true, true), 200),
    ("3s_vs_5z", "3 STALKER", "5 ZEALOT", [9.0, 16.0], "", (true, true), 250),
    ("5m_vs_6m", "5 MARINE", "6 MARINE", [9.0, 16.0], "", (false, false), 70),
    ("6h_vs_8z", "6 HYDRALISK", "8 ZEALOT", [14.6, 9.49], "", (false, true), 150),
    ("8m", "8 MARINE", "8 MARINE", [9.0, 16.0], "", (false, false), 120),
    ("8m_vs_9m", "8 MARINE", "9 MARINE", [9.0, 16.0], "", (false, false), 120),
    (
        "bane_vs_bane",
        "20 ZERGLING 4 BANELING",
        "4 BANELING 20 ZERGLING",
        [16.0, 8.0],
        "BANELING ZERGLING",
        (false, false),
        200,
    ),
    ("corridor", "6 ZEALOT", "24 ZERGLING", [4.47, 4.33], "", (true, false), 400),
    (
        "MMM",
        "1 MEDIVAC 7 MARINE 2 MARAUDER",
        "1 MEDIVAC 7 MARINE 2 MARAUDER",
        [9.0, 16.0],
        "MARAUDER MARINE MEDIVAC",
        (false, false),
        150,
    ),
    (
        "MMM2",
        "1 MEDIVAC 7 MARINE 2 MARAUDER",
        "1 MEDIVAC 8 MARINE 3 MARAUDER",
        [9.0, 16.0],
        "MARAUDER MARINE MEDIVAC",
        (false, false),
        180,
    ),
    ("so_many_baneling", "7 ZEALOT", "32 BANELING", [4.47, 4.33], "", (true, false), 100),
];

/// `2 STALKER 3 ZEALOT`: the units of a faction in id order, as runs of one type with their lengths.
fn side(scenario: &Scenario, faction: Faction) -> String {
    let mut runs: Vec<(&str, usize)> = Vec::new();
    for (id, unit) in scenario.units.iter().filter(|unit| unit.faction == faction).enumerate() {
        assert_eq!(unit.id_in_faction, id);
        let name = scenario.unit_types[unit.unit_type].name.as_str();
        match runs.last_mut() {
            Some((last, count)) if *last == name => *count += 1,
            _ => runs.push((name, 1)),
        }
    }
    runs.iter().map(|(name, count)| format!("{count} {name}")).collect::<Vec<_>>().join(" ")
}

fn types_by_id(scenario: &Scenario) -> String {
    let name = |id| {
        let index = scenario.type_ids.iter().position(|known| *known == id).unwrap();
        scenario.unit_types[index].name.as_str()
    };
    (0..scenario.num_unit_types).map(name).collect::<Vec<_>>().join(" ")
}

#[test]
fn contents_of_every_scenario() {
    assert!(Scenario::standard_names().eq(SCENARIOS.iter().map(|row| row.0)));
    for (name, allies, enemies, attack_point, types, shields, limit) in SCENARIOS {
        let scenario = Scenario::standard(name).unwrap_or_else(|| panic!("{name} must be readable"));
        assert_eq!(scenario.name, name);
        assert_eq!(side(&scenario, Faction::Ally), allies, "{name}");
        assert_eq!(side(&scenario, Faction::Enemy), enemies, "{name}");
        assert_eq!(scenario.n_agents() + scenario.n_enemies(), scenario.units.len(), "{name}");
        assert_eq!(scenario.attack_point, attack_point, "{name}");
        assert_eq!(types_by_id(&scenario), types, "{name}");
        assert_eq!((scenario.ally_has_shields, scenario.enemy_has_shields), shields, "{name}");
        assert_eq!(scenario.episode_limit, Some(limit), "{name}");
        assert_eq!((scenario.terrain.width(), scenario.terrain.height()), (32, 32), "{name}");
    }
}

#[test]
fn terrain_and_group_order_of_every_scenario() {
    let expected = [
        ("10m_vs_11m", "SIMPLE", Faction::Ally),
        ("1c3s5z", "SIMPLE", Faction::Ally),
        ("25m", "SIMPLE", Faction::Ally),
        ("27m_vs_30m", "SIMPLE", Faction::Ally),
        ("2c_vs_64zg", "RAVINE", Faction::Ally),
        ("2m_vs_1z", "OCTAGON", Faction::Ally),
        ("2s3z", "SIMPLE", Faction::Ally),
        ("2s_vs_1sc", "PENTAGON", Faction::Enemy),
        ("3m", "SIMPLE", Faction::Ally),
        ("3s5z", "SIMPLE", Faction::Ally),
        ("3s5z_vs_3s6z", "SIMPLE", Faction::Ally),
        ("3s_vs_3z", "ALL_GREEN", Faction::Ally),
        ("3s_vs_4z", "ALL_GREEN", Faction::Ally),
        ("3s_vs_5z", "ALL_GREEN", Faction::Ally),
        ("5m_vs_6m", "SIMPLE", Faction::Ally),
        ("8m", "SIMPLE", Faction::Ally),
        ("8m_vs_9m", "SIMPLE", Faction::Ally),
        ("bane_vs_bane", "OCTAGON", Faction::Enemy),
        ("corridor", "CORRIDOR", Faction::Enemy),
        ("MMM", "SIMPLE", Faction::Ally),
        ("MMM2", "SIMPLE", Faction::Ally),
    ];
    for (name, terrain, first) in expected {
        let scenario = Scenario::standard(name).unwrap();
        assert_eq!(Some(scenario.terrain), Terrain::preset(terrain), "{name}");
        assert_eq!(scenario.units[0].faction, first, "{name}");
    }
    for name in ["6h_vs_8z", "so_many_baneling"] {
        assert_eq!(Scenario::standard(name).unwrap().units[0].faction, Faction::Ally, "{name}");
    }
}

#[test]
fn rows_of_the_terrains_that_are_no_presets() {
    // First and last row, and the walkable range of each of them; all other rows are blocked.
    let hydralisks: &[(i64, i64, [i64; 2])] = &[
        (7, 7, [10, 20]),
        (8, 8, [9, 21]),
        (9, 9, [8, 22]),
        (10, 17, [7, 23]),
        (18, 18, [8, 22]),
        (19, 19, [9, 21]),
        (20, 20, [10, 20]),
    ];
    let banelings: &[(i64, i64, [i64; 2])] = &[
        (1, 1, [2, 8]),
        (2, 2, [1, 9]),
        (3, 3, [1, 12]),
        (4, 6, [1, 13]),
        (7, 7, [1, 16]),
        (8, 8, [2, 17]),
        (9, 10, [3, 17]),
        (11, 11, [3, 20]),
        (12, 12, [4, 21]),
        (13, 15, [7, 21]),
        (16, 16, [8, 21]),
        (17, 17, [9, 26]),
        (18, 18, [10, 27]),
        (19, 20, [13, 27]),
        (21, 21, [13, 30]),
        (22, 22, [14, 31]),
        (23, 23, [15, 31]),
        (24, 24, [16, 31]),
        (25, 27, [19, 31]),
        (28, 28, [20, 31]),
        (29, 29, [21, 31]),
        (30, 30, [22, 30]),
    ];
    for (name, rows) in [("6h_vs_8z", hydralisks), ("so_many_baneling", banelings)] {
        let terrain = Scenario::standard(name).unwrap().terrain;
        for y in 0..32 {
            let row = rows.iter().find(|(first, last, _)| (*first..=*last).contains(&y));
            let expected: Vec<_> = row.map(|(.., range)| *range).into_iter().collect();
            assert_eq!(walkable(&terrain, y), expected, "{name}, y = {y}");
        }
    }
}

/// The walkable squares of a row, as half-open ranges.
fn walkable(terrain: &Terrain, y: i64) -> Vec<[i64; 2]> {
    let mut ranges: Vec<[i64; 2]> = Vec::new();
    for x in (0..32).filter(|&x| terrain.is_walkable(x, y)) {
        match ranges.last_mut() {
            Some([_, end]) if *end == x => *end += 1,
            _ => ranges.push([x, x + 1]),
        }
    }
    ranges
}

#[test]
fn rows_of_every_terrain() {
    let rows: [(&str, i64, &[[i64; 2]]); 19] = [
        ("ALL_GREEN", 31, &[[0, 32]]),
        ("ALL_GREEN", 30, &[[0, 1], [31, 32]]),
        ("ALL_GREEN", 3, &[[0, 1], [3, 29], [31, 32]]),
        ("CORRIDOR", 31, &[]),
        ("CORRIDOR", 30, &[[20, 30]]),
        ("CORRIDOR", 13, &[[11, 26]]),
        ("CORRIDOR", 12, &[[2, 15]]),
        ("CORRIDOR", 1, &[[2, 14]]),
        ("NARROW", 17, &[[0, 14], [16, 32]]),
        ("NARROW", 15, &[[0, 32]]),
        ("OCTAGON", 26, &[[10, 22]]),
        ("OCTAGON", 4, &[]),
        ("PENTAGON", 24, &[[12, 16]]),
        ("PENTAGON", 7, &[[8, 20]]),
        ("RAVINE", 19, &[[3, 29]]),
        ("RAVINE", 12, &[[0, 4], [28, 32]]),
        ("SIMPLE", 24, &[]),
        ("SIMPLE", 23, &[[0, 32]]),
        ("SIMPLE", 7, &[]),
    ];
    for (name, y, expected) in rows {
        assert_eq!(walkable(&Terrain::preset(name).unwrap(), y), expected, "{name}, y = {y}");
    }
    let checkerboard = Terrain::preset("CHECKERBOARD").unwrap();
    assert!((0..32).all(|y| (0..32).all(|x| checkerboard.is_walkable(x, y) == ((x + y) % 2 == 0))));
    let squares = |name| (0..32).map(|y| walkable(&Terrain::preset(name).unwrap(), y)).collect::<Vec<_>>();
    let count = |name| squares(name).iter().flatten().map(|[from, to]| to - from).sum::<i64>();
    let counts: Vec<_> = Terrain::preset_names().map(count).collect();
    assert_eq!(counts, COUNTS);
}

/// Walkable squares of each preset, in the order of their names.
const COUNTS: [i64; 9] = [800, 512, 440, 1024, 484, 424, 220, 400, 512];

#[test]
fn obstacles_cover_exactly_the_blocked_squares() {
    for name in Terrain::preset_names() {
        let terrain = Terrain::preset(name).unwrap();
        for (x, y) in (0..32u32).flat_map(|x| (0..32u32).map(move |y| (x, y))) {
            let in_rect =
                |r: &smaclite_scenarios::Rect| (r.x0..r.x1).contains(&x) && (r.y0..r.y1).contains(&y);
            let covered = terrain.obstacles().iter().any(in_rect);
            assert_eq!(covered, !terrain.is_walkable(x.into(), y.into()), "{name} ({x}, {y})");
        }
    }
}

#[test]
fn start_positions_of_a_mixed_scenario() {
    // 2s3z: side 3; rows S S Z and Z Z: width 3.5, height 2 * (0.625 + 0.5) + 0.1 = 2.35, corner (7.25,
    // 14.825).
    let scenario = Scenario::standard("2s3z").unwrap();
    let expected = [[7.875, 15.45], [9.175, 15.45], [10.35, 15.45], [7.75, 16.625], [8.8, 16.625]];
    for (unit, expected) in scenario.units.iter().zip(expected) {
        let [x, y] = unit.position;
        let enemy = scenario
            .units
            .iter()
            .find(|other| other.faction == Faction::Enemy && other.id_in_faction == unit.id_in_faction);
        assert!((x - expected[0]).abs() < 1e-12 && (y - expected[1]).abs() < 1e-12, "{unit:?} {expected:?}");
        let mirrored = enemy.unwrap().position;
        assert!((x + mirrored[0] - 32.0).abs() < 1e-12 && (y + mirrored[1] - 32.0).abs() < 1e-12);
    }
}

#[test]
fn no_standard_scenario_has_a_warning() {
    for name in Scenario::standard_names() {
        let (_, files) = ScenarioFiles::resolve(name).unwrap();
        assert_eq!(files.warnings(), [], "{name}");
    }
}

/// Where it stands: type, side and position of every unit, by side and number.
fn placements(scenario: &Scenario) -> Vec<(usize, Faction, [f64; 2])> {
    let of = |side| scenario.units.iter().filter(move |unit| unit.faction == side);
    let all = of(Faction::Ally).chain(of(Faction::Enemy));
    all.map(|unit| (unit.unit_type, unit.faction, unit.position)).collect()
}

#[test]
fn sides_are_exchanged_and_maps_turned() {
    for name in Scenario::standard_names() {
        let scenario = Scenario::standard(name).unwrap();
        let (exchanged, turned) = (scenario.exchanged(), scenario.turned());
        assert_eq!(
            (exchanged.n_agents(), exchanged.n_enemies()),
            (scenario.n_enemies(), scenario.n_agents())
        );
        assert_eq!(exchanged.exchanged().units, scenario.units, "{name}");
        assert_eq!(turned.turned().terrain, scenario.terrain, "{name}");
        let [x, y] = scenario.units[0].position;
        assert_eq!(turned.units[0].position, [32.0 - x, 32.0 - y]);
        let [x, y] = scenario.units[0].centre;
        assert_eq!(turned.units[0].centre, [32.0 - x, 32.0 - y]);
        let corner = |scenario: &Scenario, x, y| scenario.terrain.is_walkable(x, y);
        assert!((0..32).all(|i| corner(&turned, i, 3) == corner(&scenario, 31 - i, 28)), "{name}");
    }
}

/// The sides of these are images of each other, unit by unit, so a team can play either; rules `starcraft`
/// start units elsewhere. Those of
/// bane_vs_bane are too, but its banelings have the last numbers on one side and the first on the other.
#[test]
fn symmetric_scenarios_are_their_own_mirror_images() {
    let is_symmetric = |name: &&str| {
        let scenario = Scenario::standard(name).unwrap();
        let (own, image) = (placements(&scenario), placements(&scenario.exchanged().turned()));
        own.len() == image.len()
            && own.iter().zip(&image).all(|(a, b)| {
                let near = (0..2).all(|axis| (a.2[axis] - b.2[axis]).abs() < 1e-12);
                (a.0, a.1) == (b.0, b.1) && near
            })
            && scenario.terrain == scenario.turned().terrain
    };
    let symmetric: Vec<&str> = Scenario::standard_names().filter(is_symmetric).collect();
    assert_eq!(symmetric, ["1c3s5z", "25m", "2s3z", "3m", "3s5z", "8m", "MMM"]);
}
