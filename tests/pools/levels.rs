//! Episodes begin with levels that a learner chooses.

use smaclite_engine::{Arena, Battle, Faction, LevelError, Rules, Scratch, policy};
use smaclite_ipc::{Client, Order, Seeds, WaitOptions, WaitStrategy};
use smaclite_pool::fields::{FIELDS, Field};
use smaclite_scenarios::{Scenario, ScenarioFiles};
use smaclite_tests::{LanePlan, PoolPlan, TestDir};
use std::sync::Arc;

fn arena(scenario: &str) -> Arc<Arena> {
    Arc::new(Arena::new(&Scenario::standard(scenario).expect("a standard scenario"), Rules::Smaclite))
}

fn level(battle: &Battle) -> Vec<f32> {
    let mut level = vec![0.0; battle.arena().level_size()];
    battle.write_level(&mut level);
    level
}

fn play(battle: &mut Battle, steps: usize) -> Vec<f32> {
    let mut actions = vec![0; battle.arena().sizes().n_agents];
    for _ in 0..steps {
        policy::nearest(battle, &mut actions);
        battle.step(&actions, &mut Scratch::new()).expect("legal actions");
    }
    let mut state = vec![0.0; battle.arena().sizes().state_size];
    battle.write_state(Faction::Ally, &mut state);
    state
}

#[test]
fn the_level_that_an_episode_began_with_gives_the_same_episode() {
    let arena = arena("MMM");
    let (mut drawn, mut written) = (Battle::new(Arc::clone(&arena), 3), Battle::new(arena, 3));
    let own = level(&drawn);
    play(&mut written, 7);
    written.reseed(3);
    written.reset_to(&own).expect("a level of its own");
    drawn.reseed(3);
    drawn.reset();
    assert_eq!(play(&mut drawn, 20), play(&mut written, 20));
    assert_eq!(level(&written), own, "it remains while the battle goes on");
}

#[test]
fn units_are_where_and_as_healthy_as_the_level_says() {
    let mut battle = Battle::new(arena("2s3z"), 1);
    let mut edited = level(&battle);
    let rows: &mut [[f32; 5]] = edited.as_chunks_mut().0;
    (rows[0][1], rows[0][2], rows[0][3]) = (5.5, 20.25, 0.5);
    rows[1][4] = 0.0;
    battle.reset_to(&edited).expect("a level");
    let units = battle.units();
    assert_eq!((units.pos[0].x, units.pos[0].y, units.hp[0]), (5.5, 20.25, 40.0));
    assert!(!units.alive[1] && units.alive[2], "who is not in the battle counts as dead");
    assert_eq!((battle.dead_allies(), battle.is_over()), (1, false));
    assert_eq!(battle.available(1), [1], "and has no-op alone");
}

/// What a row says of a unit that is not in the battle went unchecked into its state, and no snapshot of that
/// battle was valid.
#[test]
fn any_numbers_of_a_unit_that_is_not_in_the_battle_give_a_valid_state() {
    for name in ["2s3z", "protoss_5_vs_5"] {
        for number in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
            let mut battle = Battle::new(arena(name), 1);
            let mut edited = level(&battle);
            edited[6..9].fill(number);
            edited[9] = 0.0;
            battle.reset_to(&edited).expect("a level");
            assert_eq!(battle.save().check(battle.arena()), Ok(()), "{name}, {number}");
            assert!(play(&mut battle, 5).iter().all(|value| value.is_finite()), "{name}, {number}");
            assert_eq!(battle.save().check(battle.arena()), Ok(()), "{name}, {number}");
        }
    }
}

/// The arena's start positions were overwritten by the level's, so later episodes began there too.
#[test]
fn a_level_changes_no_later_episode() {
    let arena = arena("2s3z");
    let mut battle = Battle::new(Arc::clone(&arena), 1);
    let own = level(&battle);
    let mut edited = own.clone();
    edited[1..3].copy_from_slice(&[5.5, 20.25]);
    battle.reset_to(&edited).expect("a level");
    let mut fork = Battle::new(arena, 8);
    fork.restore(&battle.save()).expect("a state of the same arena");
    for battle in [&mut battle, &mut fork] {
        battle.reset();
        assert_eq!(level(battle), own, "the scenario's units are where the scenario says");
    }
    assert_eq!(play(&mut battle, 20), play(&mut fork, 20));
}

#[test]
fn a_level_that_cannot_be_is_an_error_that_names_the_unit() {
    let mut battle = Battle::new(arena("2s3z"), 1);
    let good = level(&battle);
    let mut error = |place: usize, column: usize, value: f32| {
        let mut bad = good.clone();
        bad[place * 5 + column] = value;
        battle.reset_to(&bad).unwrap_err().to_string()
    };
    assert_eq!(error(0, 0, 1.0), "type of agent 0 must be 0, got 1");
    assert_eq!(error(2, 1, 40.0), "x of agent 2 must be from 0 to 32, got 40");
    assert_eq!(error(5, 2, f32::NAN), "y of enemy 0 must be from 0 to 32, got NaN");
    assert_eq!(error(9, 3, 0.0), "health of enemy 4 must be a share above 0 and at most 1, got 0");
    assert_eq!(error(0, 4, 0.5), "alive of agent 0 must be 0 or 1, got 0.5");
    assert!(error(0, 2, 0.5).ends_with(", 0.5), where the map is blocked"), "{}", error(0, 2, 0.5));
    let mut same = good.clone();
    same.copy_within(1..3, 6);
    assert_eq!(battle.reset_to(&same).unwrap_err().to_string(), "agent 0 and agent 1 start at one point");
    let mut nobody = good.clone();
    (5..10).for_each(|enemy| nobody[enemy * 5 + 4] = 0.0);
    assert!(matches!(battle.reset_to(&nobody), Err(LevelError::NobodyAlive(_))));
    assert_eq!(level(&battle), good, "the battle is unchanged");
}

#[test]
fn a_level_of_healers_alone_is_refused_with_the_interface_of_smacv2() {
    let mut battle = Battle::new(arena("terran_5_vs_5"), 1);
    let types = Scenario::standard("terran_5_vs_5").expect("a standard scenario").unit_types;
    let medivac = types.iter().position(|unit_type| unit_type.is_healer()).expect("a medivac");
    for (first, side) in [(0, "agent"), (5, "enemy")] {
        let mut edited = level(&battle);
        edited.chunks_exact_mut(5).skip(first).take(5).for_each(|row| row[0] = medivac as f32);
        let error = battle.reset_to(&edited).unwrap_err().to_string();
        let why = "that is no healer must be alive, because healers alone have lost with `smacv2`";
        assert_eq!(error, format!("at least one {side} {why}"));
    }
}

/// The field `level` of such a scenario could not be given back.
#[test]
fn a_unit_may_begin_where_its_scenario_puts_it_also_on_a_blocked_square() {
    let (_, files) = ScenarioFiles::resolve("3m").expect("a standard scenario");
    let text = files.text.replace("9, \"y\": 16", "9, \"y\": 30");
    let scenario = ScenarioFiles { text, ..files }.scenario().expect("allowed, with a warning");
    let mut battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::Smaclite)), 1);
    let own = level(&battle);
    battle.reset_to(&own).expect("its own level");
    assert_eq!(level(&battle), own);
    let mut beside = own;
    beside[1] += 0.125;
    assert!(matches!(battle.reset_to(&beside), Err(LevelError::Blocked { .. })));
}

/// A reset to levels.
fn to(levels: &[f32], seed: Option<u64>) -> Order<'_> {
    Order::Reset { seeds: seed.into(), levels: Some(levels) }
}

#[test]
fn a_lane_begins_with_levels_or_refuses_all_of_them() {
    let dir = TestDir::new();
    let fields = Some(FIELDS.iter().map(|spec| spec.name.to_owned()).collect());
    let plan = PoolPlan::new([LanePlan { fields, ..LanePlan::new("3m", 3) }]).threads(2);
    let _pool = dir.start(&plan);
    let mut client = dir.client();
    let wait = || WaitOptions { timeout: Some(std::time::Duration::from_secs(5)), ..WaitOptions::forever() };
    let first = client.reset(Some(1), None, wait()).expect("a batch");
    let mut levels = first.field::<f32>(Field::Level).expect("the lane has it").to_vec();
    drop(first);
    let size = levels.len() / 3;
    levels[2 * size + 1] = 11.0;
    let moved = client.request(to(&levels, Some(5)), None, wait()).expect("a batch");
    assert_eq!(moved.field::<f32>(Field::Level), Some(&*levels));
    drop(moved);
    // Some environments; the others are unchanged.
    levels[1] = 12.0;
    let one = client.request(to(&levels[..size], None), Some(&[0]), wait()).expect("a batch");
    assert_eq!(one.field::<f32>(Field::Level), Some(&*levels));
    drop(one);
    let mut bad = levels.clone();
    bad[size + 4] = 2.0;
    let error = client.request(to(&bad, None), None, wait()).expect_err("a refusal").to_string();
    assert_eq!(error, "environment 1 cannot begin with this level: alive of agent 0 must be 0 or 1, got 2");
    let error = client.request(to(&bad[1..], None), None, wait()).expect_err("a refusal").to_string();
    assert!(error.starts_with("got 89 numbers; 3 environments take 3 levels of 30 numbers"), "{error}");
    let after = client.reset(None, Some(&[1]), wait()).expect("the lane goes on");
    assert_eq!(after.field::<f32>(Field::Level).expect("levels")[1], 12.0, "nothing had changed");
}

/// The client once took every environment for one that works on the refused reset: an environment stayed busy
/// until all were reset. A refused reset of all drops the results of earlier requests, as an accepted one
/// does, and a refused request to some environments leaves those of the others alone.
#[test]
fn after_a_refused_request_the_lane_and_its_learner_agree() {
    for is_local in [true, false] {
        let dir = TestDir::new();
        let fields = Some(FIELDS.iter().map(|spec| spec.name.to_owned()).collect());
        let plan = PoolPlan::new([LanePlan { fields, batch_size: 2, ..LanePlan::new("3m", 4) }]).threads(1);
        let pool = dir.start(&plan);
        let connect = || pool.connect(None, WaitStrategy::default()).expect("a client");
        let mut client = if is_local { connect() } else { dir.client() };
        let wait =
            || WaitOptions { timeout: Some(std::time::Duration::from_secs(5)), ..WaitOptions::forever() };
        let recv = |client: &mut Client| {
            let batch = client.recv(wait()).expect("a batch");
            let mut envs = batch.env_id().to_vec();
            envs.sort_unstable();
            (envs, batch.field::<f32>(Field::Level).expect("the lane has it").to_vec())
        };
        let stop = Order::Step(&[1; 3]);
        let step =
            |client: &mut Client, env: i32| client.send(stop, Some(&[env]), wait()).expect("it is idle");
        // Before the first reset a refused one leaves a lane that was not reset.
        let refuse = |client: &mut Client, bad: &[f32]| {
            let error = client.request(to(bad, None), None, wait()).expect_err("a refusal").to_string();
            assert!(error.starts_with("environment 0 cannot begin with this level"), "{error}");
        };
        let mut bad = vec![2.0; 4 * client.layout().level_len()];
        refuse(&mut client, &bad);
        let error = client.send(stop, Some(&[0]), wait()).expect_err("it was not reset").to_string();
        assert!(error.starts_with("no environment was reset"), "{error}");
        client.send(Order::reset(Some(1)), None, wait()).expect("sent");
        let ((_, levels), (_, rest)) = (recv(&mut client), recv(&mut client));
        let size = levels.len() / 2;
        bad = [levels, rest].concat();
        bad[4] = 2.0; // whether agent 0 is alive must be 0 or 1
        // A result that does not fill a batch, and a batch that comes before the refusal.
        step(&mut client, 0);
        refuse(&mut client, &bad);
        let error = client.recv(wait()).expect_err("nothing is outstanding").to_string();
        assert!(error.contains(", 0 are outstanding"), "{error}");
        (0..3).for_each(|env| step(&mut client, env));
        refuse(&mut client, &bad);
        (2..4).for_each(|env| step(&mut client, env));
        assert_eq!(recv(&mut client).0, [2, 3]);
        // Two resets at once.
        step(&mut client, 0);
        client.send(to(&bad, None), None, wait()).expect("sent");
        refuse(&mut client, &bad);
        (0..2).for_each(|env| step(&mut client, env));
        assert_eq!(recv(&mut client).0, [0, 1]);
        // Requests to one environment, which leave the results of another alone.
        step(&mut client, 2);
        assert!(
            client.request(to(&bad[..size], None), Some(&[3]), wait()).is_err(),
            "a level that cannot be"
        );
        let snapshot = vec![0; client.layout().snapshot_size()];
        let restore = Order::Restore { snapshots: &snapshot, seeds: Seeds::Continue };
        assert!(client.request(restore, Some(&[3]), wait()).is_err(), "no snapshot");
        step(&mut client, 3);
        assert_eq!(recv(&mut client).0, [2, 3]);
    }
}
