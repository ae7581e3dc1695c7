//! Pictures of the standard scenarios, and what they show.

use glam::Vec2;
use smaclite_scenarios::{Faction, Placement, Scenario};
use smaclite_units::Plane;
use smaclite_view::{Moment, Options, Picture, Renderer, Theme, View};

use crate::kit::*;

/// Points on a unit's body, closer to its centre than its rims.
fn on_body(centre: Vec2, radius: f32) -> impl Iterator<Item = Vec2> {
    let angles = (0..16).map(|i| Vec2::from_angle(std::f32::consts::TAU * i as f32 / 16.0));
    angles.flat_map(move |direction| [0.35, 0.5, 0.7].map(|share| centre + direction * (share * radius)))
}

/// Whether a flying unit covers the centre of another unit.
fn is_covered(scenario: &Scenario, moment: &Moment, id: usize) -> bool {
    scenario.units.iter().zip(&moment.units).enumerate().any(|(other, (unit, state))| {
        let unit_type = &scenario.unit_types[unit.unit_type];
        let is_near = state.pos.distance(moment.units[id].pos) < unit_type.size as f32;
        other != id && state.alive && unit_type.plane == Plane::Air && is_near
    })
}

fn check_units_visible(scenario: &Scenario, renderer: &Renderer, moments: &[Moment]) {
    let (picture, now) = (renderer.render_recent(moments), moments.last().unwrap());
    for (id, (unit, state)) in scenario.units.iter().zip(&now.units).enumerate() {
        if state.alive && !is_covered(scenario, now, id) {
            let (at, radius) = (renderer.pixel_of(state.pos), renderer.radius_of(id).unwrap());
            let hits = on_body(at, radius)
                .filter(|&point| faction_at(&picture, point) == Some(unit.faction))
                .count();
            let name = &scenario.name;
            assert!(hits >= 4, "{name}: unit {id} at {at} is hardly visible in tick {}: {hits}", now.tick);
        }
    }
}

#[test]
fn units_of_all_standard_scenarios_are_visible() {
    for name in Scenario::standard_names() {
        let scenario = standard(name);
        let moments = play(&scenario, 16);
        for theme in [Theme::Dark, Theme::Light] {
            let renderer = Renderer::new(&scenario, Options { theme, ..size(768, 512) }).unwrap();
            for end in [1, moments.len() / 2, moments.len()] {
                check_units_visible(&scenario, &renderer, &moments[..end]);
            }
        }
    }
}

#[test]
fn equal_moments_give_equal_bytes() {
    for name in Scenario::standard_names() {
        let scenario = standard(name);
        let moments = play(&scenario, 12);
        let all = marked(size(160, 120));
        let first = render(&scenario, all, &moments);
        assert_eq!(first, render(&scenario, all, &moments.clone()), "{name}");
        let renderer = Renderer::new(&scenario, all).unwrap();
        renderer.render(&moments[0]);
        assert_eq!(first, renderer.render_recent(&moments), "{name}: pictures leave no trace");
    }
}

#[test]
fn only_recent_moments_matter() {
    let scenario = standard("bane_vs_bane");
    let moments = play(&scenario, 12);
    let recent = &moments[moments.len() - 1 - smaclite_view::RECENT_TICKS..];
    assert_eq!(render(&scenario, size(128, 128), &moments), render(&scenario, size(128, 128), recent));
    let now = &moments[moments.len() - 1..];
    assert_ne!(render(&scenario, size(128, 128), &moments), render(&scenario, size(128, 128), now));
}

#[test]
fn every_option_changes_the_picture() {
    let scenario = standard("MMM");
    let moments = play(&scenario, 10);
    let draw = |options: Options| render(&scenario, options, &moments);
    let plain = size(256, 256);
    assert_all_differ(&[
        draw(plain),
        draw(Options { show_sight: true, ..plain }),
        draw(Options { show_range: true, ..plain }),
        draw(Options { show_targets: true, ..plain }),
        draw(Options { show_ids: true, ..plain }),
        draw(Options { theme: Theme::Light, ..plain }),
        draw(Options { view: View::around(&scenario, &moments, 1.0), ..plain }),
        render(&scenario, plain, &[]),
    ]);
}

/// One ally in the west and one enemy in the east, with a scale of 32 pixels per square.
fn duel() -> (Scenario, Renderer) {
    let units = [
        (Faction::Ally, unit_type("ZEALOT"), [3.5, 4.5]),
        (Faction::Enemy, unit_type("ZEALOT"), [11.5, 4.5]),
    ];
    let scenario = open_field(15, 9, &units);
    let renderer = Renderer::new(&scenario, size(512, 320)).unwrap();
    (scenario, renderer)
}

#[test]
fn factions_differ_in_shape() {
    let (scenario, renderer) = duel();
    let moment = start(&scenario);
    let picture = renderer.render(&moment);
    let above = |id: usize| {
        let outside = Vec2::new(0.0, -1.05 * renderer.radius_of(id).unwrap());
        picture.pixel_at(renderer.pixel_of(moment.units[id].pos) + outside)
    };
    // The northern corner of a hexagon is outside the disc of the unit.
    let floor = picture.pixel_at(renderer.pixel_of(Vec2::new(7.3, 2.3)));
    assert_eq!(above(0), floor);
    assert_ne!(above(1), floor);
}

#[test]
fn health_is_the_filled_part_of_a_body() {
    let (scenario, renderer) = duel();
    let mut moment = start(&scenario);
    let brightness = |picture: &Picture, side: f32| {
        let at = renderer.pixel_of(moment_position(&scenario)) + Vec2::new(-0.1, side * 0.62) * 16.0;
        picture.pixel_at(at).map(u32::from).iter().sum::<u32>()
    };
    let full = renderer.render(&moment);
    moment.units[0].hp /= 2.0;
    let half = renderer.render(&moment);
    moment.units[0].hp = 0.0;
    let empty = renderer.render(&moment);
    let (above, below) = (-1.0, 1.0);
    assert!(brightness(&half, above) < brightness(&full, above));
    assert_eq!(brightness(&half, below), brightness(&full, below));
    assert!(brightness(&empty, below) < brightness(&full, below));
}

fn moment_position(scenario: &Scenario) -> Vec2 {
    let [x, y] = scenario.units[0].position;
    Vec2::new(x as f32, y as f32)
}

trait PixelAt {
    fn pixel_at(&self, at: Vec2) -> [u8; 3];
}

impl PixelAt for Picture {
    fn pixel_at(&self, at: Vec2) -> [u8; 3] {
        self.pixel(at.x as u32, at.y as u32).unwrap()
    }
}

#[test]
fn values_and_deaths_are_visible() {
    let (scenario, renderer) = duel();
    let alive = start(&scenario);
    let change = |change: fn(&mut Moment)| {
        let mut moment = alive.clone();
        change(&mut moment);
        renderer.render(&moment)
    };
    assert_all_differ(&[
        renderer.render(&alive),
        change(|moment| moment.units[0].shield /= 2.0),
        change(|moment| moment.units[0].cooldown = 0.3),
        change(|moment| moment.units[0].facing = 2.0),
        change(|moment| moment.units[0].alive = false),
    ]);
    let mut dead = alive.clone();
    dead.units[0].alive = false;
    let fresh = renderer.render_recent(&[alive, dead.clone()]);
    assert_ne!(fresh, renderer.render(&dead), "a death fades");
}

#[test]
fn north_is_up_and_pixels_map_back() {
    let (scenario, renderer) = duel();
    let origin = renderer.pixel_of(Vec2::ZERO);
    assert!(renderer.pixel_of(Vec2::new(0.0, 1.0)).y < origin.y);
    assert!(renderer.pixel_of(Vec2::new(1.0, 0.0)).x > origin.x);
    for unit in &start(&scenario).units {
        assert!(renderer.square_at(renderer.pixel_of(unit.pos)).abs_diff_eq(unit.pos, 1e-4));
    }
}

/// An animation of a map of 24 x 20 squares showed 125 rows of pixels below its south edge, because the units
/// were near it.
#[test]
fn a_picture_ends_where_the_map_does() {
    let zealots = |x: f64, y: f64| {
        [(Faction::Ally, unit_type("ZEALOT"), [x, y]), (Faction::Enemy, unit_type("ZEALOT"), [x + 8.0, y])]
    };
    let corners = |scenario: &Scenario, view: View, pixels: Vec2| {
        let options = Options { view, ..size(pixels.x as u32, pixels.y as u32) };
        let renderer = Renderer::new(scenario, options).unwrap();
        let (north_west, south_east) = (renderer.square_at(Vec2::ZERO), renderer.square_at(pixels));
        (Vec2::new(north_west.x, south_east.y), Vec2::new(south_east.x, north_west.y))
    };
    let square = Vec2::splat(512.0);
    for (x, y) in [(2.0, 2.0), (12.0, 18.0), (7.0, 10.0)] {
        let scenario = open_field(24, 20, &zealots(x, y));
        let (min, max) = corners(&scenario, View::around(&scenario, [&start(&scenario)], 2.0), square);
        let rounding = 0.05; // squares have whole pixels in the middle of the picture
        assert!(min.cmpge(Vec2::splat(-rounding)).all(), "{x} {y}: from {min}");
        assert!(max.cmple(Vec2::new(24.0, 20.0) + rounding).all(), "{x} {y}: to {max}");
        for Placement { position: [x, y], .. } in &scenario.units {
            let unit = Vec2::new(*x as f32, *y as f32);
            assert!(unit.cmpgt(min + 1.0).all() && unit.cmplt(max - 1.0).all(), "{unit}: {min} to {max}");
        }
    }
    // A map that does not fill the picture is in its middle.
    let scenario = open_field(24, 20, &zealots(2.0, 2.0));
    for view in [View::Battlefield, View::Map] {
        let (min, max) = corners(&scenario, view, square);
        assert!((min + max).abs_diff_eq(Vec2::new(24.0, 20.0), 0.1), "{view:?}: {min} to {max}");
    }
    // What is asked for is shown, also beyond the map.
    let view = View::Squares { min: Vec2::new(-6.0, 4.0), max: Vec2::new(2.0, 12.0) };
    let (min, max) = corners(&scenario, view, square);
    assert!(min.abs_diff_eq(Vec2::new(-6.0, 4.0), 0.05) && max.abs_diff_eq(Vec2::new(2.0, 12.0), 0.05));
}

/// One small picture, compared exactly. Run with the environment variable `UPDATE_GOLDEN` to accept a new
/// one.
#[test]
fn the_golden_picture_is_unchanged() {
    let scenario = standard("MMM");
    let moments = play(&scenario, 9);
    let view = View::around(&scenario, &moments[60..], 1.0);
    let picture = render(&scenario, Options { view, ..size(192, 96) }, &moments);
    let mut png = Vec::new();
    picture.write_png(&mut png).unwrap();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/MMM.png");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(path, &png).unwrap();
    }
    let golden = crate::animations::png_pixels(&std::fs::read(path).unwrap_or_default());
    if golden.as_deref() != Some(picture.rgb()) {
        let actual = concat!(env!("CARGO_TARGET_TMPDIR"), "/MMM.png");
        std::fs::write(actual, &png).unwrap();
        panic!("the picture differs from {path}: see {actual}");
    }
}
