//! The embedded unit files have the published stats.

use smaclite_units::{Attribute, CombatType, Keyword, Plane, Targeter, UnitType};

/// name, hp, shield, armor, damage, attacks, cooldown, speed, attack range, size
type Row = (&'static str, f64, f64, f64, f64, u32, f64, f64, f64, f64);

const STATS: [Row; 10] = [
    ("BANELING", 30.0, 0.0, 0.0, 80.0, 1, 1.0, 3.15, 0.25, 0.75),
    ("COLOSSUS", 200.0, 150.0, 1.0, 10.0, 2, 1.07, 3.15, 7.0, 2.0),
    ("HYDRALISK", 80.0, 0.0, 0.0, 12.0, 1, 0.59, 3.15, 5.0, 1.25),
    ("MARAUDER", 125.0, 0.0, 1.0, 10.0, 1, 1.07, 3.15, 6.0, 1.125),
    ("MARINE", 45.0, 0.0, 0.0, 6.0, 1, 0.61, 3.15, 5.0, 0.75),
    ("MEDIVAC", 150.0, 0.0, 1.0, 0.0, 1, 0.0, 3.5, 4.0, 1.5),
    ("SPINE_CRAWLER", 300.0, 0.0, 2.0, 25.0, 1, 1.32, 0.0, 7.0, 1.0),
    ("STALKER", 80.0, 80.0, 1.0, 13.0, 1, 1.34, 4.13, 6.0, 1.25),
    ("ZEALOT", 100.0, 50.0, 1.0, 8.0, 2, 0.86, 3.15, 0.1, 1.0),
    ("ZERGLING", 35.0, 0.0, 0.0, 5.0, 1, 0.497, 4.13, 0.1, 0.75),
];

fn standard(name: &str) -> UnitType {
    UnitType::standard(name).unwrap_or_else(|| panic!("{name} must be readable"))
}

#[test]
fn stats_of_every_type() {
    let found: Vec<Row> = UnitType::standard_names()
        .map(|name| {
            let t = standard(name);
            assert_eq!(t.name, name);
            let (range, size) = (t.attack_range, t.size);
            (name, t.hp, t.shield, t.armor, t.damage, t.attacks, t.cooldown, t.speed, range, size)
        })
        .collect();
    assert_eq!(found, STATS);
}

/// Checks one stat of all types: the named types have their value, all others the default.
fn check<T: PartialEq + std::fmt::Debug>(stat: impl Fn(&UnitType) -> T, default: T, others: &[(&str, T)]) {
    for name in UnitType::standard_names() {
        let expected = others.iter().find(|(other, _)| *other == name).map_or(&default, |(_, value)| value);
        assert_eq!(&stat(&standard(name)), expected, "{name}");
    }
}

#[test]
fn stats_of_a_few_types() {
    let zerg = ["BANELING", "HYDRALISK", "SPINE_CRAWLER", "ZERGLING"];
    let regenerating = zerg.map(|name| (name, 0.38));
    check(|t| t.hp_regen, 0.0, &regenerating);
    check(|t| (t.energy, t.initial_energy), (0.0, 0.0), &[("MEDIVAC", (200.0, 50.0))]);
    check(|t| t.minimum_scan_range, 5.0, &[("SPINE_CRAWLER", 10.0)]);
    check(|t| t.plane, Plane::Ground, &[("MEDIVAC", Plane::Air)]);
    check(|t| t.combat_type, CombatType::Damage, &[("MEDIVAC", CombatType::Healing)]);
    let armored = |bonus| vec![(Attribute::Armored, bonus)];
    let bonuses = [
        ("COLOSSUS", vec![(Attribute::Light, 5.0)]),
        ("MARAUDER", armored(10.0)),
        ("SPINE_CRAWLER", armored(5.0)),
        ("STALKER", armored(5.0)),
    ];
    check(|t| t.bonuses.clone(), vec![], &bonuses);
    let targeters = [
        ("BANELING", Targeter::Kamikaze { radius: 2.2 }),
        ("COLOSSUS", Targeter::LaserBeam { width: 2.8, height: 0.3 }),
        ("MEDIVAC", Targeter::Heal),
    ];
    check(|t| t.targeter, Targeter::Standard, &targeters);
}

#[test]
fn planes_and_attributes_of_every_type() {
    let attackable = |t: &UnitType| [Plane::Ground, Plane::Air, Plane::Colossus].map(|p| t.can_attack(p));
    let shooters = ["HYDRALISK", "MARINE", "STALKER"].map(|name| (name, [true; 3]));
    check(attackable, [true, false, true], &shooters);
    let attributes = |t: &UnitType| {
        let all = Attribute::KEYWORDS.iter().filter(|(_, attribute)| t.attributes.contains(*attribute));
        all.map(|(keyword, _)| *keyword).collect::<Vec<_>>().join(" ")
    };
    let expected = [
        ("BANELING", "BIOLOGICAL"),
        ("COLOSSUS", "ARMORED MASSIVE MECHANICAL"),
        ("MARAUDER", "ARMORED BIOLOGICAL"),
        ("MEDIVAC", "ARMORED MECHANICAL"),
        ("SPINE_CRAWLER", "ARMORED BIOLOGICAL STRUCTURE"),
        ("STALKER", "ARMORED MECHANICAL"),
    ]
    .map(|(name, attributes)| (name, attributes.to_owned()));
    check(attributes, "LIGHT BIOLOGICAL".to_owned(), &expected);
}

#[test]
fn bonuses_add_up() {
    let mut hunter = standard("MARAUDER");
    hunter.bonuses.push((Attribute::Biological, 1.5));
    assert_eq!(hunter.damage_against(&standard("MARINE")), 11.5);
    assert_eq!(hunter.damage_against(&hunter), 21.5);
    assert_eq!(standard("ZEALOT").damage_against(&hunter), 8.0);
}

#[test]
fn an_unknown_name_is_no_standard_type() {
    assert_eq!(UnitType::standard("marine"), None);
}
