//! The embedded scenarios and terrains are those of the published environment, and of the SMAC maps that it
//! lacks.

use smaclite_scenarios::{Faction, Scenario, ScenarioFiles, Terrain};
use smaclite_units::Keyword;

/// Name, allies and enemies by type, attack point, one-hot types by id, who has shields, step limit, terrain
/// (`own` is no preset), and the faction of unit 0 (A or E).
const SCENARIOS: &str = "
10m_vs_11m|10 MARINE|11 MARINE|9 16|-|-|150|SIMPLE|A
1c3s5z|1 COLOSSUS 3 STALKER 5 ZEALOT|same|9 16|COLOSSUS STALKER ZEALOT|both|180|SIMPLE|A
25m|25 MARINE|same|9 16|-|-|150|SIMPLE|A
27m_vs_30m|27 MARINE|30 MARINE|9 16|-|-|180|SIMPLE|A
2c_vs_64zg|2 COLOSSUS|64 ZERGLING|16 16|-|ALLY|400|RAVINE|A
2m_vs_1z|2 MARINE|1 ZEALOT|16 12|-|ENEMY|150|OCTAGON|A
2s3z|2 STALKER 3 ZEALOT|same|9 16|STALKER ZEALOT|both|120|SIMPLE|A
2s_vs_1sc|2 STALKER|1 SPINE_CRAWLER|13.92 20.04|-|ALLY|300|PENTAGON|E
3m|3 MARINE|same|9 16|-|-|60|SIMPLE|A
3s5z|3 STALKER 5 ZEALOT|same|9 16|STALKER ZEALOT|both|150|SIMPLE|A
3s5z_vs_3s6z|3 STALKER 5 ZEALOT|3 STALKER 6 ZEALOT|9 16|STALKER ZEALOT|both|170|SIMPLE|A
3s_vs_3z|3 STALKER|3 ZEALOT|9 16|-|both|150|ALL_GREEN|A
3s_vs_4z|3 STALKER|4 ZEALOT|9 16|-|both|200|ALL_GREEN|A
3s_vs_5z|3 STALKER|5 ZEALOT|9 16|-|both|250|ALL_GREEN|A
5m_vs_6m|5 MARINE|6 MARINE|9 16|-|-|70|SIMPLE|A
6h_vs_8z|6 HYDRALISK|8 ZEALOT|14.6 9.49|-|ENEMY|150|own|A
8m|8 MARINE|same|9 16|-|-|120|SIMPLE|A
8m_vs_9m|8 MARINE|9 MARINE|9 16|-|-|120|SIMPLE|A
bane_vs_bane|20 ZERGLING 4 BANELING|4 BANELING 20 ZERGLING|16 8|BANELING ZERGLING|-|200|OCTAGON|E
corridor|6 ZEALOT|24 ZERGLING|4.47 4.33|-|ALLY|400|CORRIDOR|E
MMM|1 MEDIVAC 7 MARINE 2 MARAUDER|same|9 16|MARAUDER MARINE MEDIVAC|-|150|SIMPLE|A
MMM2|1 MEDIVAC 7 MARINE 2 MARAUDER|1 MEDIVAC 8 MARINE 3 MARAUDER|9 16|MARAUDER MARINE MEDIVAC|-|180|SIMPLE|A
so_many_baneling|7 ZEALOT|32 BANELING|4.47 4.33|-|ALLY|100|own|A";

fn rows() -> impl Iterator<Item = [&'static str; 9]> {
    let columns = |row: &'static str| row.split('|').collect::<Vec<_>>().try_into();
    SCENARIOS.trim_start().lines().map(move |row| columns(row).expect("nine columns"))
}

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
    let names: Vec<&str> = (0..scenario.num_unit_types).map(name).collect();
    if names.is_empty() { "-".to_owned() } else { names.join(" ") }
}

#[test]
fn contents_of_every_scenario() {
    assert!(Scenario::standard_names().eq(rows().map(|row| row[0])));
    for [name, allies, enemies, attack_point, types, shields, limit, terrain, first] in rows() {
        let scenario = Scenario::standard(name).unwrap_or_else(|| panic!("{name} must be readable"));
        assert_eq!(scenario.name, name);
        assert_eq!(side(&scenario, Faction::Ally), allies, "{name}");
        assert_eq!(
            side(&scenario, Faction::Enemy),
            if enemies == "same" { allies } else { enemies },
            "{name}"
        );
        assert_eq!(scenario.n_agents() + scenario.n_enemies(), scenario.units.len(), "{name}");
        assert_eq!(scenario.attack_point.map(|x| x.to_string()).join(" "), attack_point, "{name}");
        assert_eq!(types_by_id(&scenario), types, "{name}");
        let has_shields = match (scenario.ally_has_shields, scenario.enemy_has_shields) {
            (true, true) => "both",
            (true, false) => "ALLY",
            (false, true) => "ENEMY",
            (false, false) => "-",
        };
        assert_eq!(has_shields, shields, "{name}");
        assert_eq!(scenario.episode_limit.map(|limit| limit.to_string()).as_deref(), Some(limit), "{name}");
        assert_eq!(scenario.units[0].faction.name()[..1], *first, "{name}");
        assert_eq!((scenario.terrain.width(), scenario.terrain.height()), (32, 32), "{name}");
        let preset = Terrain::preset_names()
            .find(|preset| Terrain::preset(preset).as_ref() == Some(&scenario.terrain));
        assert_eq!(preset.unwrap_or("own"), terrain, "{name}");
    }
}

#[test]
fn rows_of_the_terrains_that_are_no_presets() {
    // First and last row, and the walkable range of each of them; all other rows are blocked.
    let hydralisks = "7-7 10-20, 8-8 9-21, 9-9 8-22, 10-17 7-23, 18-18 8-22, 19-19 9-21, 20-20 10-20";
    let banelings = "1-1 2-8, 2-2 1-9, 3-3 1-12, 4-6 1-13, 7-7 1-16, 8-8 2-17, 9-10 3-17, 11-11 3-20, 12-12 \
        4-21, 13-15 7-21, 16-16 8-21, 17-17 9-26, 18-18 10-27, 19-20 13-27, 21-21 13-30, 22-22 \
        14-31, 23-23 15-31, 24-24 16-31, 25-27 19-31, 28-28 20-31, 29-29 21-31, 30-30 22-30";
    let range = |text: &str| -> [i64; 2] {
        let (first, last) = text.split_once('-').expect("a range");
        [first, last].map(|number| number.parse().expect("a number"))
    };
    for (name, rows) in [("6h_vs_8z", hydralisks), ("so_many_baneling", banelings)] {
        let terrain = Scenario::standard(name).unwrap().terrain;
        let rows: Vec<_> =
            rows.split(", ").map(|row| row.split_once(' ').expect("rows and their range")).collect();
        for y in 0..32 {
            let is_row = |(rows, _): &&(&str, &str)| (range(rows)[0]..=range(rows)[1]).contains(&y);
            let expected: Vec<_> = rows.iter().find(is_row).map(|(_, x)| range(x)).into_iter().collect();
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
