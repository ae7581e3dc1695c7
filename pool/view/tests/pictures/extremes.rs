//! Sizes, maps and moments at the limits.

use glam::Vec2;
use smaclite_scenarios::{Faction, MAX_SIDE, Scenario, Terrain};
use smaclite_units::UnitType;
use smaclite_view::{Attack, AttackKind, Moment, Options, Picture, Renderer, SizeError, Theme, View};

use crate::kit::*;

#[test]
fn every_size_from_the_smallest_to_large() {
    for name in ["2s3z", "corridor"] {
        let scenario = standard(name);
        let moments = play(&scenario, 9);
        for side in [16, 17, 31, 64, 100, 333, 1024, 2048] {
            for (width, height) in [(side, side), (side, 16), (16, side)] {
                let picture = render(&scenario, size(width, height), &moments);
                assert_eq!((picture.width(), picture.height()), (width, height));
                assert_eq!(picture.rgb().len(), (width * height * 3) as usize);
                let empty = render(&scenario, size(width, height), &[]);
                assert_ne!(picture, empty, "{name}: no unit is visible at {width} x {height}");
            }
        }
    }
}

#[test]
fn sizes_beyond_the_limits_are_errors() {
    for (width, height) in [(15, 64), (64, 0), (4097, 64), (64, u32::MAX)] {
        let error = Renderer::new(&standard("3m"), size(width, height)).unwrap_err();
        assert_eq!(error, SizeError { width, height, max_side: Picture::MAX_SIDE });
        let got = format!("between 16 and 4096 pixels, got {width} x {height}");
        assert!(error.to_string().ends_with(&got), "{error}");
    }
}

/// Draws the start of a scenario in all views and themes, with everything optional.
fn check_drawable(scenario: &Scenario) {
    let moment = start(scenario);
    let views = [View::Battlefield, View::Map, View::around(scenario, [&moment], 0.0)];
    let themes = [Theme::Dark, Theme::Light];
    for (view, theme) in views.into_iter().flat_map(|view| themes.map(|theme| (view, theme))) {
        let plain = Options { view, theme, ..size(300, 200) };
        for options in [plain, marked(plain)] {
            let units = render(scenario, options, std::slice::from_ref(&moment));
            assert_ne!(units, render(scenario, options, &[]), "{options:?}: no units");
        }
    }
}

/// Two units and a map of these squares.
fn on_terrain(width: u32, height: u32, walkable: impl Fn(u32, u32) -> bool) -> Scenario {
    let end = [f64::from(width) - 0.5, f64::from(height) - 0.5];
    let marine = || unit_type("MARINE");
    let units = [(Faction::Ally, marine(), [0.25, 0.5]), (Faction::Enemy, marine(), end)];
    let squares = (0..width * height).map(|i| walkable(i % width, i / width)).collect();
    Scenario { terrain: Terrain::new(width, height, squares).unwrap(), ..open_field(width, height, &units) }
}

#[test]
fn the_smallest_and_largest_maps() {
    for (width, height) in [(1, 1), (1, MAX_SIDE), (MAX_SIDE, 1), (MAX_SIDE, MAX_SIDE), (2, 3)] {
        check_drawable(&on_terrain(width, height, |_, _| true));
        check_drawable(&on_terrain(width, height, |_, _| false));
        check_drawable(&on_terrain(width, height, |x, y| (x + y) % 2 == 0));
    }
}

#[test]
fn floor_and_blocked_squares_differ() {
    // A ring of floor around a blocked square, one loop inside another.
    let scenario = on_terrain(3, 3, |x, y| (x, y) != (1, 1));
    for side in [16, 90, 900] {
        let renderer = Renderer::new(&scenario, size(side, side)).unwrap();
        let picture = renderer.render_recent(&[]);
        let colour = |x: f32, y: f32| {
            let at = renderer.pixel_of(Vec2::new(x, y));
            picture.pixel(at.x as u32, at.y as u32).unwrap()
        };
        for (x, y) in [(0.5, 0.5), (0.5, 1.5), (1.5, 2.5), (2.5, 0.5)] {
            assert_eq!(colour(x, y), colour(2.5, 2.5), "square {x}, {y} at {side} pixels");
        }
        assert_ne!(colour(1.5, 1.5), colour(2.5, 2.5), "the blocked square at {side} pixels");
    }
}

#[test]
fn a_thousand_units() {
    let names = ["MARINE", "MEDIVAC", "COLOSSUS", "BANELING", "STALKER"];
    let faction = |i: usize| if i.is_multiple_of(2) { Faction::Ally } else { Faction::Enemy };
    let position = |i: usize| [1.0 + (i % 40) as f64 * 1.5, 1.0 + (i / 40) as f64 * 1.5];
    let units: Vec<(Faction, UnitType, [f64; 2])> =
        (0..1000).map(|i| (faction(i), unit_type(names[i % names.len()]), position(i))).collect();
    check_drawable(&open_field(64, 40, &units));
}

#[test]
fn tiny_and_huge_units_of_any_name() {
    let typed = |name: &str, size: f64| UnitType { name: name.into(), size, ..unit_type("MARINE") };
    for diameter in [1e-6, 1024.0] {
        let units = [
            (Faction::Ally, typed("\u{1f600}", diameter), [5.5, 5.5]),
            (Faction::Enemy, typed("", diameter), [9.5, 9.5]),
        ];
        check_drawable(&open_field(16, 16, &units));
    }
}

#[test]
fn moments_that_no_battle_has() {
    let scenario = standard("2s3z");
    let whole = start(&scenario);
    let renderer = Renderer::new(&scenario, Options { show_range: true, ..size(64, 64) }).unwrap();
    let attacks = |kind| vec![Attack { by: 0, on: 99, kind }, Attack { by: u32::MAX, on: 0, kind }];
    assert_eq!(renderer.render(&Moment::default()), renderer.render_recent(&[]), "a moment without units");
    let unknown =
        renderer.render(&Moment { attacks: attacks(AttackKind::Shot { flight: 0 }), ..whole.clone() });
    assert_eq!(unknown, renderer.render(&whole), "attacks by and on units that do not exist");
    let enemy = whole.units.len() - 1;
    let enemy_at = renderer.pixel_of(whole.units[enemy].pos);
    assert_eq!(faction_at(&renderer.render(&whole), enemy_at), Some(Faction::Enemy));
    for value in [f32::NAN, f32::INFINITY, -1e30, 0.0] {
        let kinds = [
            AttackKind::Shot { flight: 0 },
            AttackKind::Shot { flight: 9 },
            AttackKind::Heal,
            AttackKind::Beam { width: value, height: value },
            AttackKind::Explosion { radius: value },
        ];
        let mut moment = whole.clone();
        let unit = &mut moment.units[0];
        (unit.pos, unit.facing, unit.target) = (Vec2::splat(value), value, Some(77));
        (unit.hp, unit.shield, unit.energy, unit.cooldown) = (value, value, value, value);
        let picture = renderer.render(&moment);
        assert_eq!(
            faction_at(&picture, enemy_at),
            Some(Faction::Enemy),
            "another unit, beside one at {value}"
        );
        moment.attacks = kinds.map(|kind| Attack { by: 0, on: 1, kind }).into();
        renderer.render(&moment);
        let view = View::Squares { min: Vec2::splat(value), max: Vec2::splat(-value) };
        render(&scenario, Options { view, ..size(64, 64) }, &[moment]);
    }
}
