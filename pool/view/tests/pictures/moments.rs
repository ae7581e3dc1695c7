//! What moments say of a battle.

use smaclite_scenarios::{Faction, Scenario};
use smaclite_units::UnitType;
use smaclite_view::{AttackKind, Moment};

use crate::kit::*;

/// Every loss of health or shield must have an attack that explains it.
fn check_losses(scenario: &Scenario, moments: &[Moment]) {
    for pair in moments.windows(2) {
        let [before, now] = pair else { continue };
        assert_eq!(now.tick, before.tick + 1);
        for (id, (old, new)) in before.units.iter().zip(&now.units).enumerate() {
            let lost = new.hp < old.hp || new.shield < old.shield;
            let is_explained = now.attacks.iter().any(|attack| match attack.kind {
                AttackKind::Shot => attack.on as usize == id,
                AttackKind::Beam { .. } => {
                    scenario.units[attack.by as usize].faction != scenario.units[id].faction
                }
                AttackKind::Explosion { .. } => {
                    let by = attack.by as usize;
                    by == id || scenario.units[by].faction != scenario.units[id].faction
                }
                AttackKind::Heal => false,
            });
            let (name, tick) = (&scenario.name, now.tick);
            assert!(!lost || is_explained, "{name}: unit {id} lost health in tick {tick}");
        }
    }
}

#[test]
fn attacks_explain_all_losses() {
    for name in Scenario::standard_names() {
        let scenario = standard(name);
        check_losses(&scenario, &play(&scenario, 60));
    }
}

#[test]
fn units_without_a_cooldown_attack_in_every_tick() {
    let rapid = UnitType { cooldown: 0.0, ..unit_type("MARINE") };
    let units = [(Faction::Ally, rapid.clone(), [3.5, 4.5]), (Faction::Enemy, rapid, [6.5, 4.5])];
    let scenario = open_field(12, 9, &units);
    let moments = play(&scenario, 1);
    check_losses(&scenario, &moments);
    assert!(moments[1..4].iter().all(|moment| moment.attacks.len() == 2), "{moments:?}");
}

#[test]
fn only_living_units_attack_and_they_face_their_targets() {
    for name in ["MMM2", "1c3s5z", "bane_vs_bane", "6h_vs_8z"] {
        let moments = play(&standard(name), 60);
        assert!(moments.iter().any(|moment| !moment.attacks.is_empty()), "{name}");
        for pair in moments.windows(2) {
            for attack in &pair[1].attacks {
                let (by, on) = (&pair[1].units[attack.by as usize], &pair[1].units[attack.on as usize]);
                assert!(pair[0].units[attack.by as usize].alive, "{name}: {attack:?}");
                let towards = (on.pos - by.pos).normalize_or_zero();
                let facing = glam::Vec2::from_angle(by.facing);
                assert!(towards.dot(facing) > 0.999 || towards == glam::Vec2::ZERO, "{name}: {attack:?}");
            }
        }
    }
}

#[test]
fn units_that_are_shot_do_not_explode() {
    let units = [
        (Faction::Ally, unit_type("COLOSSUS"), [1.5, 4.5]),
        (Faction::Enemy, unit_type("BANELING"), [8.5, 4.5]),
    ];
    let moments = play(&open_field(12, 9, &units), 20);
    let kinds = || moments.iter().flat_map(|moment| &moment.attacks).map(|attack| attack.kind);
    assert!(!moments.last().unwrap().units[1].alive, "{moments:?}");
    assert!(kinds().all(|kind| matches!(kind, AttackKind::Beam { .. })));
    let moments = play(&standard("so_many_baneling"), 60);
    let kinds = || moments.iter().flat_map(|moment| &moment.attacks).map(|attack| attack.kind);
    assert!(kinds().any(|kind| matches!(kind, AttackKind::Explosion { .. })));
}

#[test]
fn units_face_their_opponents_at_the_start() {
    let moment = start(&standard("3m"));
    for (unit, placement) in moment.units.iter().zip(&standard("3m").units) {
        let expected = if placement.faction == Faction::Ally { 1.0 } else { -1.0 };
        assert!(unit.facing.cos() * expected > 0.9, "{unit:?}");
    }
}
