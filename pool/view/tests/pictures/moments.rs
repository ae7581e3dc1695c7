//! What moments say of a battle.

use smaclite_engine::Rules;
use smaclite_scenarios::{Faction, Scenario};
use smaclite_units::UnitType;
use smaclite_view::{Attack, AttackKind, Moment};

use crate::kit::*;

/// Every loss of health or shield must have an attack that explains it.
fn check_losses(scenario: &Scenario, moments: &[Moment]) {
    for pair in moments.windows(2) {
        let [before, now] = pair else { continue };
        assert_eq!(now.tick, before.tick + 1);
        for (id, (old, new)) in before.units.iter().zip(&now.units).enumerate() {
            let lost = new.hp < old.hp || new.shield < old.shield;
            let is_explained = now.attacks.iter().any(|attack| match attack.kind {
                AttackKind::Shot { .. } => attack.on as usize == id,
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

/// Under `starcraft` a stalker's hit comes when its projectile arrives, which was seen to be fired that many
/// ticks before.
#[test]
fn projectiles_arrive_when_they_hit() {
    let units = [
        (Faction::Ally, unit_type("STALKER"), [1.5, 4.5]),
        (Faction::Enemy, unit_type("SPINE_CRAWLER"), [7.5, 4.5]),
    ];
    let moments = play_by(Rules::Starcraft, &open_field(12, 9, &units), 20);
    let vitality = |tick: usize, unit: usize| moments[tick].units[unit].hp + moments[tick].units[unit].shield;
    let mut n_hits = 0;
    for moment in &moments {
        for attack in &moment.attacks {
            let AttackKind::Shot { flight } = attack.kind else { panic!("{attack:?}") };
            assert!(flight > 0, "{attack:?}");
            let (lands, on) = (moment.tick as usize + usize::from(flight), attack.on as usize);
            if lands < moments.len() && moments[lands - 1].units[on].alive {
                assert!(vitality(lands, on) < vitality(lands - 1, on), "{attack:?} in tick {}", moment.tick);
                n_hits += 1;
            }
        }
    }
    assert!(n_hits > 5, "{n_hits}");
}

/// A cooldown that begins is not yet an attack under `starcraft`: its damage point is.
#[test]
fn attacks_with_phases_explain_the_losses() {
    for name in ["3m", "2m_vs_1z"] {
        let scenario = standard(name);
        let moments = play_by(Rules::Starcraft, &scenario, 60);
        let struck =
            |tick: usize, unit: usize| moments[tick].attacks.iter().any(|attack| attack.on as usize == unit);
        let mut n_losses = 0;
        for (tick, pair) in moments.windows(2).enumerate() {
            for (unit, (old, new)) in pair[0].units.iter().zip(&pair[1].units).enumerate() {
                if new.hp < old.hp {
                    n_losses += 1;
                    // A zealot's second blow comes five ticks after its first.
                    let from = if name == "3m" { tick + 1 } else { (tick + 1).saturating_sub(5) };
                    assert!((from..=tick + 1).any(|tick| struck(tick, unit)), "{name}: {unit} in {tick}");
                }
            }
        }
        assert!(n_losses > 3, "{name}");
    }
}

#[test]
fn units_that_explode_when_killed_are_seen_to() {
    let units = [
        (Faction::Ally, unit_type("MARAUDER"), [1.5, 4.5]),
        (Faction::Enemy, unit_type("BANELING"), [8.5, 4.5]),
    ];
    let moments = play_by(Rules::Starcraft, &open_field(12, 9, &units), 20);
    let killed = moments.iter().find(|moment| !moment.units[1].alive).expect("the marauder shoots it");
    assert!(matches!(killed.attacks[..], [Attack { kind: AttackKind::Explosion { .. }, .. }]), "{killed:?}");
}

#[test]
fn units_face_their_opponents_at_the_start() {
    let moment = start(&standard("3m"));
    for (unit, placement) in moment.units.iter().zip(&standard("3m").units) {
        let expected = if placement.faction == Faction::Ally { 1.0 } else { -1.0 };
        assert!(unit.facing.cos() * expected > 0.9, "{unit:?}");
    }
}
