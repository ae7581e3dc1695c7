//! Battles whose units are drawn, and SMACv2's interface with its options.

use std::sync::Arc;

use serde_json::json;
use smaclite_engine::policy::Random;
use smaclite_engine::{
    Arena, Battle, BattleSetup, FeatureBlock, RecordLayout, RecordSizes, Rules, Scratch, Snapshot, Step,
    action, feature_bounds, obs_features, policy, state_features,
};
use smaclite_scenarios::{Capability, EnemyMask, Faction, Scenario, ScenarioFiles, Smacv2};

/// A generated scenario with changed options.
pub fn arena(scenario: &str, change: impl FnOnce(&mut Smacv2)) -> Arc<Arena> {
    let mut scenario = Scenario::standard(scenario).expect("a standard scenario");
    change(scenario.smacv2.as_mut().expect("options"));
    Arc::new(Arena::new(&scenario, Rules::Smaclite))
}

/// Everything that draws, with and without the faults of the published code.
fn with_everything(published: bool) -> impl Fn(&mut Smacv2) {
    move |options| {
        let capability = |lower_bound, upper_bound| Capability { lower_bound, upper_bound, observe: true };
        *options = Smacv2 {
            conic_fov: true,
            num_fov_actions: 4,
            prob_obs_enemy: 0.5,
            attack: Some(capability(0.3, 0.9)),
            health: Some(capability(0.1, 0.4)),
            enemy_mask: Some(EnemyMask { mask_probability: 0.5 }),
            obs_last_action: true,
            obs_timestep_number: true,
            published,
            ..options.clone()
        }
    }
}

/// Bits of observations and of the state, and the available actions.
type Shown = (Vec<u32>, Vec<u32>, Vec<u8>);

/// What a learner receives.
fn shown(battle: &Battle) -> Shown {
    let sizes = battle.arena().sizes();
    let (mut obs, mut state) = (vec![0.0; sizes.n_agents * sizes.obs_size], vec![0.0; sizes.state_size]);
    let mut available = vec![0; sizes.n_agents * sizes.n_actions];
    battle.write_obs(Faction::Ally, &mut obs, &mut Scratch::new());
    battle.write_state(Faction::Ally, &mut state);
    battle.write_avail_actions(Faction::Ally, &mut available);
    let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect();
    (bits(obs), bits(state), available)
}

/// Plays on with random actions, over ends; what it shows after each step.
fn play(battle: &mut Battle, steps: usize) -> Vec<(Shown, Step)> {
    let (mut random, mut scratch) = (Random::new(5), Scratch::new());
    let mut actions = vec![0; battle.arena().sizes().n_agents];
    let mut step = |_| {
        if battle.is_over() {
            battle.reset();
        }
        random.act(battle, &mut actions);
        let step = battle.step(&actions, &mut scratch).expect("legal actions");
        (shown(battle), step)
    };
    (0..steps).map(&mut step).collect()
}

#[test]
fn battles_continue_from_records_with_the_same_bits() {
    for name in Scenario::generated_names() {
        for arena in
            [arena(name, |_| {}), arena(name, with_everything(false)), arena(name, with_everything(true))]
        {
            let mut battle = Battle::new(Arc::clone(&arena), 1);
            let mut other = Battle::new(Arc::clone(&arena), 2);
            play(&mut battle, 9);
            play(&mut other, 3);
            let layout = RecordLayout::new(RecordSizes::new(&arena.sizes(), 0));
            let mut record = vec![0; layout.size()];
            battle.write_record(&layout, &[], &mut record);
            let mut snapshot = Snapshot::default();
            snapshot.read_record(&arena, 0, &record, &mut Vec::new()).expect("a record");
            assert_eq!(snapshot, battle.save(), "{name}");
            other.restore(&snapshot).expect("a snapshot of the arena");
            assert_eq!(shown(&other), shown(&battle), "{name}");
            assert_eq!(play(&mut other, 80), play(&mut battle, 80), "{name}");
        }
    }
}

/// Room was looked for with the sizes of SMAClite's rules, and battles of `starcraft`, where a spine crawler
/// is 1.75 squares wide, began with units on each other.
#[test]
fn units_that_a_rule_set_makes_larger_need_room_too() {
    let group =
        |y: u32, faction: &str| json!({"x": 3, "y": y, "faction": faction, "units": {"SPINE_CRAWLER": 8}});
    let text = json!({
        "name": "narrow", "num_allied_units": 8, "num_enemy_units": 8, "num_unit_types": 0,
        "groups": [group(2, "ALLY"), group(4, "ENEMY")], "attack_point": [1, 1],
        "start_positions": {"distribution": "uniform", "allies": [0, 0, 6, 6], "enemies": [0, 0, 6, 6]},
        "terrain": vec!["______"; 6], "width": 6, "height": 6,
        "ally_has_shields": false, "enemy_has_shields": false,
    });
    let files = ScenarioFiles { source: "narrow".into(), text: text.to_string(), unit_files: Vec::new() };
    for rules in Rules::ALL {
        let setup = BattleSetup { rules, ..BattleSetup::new(files.clone()) };
        let refused = setup.arena().err().map(|problems| problems.to_string());
        let expected = "narrow: `start_positions` must leave room for 16 units on the map, of which none \
                        overlap with the sizes and planes that they have under the rules `starcraft`";
        assert_eq!(refused.as_deref(), (rules == Rules::Starcraft).then_some(expected));
    }
}

/// Where enemies stood in groups before those of the agents, agents had the units and the places of enemies;
/// and the scenario had its agents in another order than the battle.
#[test]
fn whatever_the_order_of_groups_agents_have_their_units_where_starts_are_drawn() {
    let starts = json!({"distribution": "uniform", "allies": [0, 0, 0.4, 1], "enemies": [0.6, 0, 1, 1]});
    let mut types_are_reordered = false;
    for name in Scenario::standard_names() {
        let (fixed, files) = ScenarioFiles::resolve(name).expect("a standard scenario");
        let [width, height] = [fixed.terrain.width(), fixed.terrain.height()].map(f64::from);
        let mut starts = starts.clone();
        for side in ["allies", "enemies"] {
            for (share, length) in
                starts[side].as_array_mut().unwrap().iter_mut().zip([width, height].repeat(2))
            {
                *share = (share.as_f64().unwrap() * length).floor().into();
            }
        }
        let Ok(scenario) = files.with_keys([("start_positions".to_owned(), starts)]).scenario() else {
            continue; // no room
        };
        let types_of = |scenario: &Scenario, side| {
            let units = scenario.units.iter().filter(move |unit| unit.faction == side);
            units.map(|unit| scenario.unit_types[unit.unit_type].name.clone()).collect::<Vec<_>>()
        };
        for side in [Faction::Ally, Faction::Enemy] {
            let [mut given, mut drawn] = [&fixed, &scenario].map(|scenario| types_of(scenario, side));
            types_are_reordered |= given != drawn;
            given.sort();
            drawn.sort();
            assert_eq!(given, drawn, "{name}");
        }
        let mut battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::Smaclite)), 1);
        for _ in 0..3 {
            battle.reset();
            let types = scenario.units.iter().map(|unit| unit.unit_type);
            assert!(battle.types().eq(types), "{name}: the types of the scenario by battle-wide id");
            let mut level = vec![0.0; battle.arena().level_size()];
            battle.write_level(&mut level);
            let (agents, enemies) = level.as_chunks::<5>().0.split_at(scenario.n_agents());
            // A unit without room may have to go beyond the middle.
            let mean = |rows: &[[f32; 5]]| rows.iter().map(|row| row[1]).sum::<f32>() / rows.len() as f32;
            let middle = width as f32 / 2.0;
            assert!(mean(agents) < middle && middle < mean(enemies), "{name}: {agents:?}, {enemies:?}");
        }
    }
    assert!(types_are_reordered, "some map has its agents in another order");
}

#[test]
fn an_episode_begins_again_where_its_generator_was() {
    for published in [false, true] {
        let arena = arena("zerg_10_vs_11", with_everything(published));
        let mut battle = Battle::new(Arc::clone(&arena), 3);
        battle.reset();
        let (start, opponent) = (battle.start(), battle.opponent());
        let first = shown(&battle);
        let mut again = Battle::new(arena, 9);
        again.set_generator(start.into());
        again.reset_against(opponent);
        assert_eq!(shown(&again), first);
        assert_eq!(again.start(), start);
    }
}

/// Marines against marines: allies at these places, enemies at those; the rest of the units is absent.
pub fn duel(arena: &Arc<Arena>, allies: &[[f32; 2]], enemies: &[[f32; 2]]) -> Battle {
    duel_of(arena, 1, allies, enemies)
}

/// A [`duel`] with another seed.
pub fn duel_of(arena: &Arc<Arena>, seed: u64, allies: &[[f32; 2]], enemies: &[[f32; 2]]) -> Battle {
    let mut battle = Battle::new(Arc::clone(arena), seed);
    let mut level = vec![0.0; arena.level_size()];
    battle.write_level(&mut level);
    let rows: &mut [[f32; 5]] = level.as_chunks_mut().0;
    let n_agents = arena.sizes().n_agents;
    for (i, row) in rows.iter_mut().enumerate() {
        let place = match i.checked_sub(n_agents) {
            None => allies.get(i),
            Some(enemy) => enemies.get(enemy),
        };
        let [x, y] = place.copied().unwrap_or([1.0, 1.0]);
        *row = [0.0, x, y, 1.0, f32::from(u8::from(place.is_some()))];
    }
    battle.reset_to(&level).expect("a level");
    battle
}

/// Which enemies an agent is shown.
pub fn seen(battle: &Battle, agent: usize) -> Vec<bool> {
    let n_enemies = battle.arena().sizes().n_enemies;
    let (_, _, perception) = battle.perceived().expect("an interface");
    perception.shown[agent * n_enemies..][..n_enemies].to_vec()
}

#[test]
fn only_the_first_seer_sees_an_enemy_that_nobody_else_may_see() {
    let near = [[10.0, 16.0], [10.0, 18.0]];
    for (share, expected) in [(0.0, 1), (1.0, 2)] {
        let arena = arena("terran_5_vs_5", |options| options.prob_obs_enemy = share);
        let battle = duel(&arena, &near, &[[14.0, 16.0]]);
        let n_seers = (0..2).filter(|agent| seen(&battle, *agent)[0]).count();
        assert_eq!(n_seers, expected);
    }
}

/// The published code hides every enemy up to a dead one from those who do not see the corpse.
#[test]
fn a_dead_enemy_hides_nobody_unless_the_faults_are_asked_for() {
    for (published, expected) in [(false, true), (true, false)] {
        let arena = arena("terran_5_vs_5", |options| options.published = published);
        // The second enemy is absent, as if it had died far away.
        let battle = duel(&arena, &[[16.0, 16.0]], &[[20.0, 16.0]]);
        assert_eq!(seen(&battle, 0)[0], expected);
    }
}

#[test]
fn agents_see_what_is_in_their_cone() {
    let arena = arena("terran_5_vs_5", |options| {
        (options.conic_fov, options.num_fov_actions) = (true, 4);
    });
    let mut battle = duel(&arena, &[[16.0, 16.0]], &[[20.0, 16.0], [12.0, 16.0], [16.0, 20.0]]);
    assert_eq!(seen(&battle, 0)[..3], [true, false, false], "it looks east at first");
    assert_eq!(arena.first_target(smaclite_scenarios::Faction::Ally), 10);
    for (look, expected) in [(1, [false, false, true]), (2, [false, true, false])] {
        let mut actions = vec![0; 5];
        actions[0] = 6 + look;
        battle.step(&actions, &mut Scratch::new()).expect("a look");
        assert_eq!(seen(&battle, 0)[..3], expected, "look {look}");
    }
}

/// Bits of looks are in several words.
#[test]
fn a_cone_can_be_one_degree_wide() {
    let arena = arena("terran_5_vs_5", |options| {
        (options.conic_fov, options.num_fov_actions) = (true, 360);
    });
    let mut battle = duel(&arena, &[[16.0, 16.0]], &[[16.0, 20.0]]);
    assert!((6..366).all(|look| battle.is_available(0, look)));
    assert!(!battle.is_available(0, 366), "it looks east");
    let mut actions = vec![0; 5];
    actions[0] = 6 + 90;
    battle.step(&actions, &mut Scratch::new()).expect("a look north");
    assert!(battle.is_available(0, 366) && seen(&battle, 0)[0]);
}

#[test]
fn an_attack_without_a_chance_does_nothing_and_a_sure_one_hurts() {
    for (bound, hurts) in [(0.0, false), (1.0, true)] {
        let arena = arena("terran_5_vs_5", |options| {
            options.attack = Some(Capability { lower_bound: bound, upper_bound: bound, observe: false });
        });
        let mut battle = duel(&arena, &[[16.0, 16.0]], &[[18.0, 16.0]]);
        let mut actions = vec![0; 5];
        actions[0] = action::FIRST_TARGET as i32;
        let step = battle.step(&actions, &mut Scratch::new()).expect("an attack");
        assert_eq!(step.reward > 0.0, hurts);
    }
}

#[test]
fn agents_die_below_their_level_of_health() {
    let arena = arena("terran_5_vs_5", |options| {
        options.health = Some(Capability { lower_bound: 0.9, upper_bound: 0.9, observe: true });
    });
    let mut battle = duel(&arena, &[[16.0, 16.0], [2.0, 30.0]], &[[18.0, 16.0], [18.0, 17.0]]);
    let mut actions = vec![0; 5];
    (actions[0], actions[1]) = (action::STOP as i32, action::STOP as i32);
    battle.step(&actions, &mut Scratch::new()).expect("they stop");
    assert_eq!(battle.dead_allies(), 4, "who was shot once has died, the other lives");
}

/// The greatest return of such battles is negative, and every snapshot of them was once refused.
#[test]
fn battles_with_negative_points_for_a_win_continue_from_their_snapshots() {
    for (scale, published) in [(false, false), (false, true), (true, true)] {
        let arena = arena("terran_5_vs_5", |options| {
            (options.rewards.win, options.rewards.scale, options.published) = (-1000.0, scale, published);
        });
        let mut battle = Battle::new(Arc::clone(&arena), 1);
        let mut other = Battle::new(arena, 2);
        play(&mut battle, 5);
        other.restore(&battle.save()).expect("a state of its own");
        assert_eq!(play(&mut battle, 5), play(&mut other, 5));
    }
}

/// At a level of 1 an agent saw its own health as NaN. No bounds below 1 give one, also not by rounding.
#[test]
fn observations_are_numbers_at_every_level_of_health() {
    for bounds in [[0.0, 1.0], [1.0 - f64::EPSILON / 2.0, 1.0]] {
        let arena = arena("terran_5_vs_5", |options| {
            let [lower_bound, upper_bound] = bounds;
            options.health = Some(Capability { lower_bound, upper_bound, observe: true });
        });
        let mut battle = Battle::new(Arc::clone(&arena), 1);
        for _ in 0..20 {
            battle.reset();
            let (obs, ..) = shown(&battle);
            assert!(obs.iter().all(|bits| f32::from_bits(*bits).is_finite()), "{bounds:?}");
        }
        let mut snapshot = battle.save();
        assert_eq!(snapshot.check(&arena), Ok(()));
        snapshot.perception[2] = 1f64.to_bits();
        assert!(snapshot.check(&arena).is_err(), "a level of 1");
    }
}

/// In the published code the time limit ends the battle; otherwise it only cuts the episode off.
#[test]
fn the_time_limit_truncates_unless_the_faults_are_asked_for() {
    for published in [false, true] {
        let arena = arena("terran_5_vs_5", |options| options.published = published);
        let arena = Arc::new(Arena::clone(&arena).with_episode_limit(Some(1)));
        let mut battle = duel(&arena, &[[2.0, 2.0]], &[[30.0, 30.0]]);
        let mut actions = vec![0; 5];
        actions[0] = action::STOP as i32;
        let step = battle.step(&actions, &mut Scratch::new()).expect("it stops");
        assert_eq!((step.terminated, step.truncated), (published, !published));
        assert!(battle.is_over() && battle.save().is_over(&arena));
    }
}

/// Healers alone cannot win: a team of which only they are left has lost.
#[test]
fn healers_alone_have_lost() {
    let arena = arena("terran_5_vs_5", |_| {});
    let mut battle = Battle::new(Arc::clone(&arena), 1);
    let mut level = vec![0.0; arena.level_size()];
    battle.write_level(&mut level);
    let rows: &mut [[f32; 5]] = level.as_chunks_mut().0;
    let scenario = Scenario::standard("terran_5_vs_5").expect("a standard scenario");
    let index = |name: &str| scenario.unit_types.iter().position(|unit_type| unit_type.name == name);
    let [marine, medivac] = ["MARINE", "MEDIVAC"].map(|name| index(name).expect("a type") as f32);
    for (i, row) in rows.iter_mut().enumerate() {
        // A medivac far away, and a marine with little health beside five marines.
        let (unit_type, health) = [(medivac, 1.0), (marine, 0.01)].get(i).copied().unwrap_or((marine, 1.0));
        let x = if i == 0 { 2.0 } else { 16.0 + i as f32 / 2.0 };
        *row = [unit_type, x, 16.0, health, f32::from(u8::from(!(2..5).contains(&i)))];
    }
    battle.reset_to(&level).expect("a level");
    let mut actions = vec![0; 5];
    (actions[0], actions[1]) = (action::STOP as i32, action::STOP as i32);
    let mut step = || {
        actions[1] = if battle.units().alive[1] { action::STOP as i32 } else { action::NO_OP as i32 };
        battle.step(&actions, &mut Scratch::new()).expect("they stop")
    };
    let step = (0..9).map(|_| step()).find(|step| step.terminated).expect("an end");
    assert!(!step.battle_won, "{step:?}");
    assert_eq!((battle.units().alive[0], battle.dead_allies(), battle.is_over()), (true, 4, true));
}

/// A unit is in the battle as long as it has health: the interface sees no difference.
#[test]
fn the_living_have_health() {
    for name in Scenario::generated_names() {
        let mut battle = Battle::new(arena(name, with_everything(false)), 4);
        let mut actions = vec![0; battle.arena().sizes().n_agents];
        for _ in 0..60 {
            if battle.is_over() {
                battle.reset();
            }
            policy::nearest(&battle, &mut actions);
            battle.step(&actions, &mut Scratch::new()).expect("legal actions");
            let units = battle.units();
            assert!(units.alive.iter().zip(&units.hp).all(|(alive, hp)| !alive || *hp > 0.0), "{name}");
        }
    }
}

/// Observations of all generated scenarios left the declared space [-1, 1]: agents are pushed off the map, so
/// that their own x and y were up to 1.047. The bounds of features contain all that battles show.
#[test]
fn what_battles_show_is_within_the_bounds_of_features() {
    for name in Scenario::standard_names().chain(Scenario::generated_names()) {
        for variant in 0..3 {
            let mut scenario = Scenario::standard(name).expect("a standard scenario");
            match (&mut scenario.smacv2, variant) {
                (_, 0) => {}
                (Some(options), 1) => with_everything(false)(options),
                (Some(options), _) => {
                    with_everything(true)(options);
                    options.fully_observable = true;
                    options.obs_own_pos = true;
                    options.obs_instead_of_state = true;
                }
                (None, _) => continue,
            }
            check_bounds(name, &scenario);
        }
    }
}

fn check_bounds(name: &str, scenario: &Scenario) {
    let bounds = |blocks: Vec<FeatureBlock>| -> Vec<[f32; 2]> {
        let rows = |block: &FeatureBlock| feature_bounds(scenario, block).repeat(block.rows.unwrap_or(1));
        blocks.iter().flat_map(rows).collect()
    };
    let (of_obs, of_state) = (bounds(obs_features(scenario)), bounds(state_features(scenario)));
    let mut battle = Battle::new(Arc::new(Arena::new(scenario, Rules::Smaclite)), 3);
    for ((obs, state, _), _) in play(&mut battle, 120) {
        for (row, bounds) in obs.chunks_exact(of_obs.len()).zip(std::iter::repeat(&of_obs)) {
            assert_within(name, row, bounds);
        }
        assert_within(name, &state, &of_state);
    }
}

fn assert_within(name: &str, row: &[u32], bounds: &[[f32; 2]]) {
    assert_eq!(row.len(), bounds.len(), "{name}");
    for (i, (bits, [low, high])) in row.iter().zip(bounds).enumerate() {
        let value = f32::from_bits(*bits);
        assert!((*low..=*high).contains(&value), "{name}: feature {i} is {value}, not in {low} to {high}");
    }
}
