//! The draws obey the laws of SMACv2's distributions. Equal seeds draw equally, so no test fails by chance;
//! the thresholds are those of a probability of 1e-6.

use super::*;
use crate::ScenarioFiles;

/// Uniform numbers (splitmix64).
fn shares(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut word = state;
        word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((word ^ (word >> 31)) >> 11) as f64 / 9_007_199_254_740_992.0
    }
}

const EPISODES: usize = 100_000;

fn draws(name: &str, seed: u64) -> (Scenario, Vec<DrawnTeams>) {
    let scenario = Scenario::standard(name).unwrap();
    let (drawer, mut share) = (Drawer::new(&scenario).unwrap(), shares(seed));
    let draw = |_| {
        let mut drawn = DrawnTeams::default();
        drawer.draw(&mut share, &mut drawn);
        drawn
    };
    (scenario, (0..EPISODES).map(draw).collect())
}

/// Compares counts with probabilities. The statistic of a true law exceeds `k + 4.75 sqrt(2 k) + 16` with k
/// degrees of freedom less often than once in 10^6.
fn check(what: &str, counts: &[usize], probabilities: &[f64]) {
    let total: usize = counts.iter().sum();
    assert!((probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{what}: {probabilities:?}");
    let statistic: f64 = counts
        .iter()
        .zip(probabilities)
        .map(|(&count, probability)| {
            let expected = probability * total as f64;
            if expected == 0.0 {
                if count == 0 { 0.0 } else { f64::INFINITY }
            } else {
                (count as f64 - expected).powi(2) / expected
            }
        })
        .sum();
    let freedom = (counts.len() - 1) as f64;
    let limit = freedom + 4.75 * (2.0 * freedom).sqrt() + 16.0;
    assert!(
        statistic < limit,
        "{what}: {statistic} > {limit}, counts {counts:?}, expected {probabilities:?}"
    );
}

fn types_at(draws: &[DrawnTeams], place: impl Fn(&DrawnTeams) -> usize) -> [usize; 3] {
    let mut counts = [0; 3];
    draws.iter().for_each(|drawn| counts[place(drawn)] += 1);
    counts
}

#[test]
fn teams_are_independent_draws_but_not_of_exceptions_alone() {
    // Marine, marauder, medivac; a team of five medivacs is drawn again.
    let (_, drawn) = draws("terran_5_vs_5", 1);
    let all = 1.0 - 0.1f64.powi(5);
    let law = [0.45 / all, 0.45 / all, 0.1 * (1.0 - 0.1f64.powi(4)) / all];
    for place in 0..5 {
        check("type", &types_at(&drawn, |drawn| drawn.allies[place].unit_type), &law);
    }
    let mut medivacs = [0; 6];
    for teams in &drawn {
        medivacs[teams.allies.iter().filter(|unit| unit.unit_type == 2).count()] += 1;
        let types = |units: &[Drawn]| units.iter().map(|unit| unit.unit_type).collect::<Vec<_>>();
        assert_eq!(types(&teams.allies), types(&teams.enemies), "both teams are one list");
    }
    let choose = [1.0, 5.0, 10.0, 10.0, 5.0, 1.0];
    let of = |k: usize| choose[k] * 0.1f64.powi(k as i32) * 0.9f64.powi(5 - k as i32) / all;
    check("medivacs", &medivacs, &[of(0), of(1), of(2), of(3), of(4), 0.0]);
}

#[test]
fn a_single_further_enemy_is_never_an_exception() {
    let (_, drawn) = draws("zerg_10_vs_11", 2);
    // Zergling, baneling, hydralisk: 0.45, 0.1, 0.45.
    check("further", &types_at(&drawn, |drawn| drawn.enemies[10].unit_type), &[0.5, 0.0, 0.5]);
    let (_, drawn) = draws("protoss_10_vs_11", 3);
    check("further", &types_at(&drawn, |drawn| drawn.enemies[10].unit_type), &[0.45, 0.45, 0.1]);
}

#[test]
fn half_of_the_starts_are_reflected_and_half_surrounded() {
    let (_, drawn) = draws("protoss_5_vs_5", 4);
    let is_centre = |unit: &Drawn| unit.position == [16.0, 16.0];
    let (surrounded, reflected): (Vec<_>, Vec<_>) =
        drawn.iter().partition(|drawn| drawn.allies.iter().all(is_centre));
    check("kind", &[surrounded.len(), reflected.len()], &[0.5, 0.5]);

    // Reflected: uniform in the west half but one square, and mirrored.
    let (mut x, mut y) = ([0; 30], [0; 32]);
    for teams in &reflected {
        for (ally, enemy) in teams.allies.iter().zip(&teams.enemies) {
            let [ax, ay] = ally.position;
            (x[((ax * 2.0) as usize).min(29)], y[(ay as usize).min(31)]) =
                (x[((ax * 2.0) as usize).min(29)] + 1, y[(ay as usize).min(31)] + 1);
            assert_eq!(enemy.position, [32.0 - ax, ay]);
            assert_eq!((32.0 - ax) as f32, 32.0 - ax as f32, "also as the battle has it");
        }
    }
    check("x", &x, &[1.0 / 30.0; 30]);
    check("y", &y, &[1.0 / 32.0; 32]);

    // Surrounded: the number of points is that of the groups that are not empty.
    let (mut points, mut corners, mut way) = ([0; 4], [0; 4], [0; 14]);
    for teams in &surrounded {
        let mut places: Vec<_> = teams.enemies.iter().map(|unit| unit.position).collect();
        places.dedup();
        points[places.len() - 1] += 1;
        let [x, y] = teams.enemies[0].position;
        corners[usize::from(x > 16.0) + 2 * usize::from(y > 16.0)] += 1;
        let from_corner = x.min(32.0 - x);
        assert_eq!(from_corner, y.min(32.0 - y), "on a diagonal");
        way[(from_corner as usize).min(13)] += 1;
    }
    // Sum over G of 1/4 C(G, k) k! S(5, k) / G^5, with the Stirling numbers 1, 15, 25, 10 of the second kind.
    let of = |k: usize, stirling: f64| {
        let term = |g: usize| (0..k).map(|i| (g - i) as f64).product::<f64>() * stirling / (g as f64).powi(5);
        (k..=4).map(term).sum::<f64>() / 4.0
    };
    check("points", &points, &[of(1, 1.0), of(2, 15.0), of(3, 25.0), of(4, 10.0)]);
    check("corner", &corners, &[0.25; 4]);
    check("way", &way, &[1.0 / 14.0; 14]);
}

fn scenario(keys: &str) -> Scenario {
    let text = format!(
        r#"{{"name": "x", "num_allied_units": 3, "num_enemy_units": 3, {keys}, "terrain_preset": "FLAT",
            "num_unit_types": 0, "ally_has_shields": false, "enemy_has_shields": false}}"#
    );
    let files = ScenarioFiles { source: "x.json".into(), text, unit_files: Vec::new() };
    files.scenario().unwrap_or_else(|problems| panic!("{problems}"))
}

/// Shows each of so many draws, before and after the units got their places.
fn each_draw(scenario: &Scenario, seed: u64, episodes: usize, mut see: impl FnMut(&DrawnTeams, &DrawnTeams)) {
    let (drawer, mut share) = (Drawer::new(scenario).unwrap(), shares(seed));
    let (mut drawn, mut placed) = (DrawnTeams::default(), DrawnTeams::default());
    for _ in 0..episodes {
        drawer.draw(&mut share, &mut drawn);
        placed.clone_from(&drawn);
        drawer.place(&mut share, &mut placed);
        see(&drawn, &placed);
    }
}

fn units(drawn: &DrawnTeams) -> impl Iterator<Item = &Drawn> {
    drawn.allies.iter().chain(&drawn.enemies)
}

#[test]
fn all_teams_gives_every_multiset_equally_often() {
    let scenario = scenario(
        r#""teams": {"distribution": "all_teams", "unit_types": ["MARINE", "MARAUDER", "MEDIVAC"],
            "exception_unit_types": ["MEDIVAC"]}, "start_positions": {"distribution": "surrounded"}"#,
    );
    let mut counts = std::collections::BTreeMap::<Vec<usize>, usize>::new();
    each_draw(&scenario, 5, EPISODES, |drawn, _| {
        let mut team: Vec<_> = drawn.allies.iter().map(|unit| unit.unit_type).collect();
        team.sort_unstable();
        *counts.entry(team).or_default() += 1;
    });
    // Ten multisets of three of three types, less that of medivacs alone.
    assert_eq!(counts.len(), 9);
    check("multiset", &counts.values().copied().collect::<Vec<_>>(), &[1.0 / 9.0; 9]);
}

#[test]
fn fixed_teams_are_equally_probable_and_in_random_order() {
    let scenario = scenario(
        r#""teams": {"distribution": "fixed", "teams": [["MARINE", "MARINE", "MARAUDER"],
            ["ZEALOT", "ZEALOT", "ZEALOT"]]},
            "start_positions": {"distribution": "uniform",
                "allies": [1, 2, 3, 4], "enemies": [20, 0, 32, 1]}"#,
    );
    let mut first = [0; 3];
    each_draw(&scenario, 6, EPISODES, |drawn, _| {
        first[drawn.allies[0].unit_type] += 1;
        let within = |unit: &Drawn, [x0, y0, x1, y1]: [f64; 4]| {
            (x0..=x1).contains(&unit.position[0]) && (y0..=y1).contains(&unit.position[1])
        };
        assert!(drawn.allies.iter().all(|unit| within(unit, [1.0, 2.0, 3.0, 4.0])));
        assert!(drawn.enemies.iter().all(|unit| within(unit, [20.0, 0.0, 32.0, 1.0])));
    });
    check("first type", &first, &[1.0 / 3.0, 1.0 / 6.0, 0.5]);
}

fn assert_apart(scenario: &Scenario, drawn: &DrawnTeams) {
    let [width, height] = [scenario.terrain.width(), scenario.terrain.height()].map(f64::from);
    let name = &scenario.name;
    for (i, a) in units(drawn).enumerate() {
        let [x, y] = a.position;
        assert!((0.0..width).contains(&x) && (0.0..height).contains(&y), "{name}: {a:?}");
        for b in units(drawn).take(i) {
            let [a_type, b_type] = [a, b].map(|unit| &scenario.unit_types[unit.unit_type]);
            let distance = (x - b.position[0]).hypot(y - b.position[1]);
            let apart = distance >= a_type.radius() + b_type.radius() - 1e-9;
            assert!(apart || a_type.plane != b_type.plane, "{name}: {a:?} {b:?}");
        }
    }
}

#[test]
fn units_have_places_of_their_own_and_mirrored_teams_stay_mirrored() {
    for name in Scenario::generated_names() {
        let scenario = Scenario::standard(name).unwrap();
        each_draw(&scenario, 7, 300, |drawn, placed| {
            assert_apart(&scenario, placed);
            let is_reflected = drawn.allies[0].position[0] < 16.0;
            let crosses = placed.allies.iter().any(|unit| unit.position[0] > 14.5);
            if is_reflected && !crosses && placed.allies.len() == placed.enemies.len() {
                let mirror = |unit: &Drawn| (unit.unit_type, [32.0 - unit.position[0], unit.position[1]]);
                let mut mirrored: Vec<_> = placed.enemies.iter().map(mirror).collect();
                let mut allies: Vec<_> =
                    placed.allies.iter().map(|unit| (unit.unit_type, unit.position)).collect();
                let by_place = |a: &(usize, [f64; 2]), b: &(usize, [f64; 2])| a.partial_cmp(b).unwrap();
                mirrored.sort_by(by_place);
                allies.sort_by(by_place);
                assert_eq!(mirrored, allies, "{name}");
            }
            let type_and_x = |unit: &Drawn| (&scenario.unit_types[unit.unit_type].name, unit.position[0]);
            let are_numbered = placed.allies.iter().map(type_and_x).is_sorted();
            assert!(are_numbered, "{name}: numbers go by type, then from west to east");
        });
    }
}

#[test]
fn ground_units_start_on_walkable_squares() {
    // On a checkerboard no place is as wide as a unit.
    for preset in ["\"OCTAGON\"", "\"RAVINE\"", "\"CHECKERBOARD\""] {
        let start = r#""start_positions": {"distribution": "surrounded_and_reflect"}, "attack_point""#;
        let text = include_str!("../../../data/3s5z.json");
        let text = text.replace("\"attack_point\"", start).replace("\"SIMPLE\"", preset);
        let files = ScenarioFiles { source: "x.json".into(), text, unit_files: Vec::new() };
        let scenario = files.scenario().unwrap();
        each_draw(&scenario, 8, 300, |_, placed| {
            for unit in units(placed) {
                let [x, y] = unit.position;
                assert!(scenario.terrain.is_walkable(x as i64, y as i64), "{preset} {unit:?}");
            }
            let mut types: Vec<usize> = placed.allies.iter().map(|unit| unit.unit_type).collect();
            types.sort_unstable();
            assert_eq!(types, [0, 0, 0, 1, 1, 1, 1, 1], "the units are those of the groups");
        });
    }
}

/// A scenario on an open map, with so many units on each side.
fn on_map([width, height]: [usize; 2], starts: &str, n: usize, units: &str) -> Scenario {
    let rows = vec!["_".repeat(width); height];
    let text = format!(
        r#"{{"name": "{width} x {height}", "num_allied_units": {n}, "num_enemy_units": {n},
            "width": {width}, "height": {height}, "terrain": {rows:?},
            "start_positions": {{"distribution": "{starts}"}},
            {units}, "num_unit_types": 0, "ally_has_shields": false, "enemy_has_shields": false}}"#
    );
    let files = ScenarioFiles { source: "x.json".into(), text, unit_files: Vec::new() };
    files.scenario().unwrap_or_else(|problems| panic!("{problems}"))
}

/// In some of a thousand episodes units had no room, and began where others were.
#[test]
fn units_on_small_maps_never_overlap() {
    for (map, n, unit_type) in [([6, 4], 5, "ZEALOT"), ([6, 6], 2, "COLOSSUS"), ([3, 3], 2, "MARINE")] {
        for starts in ["reflect_position", "surrounded", "surrounded_and_reflect"] {
            let teams = format!(r#""teams": {{"distribution": "all_teams", "unit_types": ["{unit_type}"]}}"#);
            let scenario = on_map(map, starts, n, &teams);
            each_draw(&scenario, 9, 2000, |_, placed| assert_apart(&scenario, placed));
        }
    }
}

/// The ways from the corners were as long as on a wide map, so groups began off a narrow one.
#[test]
fn groups_are_on_maps_of_any_size() {
    let groups = r#""groups": [{"x": 0.5, "y": 0.5, "faction": "ALLY", "units": {"MEDIVAC": 1}},
        {"x": 0.5, "y": 0.5, "faction": "ENEMY", "units": {"MARINE": 1}}]"#;
    for [width, height] in [[1, 1], [3, 2], [2, 40]] {
        let scenario = on_map([width, height], "surrounded", 1, groups);
        each_draw(&scenario, 9, 300, |drawn, _| {
            for unit in &drawn.enemies {
                let [x, y] = unit.position;
                assert!((0.0..=width as f64).contains(&x) && (0.0..=height as f64).contains(&y), "{unit:?}");
            }
        });
    }
}
