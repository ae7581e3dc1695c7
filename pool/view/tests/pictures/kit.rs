//! Battles to draw, and colours of pictures.

use std::sync::Arc;

use glam::Vec2;
use smaclite_engine::{Arena, Battle, ExecutionOrder, Rules, Scratch, policy};
use smaclite_scenarios::{Faction, Placement, Scenario, Terrain};
use smaclite_units::UnitType;
use smaclite_view::{Moment, Observer, Options, Picture, Renderer};

/// The moments of an episode that the nearest-enemy policy plays, at most `steps` steps.
pub fn play(scenario: &Scenario, steps: usize) -> Vec<Moment> {
    play_by(Rules::Smaclite, scenario, steps)
}

/// The same by other rules.
pub fn play_by(rules: Rules, scenario: &Scenario, steps: usize) -> Vec<Moment> {
    let mut battle = Battle::new(Arc::new(Arena::new(scenario, rules)), 1);
    let mut observer = Observer::new(scenario, &battle);
    let mut moments = vec![observer.moment().clone()];
    let mut scratch = Scratch::new();
    let mut actions = vec![0; scenario.n_agents()];
    for _ in 0..steps {
        if battle.is_over() {
            break;
        }
        policy::nearest(&battle, &mut actions);
        let observe = |tick: smaclite_engine::Tick<'_>| moments.push(observer.observe(tick.units).clone());
        battle.step_observed(&actions, ExecutionOrder::Drawn, &mut scratch, observe).unwrap();
    }
    moments
}

pub fn standard(name: &str) -> Scenario {
    Scenario::standard(name).unwrap()
}

/// A scenario on an open map.
pub fn open_field(width: u32, height: u32, units: &[(Faction, UnitType, [f64; 2])]) -> Scenario {
    let placement = |(i, (faction, _, position)): (usize, &(Faction, UnitType, [f64; 2]))| {
        let id_in_faction = units[..i].iter().filter(|(other, ..)| other == faction).count();
        Placement { unit_type: i, faction: *faction, id_in_faction, position: *position, centre: *position }
    };
    Scenario {
        name: "open field".into(),
        terrain: Terrain::new(width, height, vec![true; (width * height) as usize]).unwrap(),
        unit_types: units.iter().map(|(_, unit_type, _)| unit_type.clone()).collect(),
        units: units.iter().enumerate().map(placement).collect(),
        type_ids: vec![0; units.len()],
        ..standard("3m")
    }
}

pub fn unit_type(name: &str) -> UnitType {
    UnitType::standard(name).unwrap()
}

/// The start of a scenario's battles.
pub fn start(scenario: &Scenario) -> Moment {
    play(scenario, 0).remove(0)
}

pub fn size(width: u32, height: u32) -> Options {
    Options { width, height, ..Options::default() }
}

/// The same options, and all marks.
pub fn marked(options: Options) -> Options {
    Options { show_sight: true, show_range: true, show_targets: true, show_ids: true, ..options }
}

pub fn assert_all_differ(pictures: &[Picture]) {
    for (i, picture) in pictures.iter().enumerate() {
        assert!(!pictures[..i].contains(picture), "picture {i} equals an earlier one");
    }
}

pub fn render(scenario: &Scenario, options: Options, moments: &[Moment]) -> Picture {
    Renderer::new(scenario, options).unwrap().render_recent(moments)
}

/// The faction whose colour is at a point of a picture.
pub fn faction_at(picture: &Picture, pixel: Vec2) -> Option<Faction> {
    let pixel = pixel.floor();
    if pixel.min_element() < 0.0 {
        return None;
    }
    let [red, _, blue] = picture.pixel(pixel.x as u32, pixel.y as u32)?.map(i32::from);
    match red - blue {
        ..-45 => Some(Faction::Ally),
        46.. => Some(Faction::Enemy),
        _ => None,
    }
}
