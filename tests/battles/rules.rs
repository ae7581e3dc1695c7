//! Rules that recorded battles seldom or never exercise, in battles of a few units.

use glam::Vec2;
use smaclite_engine::{Battle, ExecutionOrder, Faction, Rules, Scratch, Snapshot, TICKS_PER_STEP, action};

use crate::few_units::few_units;

const STOP: i32 = action::STOP as i32;
const TARGET: i32 = action::FIRST_TARGET as i32;

/// A battle of a few units without obstacles. Units are given as in a scenario file: `"MARINE": 2`.
struct Setting {
    battle: Battle,
    snapshot: Snapshot,
}

impl Setting {
    fn new(rules: Rules, allies: &str, enemies: &str) -> Setting {
        let battle = few_units(rules, allies, enemies);
        Setting { snapshot: battle.save(), battle }
    }

    fn place(&mut self, unit: usize, x: f32, y: f32) -> &mut Setting {
        self.snapshot.units.pos[unit] = Vec2::new(x, y);
        self
    }

    /// Plays one step, with units acting by ascending id or in another order; returns the battle after its
    /// first tick.
    fn play(&mut self, actions: &[i32], order: Option<&[u32]>) -> FirstTick {
        self.battle.restore(&self.snapshot).expect("a snapshot of this battle");
        let ids: Vec<u32> = (0..self.snapshot.units.hp.len() as u32).collect();
        let orders = [order.unwrap_or(&ids); TICKS_PER_STEP];
        let mut first = None;
        let order = ExecutionOrder::Given(&orders);
        let step = self.battle.step_observed(actions, order, &mut Scratch::new(), |tick| {
            first.get_or_insert_with(|| FirstTick {
                units: tick.units.clone(),
                preferred: tick.preferred.to_vec(),
                earned: tick.earned,
            });
        });
        step.expect("legal actions");
        first.expect("a step has ticks")
    }
}

struct FirstTick {
    units: smaclite_engine::Units,
    preferred: Vec<Vec2>,
    earned: f64,
}

/// R1: with a target that is not a healer, while an agent is a living healer out of sight.
#[test]
fn r1_a_unit_with_a_target_switches_to_a_nearer_one_only_under_smaclite() {
    for (rules, target) in [(Rules::Smaclite, 2), (Rules::Paper, 1)] {
        let mut setting = Setting::new(rules, r#""MEDIVAC": 1, "MARINE": 2"#, r#""MARINE": 1"#);
        setting.place(0, 2.0, 16.0).place(1, 18.0, 16.0).place(2, 20.0, 16.0).place(3, 22.0, 16.0);
        setting.snapshot.units.target[3] = Some(1);
        let after = setting.play(&[STOP; 3], None);
        assert_eq!(after.units.target[3], Some(target), "{rules}");
    }
}

/// R1: healers are attacked first under both rule sets, at any distance.
#[test]
fn r1_healers_come_first() {
    for rules in [Rules::Smaclite, Rules::Paper] {
        let mut setting = Setting::new(rules, r#""MEDIVAC": 1, "MARINE": 1"#, r#""MARINE": 1"#);
        setting.place(0, 17.5, 16.0).place(1, 20.0, 16.0).place(2, 22.0, 16.0);
        for target in [None, Some(1)] {
            setting.snapshot.units.target[2] = target;
            let after = setting.play(&[STOP; 2], None);
            assert_eq!(after.units.target[2], Some(0), "{rules}");
        }
    }
}

/// A marine with 3 health beside an enemy zealot, and a medivac that heals it. Zealots cannot attack
/// medivacs.
fn dying_marine(rules: Rules) -> Setting {
    let mut setting = Setting::new(rules, r#""MEDIVAC": 1, "MARINE": 1"#, r#""ZEALOT": 1"#);
    setting.place(0, 8.0, 16.0).place(1, 9.0, 16.0).place(2, 9.9, 16.0);
    setting.snapshot.units.hp[1] = 3.0;
    setting.snapshot.units.target[0] = Some(1);
    setting
}

/// R2: a marine is killed, and healed later in the same tick.
#[test]
fn r2_a_heal_in_the_tick_of_the_kill_saves_only_under_smaclite() {
    for (rules, lives) in [(Rules::Smaclite, true), (Rules::Paper, false)] {
        let mut setting = dying_marine(rules);
        let after = setting.play(&[TARGET + 1, STOP], Some(&[2, 1, 0]));
        assert_eq!(after.units.alive[1], lives, "{rules}");
        assert_eq!(after.units.hp[1], if lives { 0.5625 } else { 0.0 }, "{rules}");
        let full = setting.snapshot.units.energy[0] + 0.5625 / 16.0;
        assert_eq!(after.units.energy[0], if lives { full - 1.0 } else { full }, "{rules}");
    }
}

/// R2: a commanded healer continues to heal a dead unit, without effect.
#[test]
fn r2_dead_units_stay_dead() {
    let mut setting = dying_marine(Rules::Smaclite);
    setting.play(&[TARGET + 1, STOP], Some(&[0, 1, 2]));
    let units = setting.battle.units();
    assert!(units.hp[1] > 0.0 && !units.alive[1]);
    assert_eq!(units.target[0], Some(1));
    assert_eq!(setting.battle.dead_allies(), 1);
    assert!(setting.battle.is_available(1, action::NO_OP));
}

/// R3: an enemy medivac (3.5 squares per second) without a target, among marines (3.15) and away from them.
#[test]
fn r3_a_healer_has_the_speed_of_the_slowest_unit_around() {
    for rules in [Rules::Smaclite, Rules::Paper] {
        let mut setting = Setting::new(rules, r#""MARINE": 1"#, r#""MEDIVAC": 1, "MARINE": 2"#);
        setting.place(0, 2.0, 16.0).place(1, 25.0, 16.0).place(2, 24.0, 16.0);
        for (x, speed) in [(26.0, 3.15), (10.0, 3.15)] {
            setting.place(3, x, 16.0);
            let after = setting.play(&[STOP], None);
            assert!((after.preferred[1].length() - speed).abs() < 1e-5, "{rules}: {}", after.preferred[1]);
        }
        setting.place(2, 10.0, 17.0);
        let after = setting.play(&[STOP], None);
        assert!((after.preferred[1].length() - 3.5).abs() < 1e-5, "{rules}: {}", after.preferred[1]);
    }
}

/// R3: a medivac among faster stalkers (4.13) prefers their speed; its maximum limits the resulting velocity.
#[test]
fn r3_a_healer_may_prefer_more_than_its_maximum_speed() {
    for (rules, speed) in [(Rules::Smaclite, 4.13), (Rules::Paper, 3.5)] {
        let mut setting = Setting::new(rules, r#""MARINE": 1"#, r#""MEDIVAC": 1, "STALKER": 1"#);
        setting.place(0, 2.0, 16.0).place(1, 25.0, 16.0).place(2, 24.0, 16.0);
        let after = setting.play(&[STOP], None);
        assert!((after.preferred[1].length() - speed).abs() < 1e-5, "{rules}: {}", after.preferred[1]);
        assert!((after.units.vel[1].length() - 3.5).abs() < 1e-5, "{rules}: {}", after.units.vel[1]);
    }
}

/// R4: a marine is killed after it declared an attack and before its turn, and healed in the same tick.
#[test]
fn r4_an_attack_that_was_declared_before_death_and_healing_is_held() {
    let mut setting = dying_marine(Rules::Smaclite);
    let after = setting.play(&[TARGET + 1, TARGET], Some(&[2, 1, 0]));
    assert!(after.units.alive[1] && after.units.declared[1]);
    assert_eq!(after.units.shield[2], 50.0, "the marine had no turn");
    // It did not move either, so it keeps the velocity with which it last moved.
    assert_eq!(after.units.vel[1], Vec2::ZERO);
}

/// R4: the held attack is executed at any distance, in the next turn with a target.
#[test]
fn r4_a_held_attack_is_executed_at_any_distance() {
    for declared in [false, true] {
        let mut setting = Setting::new(Rules::Smaclite, r#""MARINE": 1"#, r#""MARINE": 1"#);
        setting.place(0, 9.0, 16.0).place(1, 14.9, 16.0);
        setting.snapshot.units.declared[0] = declared;
        let after = setting.play(&[TARGET], None);
        assert_eq!(after.units.hp[1], if declared { 39.0 } else { 45.0 }, "declared: {declared}");
        assert!(after.preferred[0].x > 0.0 && !after.units.declared[0]);
    }
}

/// The healer's target field decides whether a target is new, and it is empty under a command to target a
/// dead unit: with less than 5 energy such a heal still happens, from the second tick after the death on.
#[test]
fn healing_dead_units_does_not_require_five_energy() {
    let mut setting = dying_marine(Rules::Smaclite);
    setting.snapshot.units.energy[0] = 4.0;
    setting.play(&[TARGET + 1, STOP], Some(&[0, 1, 2]));
    let units = setting.battle.units();
    assert!(units.hp[1] > 0.0 && !units.alive[1]);
}

/// A healer with less than 5 energy heals no new target, but continues with its current one.
#[test]
fn a_new_target_requires_five_energy() {
    for (energy, previous, heals) in [(4.5, None, false), (5.0, None, true), (4.5, Some(1), true)] {
        let mut setting = Setting::new(Rules::Smaclite, r#""MEDIVAC": 1, "MARINE": 1"#, r#""MARINE": 1"#);
        setting.snapshot.units.hp[1] = 30.0;
        setting.snapshot.units.energy[0] = energy;
        setting.snapshot.units.target[0] = previous;
        let after = setting.play(&[TARGET + 1, STOP], None);
        assert_eq!(after.units.hp[1], if heals { 30.5625 } else { 30.0 }, "energy {energy}");
        assert_eq!(after.units.target[0], heals.then_some(1));
    }
}

/// A healer drops a target at full health.
#[test]
fn healing_stops_at_full_health() {
    let mut setting = Setting::new(Rules::Smaclite, r#""MEDIVAC": 1, "MARINE": 1"#, r#""MARINE": 1"#);
    setting.snapshot.units.target[0] = Some(1);
    let after = setting.play(&[TARGET + 1, STOP], None);
    assert_eq!((after.units.target[0], after.units.healing[0]), (None, 0.0));
}

/// An enemy that blows itself up adds its health to the reward; an agent that does adds only the damage of
/// its hits.
#[test]
fn reward_of_an_explosion() {
    let mut setting = Setting::new(Rules::Smaclite, r#""ZEALOT": 1"#, r#""BANELING": 1"#);
    setting.place(0, 16.0, 16.0).place(1, 17.0, 16.0);
    let after = setting.play(&[STOP], Some(&[1, 0]));
    assert_eq!(after.earned, 30.0);
    // 80 damage: the shield absorbs 50, and armor 1 of the rest.
    assert_eq!((after.units.shield[0], after.units.hp[0]), (0.0, 71.0));

    let mut setting = Setting::new(Rules::Smaclite, r#""BANELING": 1"#, r#""ZERGLING": 2"#);
    setting.place(0, 16.0, 16.0).place(1, 16.9, 16.0).place(2, 25.0, 16.0);
    let after = setting.play(&[TARGET], Some(&[0, 1, 2]));
    assert_eq!(after.earned, 45.0);
    assert!(!after.units.alive[0] && !after.units.alive[1]);
}

/// Explosions and beams hit every plane: `valid_targets` decides only which units may be targeted.
#[test]
fn explosions_and_beams_hit_units_in_the_air() {
    let mut setting = Setting::new(Rules::Smaclite, r#""MEDIVAC": 1, "MARINE": 1"#, r#""BANELING": 1"#);
    setting.place(0, 17.5, 17.0).place(1, 16.0, 16.0).place(2, 17.0, 16.0);
    let after = setting.play(&[STOP; 2], Some(&[2, 0, 1]));
    assert_eq!(after.units.hp[0], 150.0 - 79.0, "armor absorbs 1 of the 80");

    let mut setting = Setting::new(Rules::Smaclite, r#""COLOSSUS": 1"#, r#""MEDIVAC": 1, "MARINE": 1"#);
    setting.place(0, 12.0, 16.0).place(1, 17.0, 17.0).place(2, 17.0, 16.0);
    let after = setting.play(&[TARGET + 1], Some(&[0]));
    assert_eq!(after.units.hp[1], 150.0 - 2.0 * 9.0, "two hits of 10");
}

/// A colossus continues to fire at a target that died in this step. If no other unit is there it hits
/// nothing, but its cooldown starts.
#[test]
fn a_laser_at_a_dead_target_starts_its_cooldown() {
    let mut setting =
        Setting::new(Rules::Smaclite, r#""COLOSSUS": 1, "MARINE": 1"#, r#""MARINE": 1, "ZEALOT": 1"#);
    setting.place(0, 12.0, 16.0).place(1, 13.0, 17.5).place(2, 17.0, 16.0).place(3, 29.0, 16.0);
    setting.snapshot.units.hp[2] = 1.0;
    setting.snapshot.units.cooldown[0] = 0.25;
    setting.play(&[TARGET, TARGET], None);
    let units = setting.battle.units();
    assert!(!units.alive[2]);
    assert!((0.5..1.07).contains(&units.cooldown[0]), "cooldown {}", units.cooldown[0]);
}

/// In a healer's observation the first entry of the enemy blocks says which allies are within its targeting
/// range. That includes healers, which the available actions exclude.
#[test]
fn a_healers_observation_includes_healers_in_range() {
    let mut setting = Setting::new(Rules::Smaclite, r#""MEDIVAC": 2, "MARINE": 1"#, r#""MARINE": 3"#);
    setting.place(0, 9.0, 16.0).place(1, 10.0, 16.0).place(2, 9.0, 17.0);
    (3..6).for_each(|enemy| _ = setting.place(enemy, 15.0, 14.0 + enemy as f32));
    setting.battle.restore(&setting.snapshot).expect("a snapshot of this battle");
    let sizes = setting.battle.arena().sizes();
    let mut obs = vec![0.0; sizes.n_agents * sizes.obs_size];
    setting.battle.write_obs(Faction::Ally, &mut obs, &mut Scratch::new());
    // After the four moves there are five numbers per enemy.
    let in_range = |agent: usize| [0, 1, 2].map(|enemy| obs[agent * sizes.obs_size + 4 + 5 * enemy]);
    assert_eq!([in_range(0), in_range(1)], [[0.0, 1.0, 1.0], [1.0, 0.0, 1.0]]);
    assert!(!setting.battle.is_available(0, action::FIRST_TARGET + 1));
}

/// Healers can target neither themselves nor each other, whatever their position in their group.
#[test]
fn targets_of_healers() {
    let setting = Setting::new(Rules::Smaclite, r#""MEDIVAC": 2, "MARINE": 2"#, r#""MARINE": 1"#);
    let sizes = setting.battle.arena().sizes();
    assert_eq!(sizes.n_actions, 6 + 4);
    for healer in [0, 1] {
        let targets: Vec<usize> = (0..4).filter(|i| setting.battle.is_available(healer, 6 + i)).collect();
        assert_eq!(targets, [2, 3]);
    }
    assert!((6..10).all(|target| !setting.battle.is_available(2, target)), "the enemy is out of range");
}
