//! Snapshots of battles as records: what is written, what is refused, and that battles go on from them with
//! the bits that they would have had. Those of pools are in `pools/branching.rs`.

use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use smaclite_engine::policy::Random;
use smaclite_engine::{
    Arena, Battle, BattleSetup, COLUMNS, Column, ColumnSpec, Dtype, Opponent, RecordLayout, RecordSizes,
    Rules, Scratch, Sides, Snapshot,
};
use smaclite_scenarios::{Capability, EnemyMask, Faction, Placement, Scenario, ScenarioFiles, UnitFile};
use std::sync::Arc;
use xxhash_rust::xxh3::Xxh3;

#[test]
fn a_snapshot_of_another_rule_set_is_an_error() {
    let scenario = Scenario::resolve("2s3z").expect("a standard scenario");
    let arenas = Rules::ALL.map(|rules| Arc::new(Arena::new(&scenario, rules)));
    for (of, other) in [(0, 1), (0, 2), (2, 0)].map(|(of, other)| (&arenas[of], &arenas[other])) {
        let layout = RecordLayout::new(RecordSizes::new(&of.sizes(), 0));
        let mut record = vec![0; layout.size()];
        Battle::new(of.clone(), 1).write_record(&layout, &[], &mut record);
        let read = Snapshot::default().read_record(other, 0, &record, &mut Vec::new());
        let (given, expected) = (of.rules(), other.rules());
        let message = format!("the snapshot is of rules `{given}`, and the battle has rules `{expected}`");
        assert_eq!(read.expect_err("other rules").to_string(), message);
    }
}

/// Snapshots name their scenario by a hash of what it consists of, as text. A change of the hash refuses what
/// users stored: where it cannot be left out, raise `RECORD_VERSION`, so that the error says why.
#[test]
fn the_hashes_of_standard_scenarios_stay() {
    let mut all = Xxh3::new();
    for name in Scenario::standard_names().chain(Scenario::generated_names()) {
        let scenario = Scenario::resolve(name).expect("a standard scenario");
        for rules in Rules::ALL {
            all.update(&Arena::new(&scenario, rules).scenario_hash().to_le_bytes());
        }
    }
    assert_eq!(format!("{:016x}", all.digest()), "fcfed2f117c1dc16");
}

/// Steps with legal actions that depend on the state only.
fn play(battle: &mut Battle, steps: usize, scratch: &mut Scratch) {
    let mut actions = vec![0; battle.arena().sizes().n_agents];
    for step in 0..steps {
        if battle.is_over() {
            battle.reset();
        }
        for (agent, action) in actions.iter_mut().enumerate() {
            let legal: Vec<usize> =
                (0..battle.arena().sizes().n_actions).filter(|a| battle.is_available(agent, *a)).collect();
            *action = legal[(step * 7 + agent * 3) % legal.len()] as i32;
        }
        battle.step(&actions, scratch).expect("legal actions");
    }
}

fn record_layout(arena: &Arena) -> RecordLayout {
    RecordLayout::new(RecordSizes::new(&arena.sizes(), 0))
}

#[test]
fn every_map_continues_from_its_records_with_the_same_bits() {
    let mut scratch = Scratch::new();
    for name in Scenario::standard_names() {
        let scenario = Scenario::resolve(name).expect("a standard scenario");
        let arena = Arc::new(Arena::new(&scenario, Rules::Smaclite));
        let layout = record_layout(&arena);
        let mut battle = Battle::new(Arc::clone(&arena), 4);
        let mut other = Battle::new(Arc::clone(&arena), 5);
        let (mut snapshot, mut past) = (Snapshot::default(), Vec::new());
        for _ in 0..4 {
            play(&mut battle, 17, &mut scratch);
            let mut record = vec![0xaa; layout.size()];
            battle.write_record(&layout, &[], &mut record);
            snapshot.read_record(&arena, 0, &record, &mut past).expect("a record of this arena");
            assert_eq!(snapshot, battle.save(), "{name}");
            let mut again = vec![0; layout.size()];
            snapshot.write_record(&arena, &layout, &past, &mut again);
            assert_eq!(record, again, "{name}");
            other.restore(&snapshot).expect("a snapshot of this arena");
            play(&mut other, 11, &mut scratch);
            let mut same = battle.clone();
            play(&mut same, 11, &mut scratch);
            assert_eq!(same.save(), other.save(), "{name}");
        }
    }
}

/// Of enemies that a script plays, a lane of both sides keeps no-ops, which a record has not when it was read
/// and written again in an arena of one side, as by Python's `pack_snapshot`.
#[test]
fn a_record_is_the_same_when_it_is_written_again_for_every_opponent() {
    let scenario = Scenario::standard("3m").expect("a standard scenario");
    let arena = |sides| Arc::new(Arena::new(&scenario, Rules::Smaclite).with_sides(sides));
    for (opponent, enemies, sides) in
        [(Opponent::Learner, 1, Sides::Mirrored), (Opponent::AttackMove, 0, Sides::Allies)]
    {
        let mut battle = Battle::new(arena(Sides::Mirrored), 1);
        battle.reset_against(opponent);
        let actions = [[1; 3], [enemies; 3]].concat();
        battle.step(&actions, &mut Scratch::new()).expect("all may stop");
        let layout = RecordLayout::new(RecordSizes::new(&battle.arena().sizes(), 2));
        let mut record = vec![0; layout.size()];
        battle.write_record(&layout, &actions, &mut record);
        let arena = arena(sides);
        let (snapshot, past) = Snapshot::of_edited_record(&arena, 2, &record).expect("our own record");
        let mut again = vec![0; layout.size()];
        snapshot.write_record(&arena, &layout, &past, &mut again);
        let differs = |spec: &&ColumnSpec| {
            spec.column != Column::Checksum
                && layout.column(&again, spec.column) != layout.column(&record, spec.column)
        };
        let differing: Vec<_> = COLUMNS.iter().filter(differs).map(|spec| spec.name).collect();
        assert_eq!(differing, [""; 0], "{opponent:?}");
    }
}

/// A learner can send any bytes. What is edited and sealed again is below, and in `inputs`.
#[test]
fn a_record_that_is_cut_or_damaged_is_refused() {
    let scenario = Scenario::resolve("MMM").expect("a standard scenario");
    let arena = Arc::new(Arena::new(&scenario, Rules::Smaclite));
    let layout = record_layout(&arena);
    let mut good = vec![0; layout.size()];
    Battle::new(Arc::clone(&arena), 4).write_record(&layout, &[], &mut good);
    let refusal = |record: &[u8]| {
        let read = Snapshot::default().read_record(&arena, 0, record, &mut Vec::new());
        read.expect_err("a damaged record").to_string()
    };
    for at in 0..good.len() {
        assert!(!refusal(&good[..at]).is_empty());
        let mut damaged = good.clone();
        damaged[at] ^= 1 << (at % 8);
        assert!(!refusal(&damaged).is_empty());
        // A seal mends the checksum, and not what the record is of.
        if (8..RecordLayout::START_OF_VALUES).contains(&at) {
            layout.seal(&mut damaged);
            assert!(!refusal(&damaged).is_empty());
        }
    }
}

/// All 38 maps, the generated ones with everything that draws and hides, too.
fn every_arena() -> Vec<Arc<Arena>> {
    let names = Scenario::standard_names().chain(Scenario::generated_names());
    let mut all: Vec<Scenario> =
        names.map(|name| Scenario::resolve(name).expect("a standard scenario")).collect();
    let generated: Vec<Scenario> =
        Scenario::generated_names().map(|name| Scenario::resolve(name).expect("a scenario")).collect();
    for (i, mut scenario) in generated.into_iter().enumerate() {
        let capability =
            |lower_bound, upper_bound| Some(Capability { lower_bound, upper_bound, observe: true });
        let options = scenario.smacv2.as_mut().expect("options");
        options.attack = capability(0.3, 0.9);
        options.health = capability(0.1, 0.4);
        options.enemy_mask = Some(EnemyMask { mask_probability: 0.5 });
        options.conic_fov = i % 2 == 0;
        options.fully_observable = i % 3 == 0;
        options.published = i % 3 == 1;
        options.obs_own_pos = true;
        options.obs_timestep_number = true;
        options.obs_instead_of_state = i % 5 == 0;
        all.push(scenario);
    }
    all.iter().map(|scenario| Arc::new(Arena::new(scenario, Rules::Smaclite))).collect()
}

/// The ranges of snapshots are closed under the rules: what a battle reaches can be restored.
#[test]
fn every_state_of_a_battle_passes_the_checkpoint() {
    let (mut scratch, mut policy) = (Scratch::new(), Random::new(3));
    for arena in every_arena() {
        let layout = record_layout(&arena);
        let mut record = vec![0; layout.size()];
        let mut battle = Battle::new(Arc::clone(&arena), 8);
        let mut actions = vec![0; arena.sizes().n_agents];
        let mut snapshot = Snapshot::default();
        for _ in 0..150 {
            policy.act(&battle, &mut actions);
            battle.step(&actions, &mut scratch).expect("legal actions");
            battle.write_record(&layout, &[], &mut record);
            snapshot.read_record(&arena, 0, &record, &mut Vec::new()).expect("a state of a battle");
            assert_eq!(snapshot, battle.save());
            if battle.is_over() {
                battle.reset();
            }
        }
    }
}

/// Values that no battle has, or just could have.
fn extreme(column: &ColumnSpec, rng: &mut Pcg64) -> Vec<u8> {
    let f64s = [f64::NAN, f64::INFINITY, -0.0, 5e-324, 1e-310, 1.7e308, -1.0, 1e30, 1e36, 1e16, 0.0, 0.5];
    let f32s =
        [f32::NAN, f32::NEG_INFINITY, 3.0e38, -3.4e38, 1e19, 1e-45, -0.0, 1e9, -1.0, 47.9, 48.1, 1.9e6];
    let ints = [-2, -1, 0, 1, 5, 6, 100, i32::MAX, i32::MIN];
    let words = [0, 1, 2, 10, 1 << 31, u64::MAX, 1 << 63, 1.7e308_f64.to_bits(), 0.5_f64.to_bits()];
    match column.dtype {
        Dtype::F64 => f64s.choose(rng).expect("one").to_le_bytes().to_vec(),
        Dtype::F32 => f32s.choose(rng).expect("one").to_le_bytes().to_vec(),
        Dtype::I32 => ints.choose(rng).expect("one").to_le_bytes().to_vec(),
        Dtype::U32 => (*words.choose(rng).expect("one") as u32).to_le_bytes().to_vec(),
        Dtype::U64 => words.choose(rng).expect("one").to_le_bytes().to_vec(),
        Dtype::U8 | Dtype::Bool => vec![rng.random_range(0..3)],
    }
}

/// Sets one, several or all values of a column to an extreme one, or exchanges two.
fn edit(layout: &RecordLayout, record: &mut [u8], rng: &mut Pcg64) {
    let column = COLUMNS[rng.random_range(Column::NKnown as usize..COLUMNS.len())];
    let bytes = layout.column_mut(record, column.column);
    let (size, share) = (column.dtype.size(), *[0.1, 0.5, 1.0].choose(rng).expect("one"));
    let value = extreme(&column, rng);
    for element in bytes.chunks_exact_mut(size) {
        if rng.random_bool(share) {
            element.copy_from_slice(&value);
        }
    }
}

/// A snapshot with a position of 3e38 was accepted, and the next step took memory until the machine died. A
/// cooldown of 1.7e308 and the greatest return of SMACv2's interface gave numbers that are not finite.
#[test]
fn edited_snapshots_are_refused_or_played_with_finite_numbers() {
    let (mut scratch, mut rng) = (Scratch::new(), Pcg64::seed_from_u64(7));
    let (mut refused, mut played) = (0, 0);
    for arena in every_arena().iter().step_by(3) {
        let (layout, sizes) = (record_layout(arena), arena.sizes());
        let mut battle = Battle::new(Arc::clone(arena), 4);
        play(&mut battle, 9, &mut scratch);
        let mut good = vec![0; layout.size()];
        battle.write_record(&layout, &[], &mut good);
        let mut obs = vec![0.0; sizes.n_agents * sizes.obs_size];
        let mut state = vec![0.0; sizes.state_size];
        for _ in 0..300 {
            let mut record = good.clone();
            (0..rng.random_range(1..3)).for_each(|_| edit(&layout, &mut record, &mut rng));
            layout.seal(&mut record);
            let mut snapshot = Snapshot::default();
            if let Err(error) = snapshot.read_record(arena, 0, &record, &mut Vec::new()) {
                assert!(!error.to_string().is_empty());
                refused += 1;
                continue;
            }
            battle.restore(&snapshot).expect("it was checked");
            for _ in 0..4 {
                battle.write_obs(Faction::Ally, &mut obs, &mut scratch);
                battle.write_state(Faction::Ally, &mut state);
                assert!(obs.iter().chain(&state).all(|x| x.is_finite()), "{snapshot:?}");
                assert!((battle.episode_return() as f32).is_finite(), "{snapshot:?}");
                play(&mut battle, 1, &mut scratch);
                assert_eq!(battle.save().check(arena), Ok(()), "a battle leaves the ranges");
            }
            played += 1;
        }
    }
    assert!(refused > 500 && played > 500, "{refused} refused, {played} played");
}

#[test]
fn a_value_out_of_range_is_named_with_its_column_unit_and_range() {
    type Change = (&'static str, fn(&mut Snapshot));
    let arena = Arc::new(Arena::new(&Scenario::resolve("25m").expect("a scenario"), Rules::Smaclite));
    let refused = |change: fn(&mut Snapshot)| {
        let mut battle = Battle::new(Arc::clone(&arena), 1);
        let before = battle.save();
        let mut snapshot = before.clone();
        change(&mut snapshot);
        let error = battle.restore(&snapshot).expect_err("no battle has this").to_string();
        assert_eq!(battle.save(), before, "a refused snapshot must change nothing: {error}");
        error
    };
    let check = |change: fn(&mut Snapshot), expected: &str| assert_eq!(refused(change), expected);
    check(
        |snapshot| snapshot.units.pos[7].x = 1e9,
        "snapshot column 'pos' must be between -16 and 48 for unit 7, got 1000000000",
    );
    check(
        |snapshot| snapshot.units.cooldown[3] = 1.5,
        "snapshot column 'cooldown' must be between 0 and 0.61 for unit 3, got 1.5",
    );
    check(
        |snapshot| snapshot.units.shield_cooldown[0] = 11.0,
        "snapshot column 'shield_cooldown' must be between 0 and 10 for unit 0, got 11",
    );
    check(
        |snapshot| snapshot.episode_return = 1.7e308,
        "snapshot column 'episode_return' must be between -1e36 and 1e36, got 1.7e308",
    );
    check(
        |snapshot| snapshot.units.hp[7] = 0.0, // it was dead for some rules, and alive for others
        "snapshot column 'hp' must be above 0 for unit 7, which is alive, got 0",
    );
    let others: [Change; 13] = [
        ("hp", |snapshot| snapshot.units.hp[7] = -1.0),
        ("shield", |snapshot| snapshot.units.shield[7] = f64::NAN),
        ("energy", |snapshot| snapshot.units.energy[7] = f64::INFINITY),
        ("healing", |snapshot| snapshot.units.healing[7] = -1.0),
        ("pos", |snapshot| snapshot.units.pos[7].y = f32::NAN),
        ("vel", |snapshot| snapshot.units.vel[7].y = f32::NAN),
        ("planned_vel", |snapshot| snapshot.units.planned_vel[7].x = f32::INFINITY),
        ("episode_return", |snapshot| snapshot.episode_return = f64::NAN),
        ("target", |snapshot| snapshot.units.target[7] = Some(50)),
        ("alive", |snapshot| snapshot.units.alive.truncate(49)),
        ("pos", |snapshot| snapshot.units.pos.push(glam::Vec2::ZERO)),
        ("declared", |snapshot| snapshot.units.declared.truncate(49)),
        ("neighbour_rank", |snapshot| snapshot.neighbour_order.planes[0].by_number.push(0)),
    ];
    for (column, change) in others {
        let error = refused(change);
        assert!(error.contains(&format!("'{column}'")), "{error}");
    }
}

/// The columns of snapshots were in the order of the file's groups, which is enemies first in corridor and
/// other maps, and documented as agents first.
#[test]
fn the_columns_of_a_snapshot_are_agents_first_on_every_map() {
    let mut scratch = Scratch::new();
    for name in Scenario::standard_names() {
        let scenario = Scenario::resolve(name).expect("a standard scenario");
        let arena = Arc::new(Arena::new(&scenario, Rules::Smaclite));
        let (layout, sizes) = (record_layout(&arena), arena.sizes());
        let mut battle = Battle::new(Arc::clone(&arena), 4);
        play(&mut battle, 20, &mut scratch);
        let mut record = vec![0; layout.size()];
        battle.write_record(&layout, &[], &mut record);
        let of = |place: usize| {
            let (agents, id) = (sizes.n_agents, place.checked_sub(sizes.n_agents));
            let faction = if place < agents { Faction::Ally } else { Faction::Enemy };
            let is_it =
                |unit: &&Placement| unit.faction == faction && unit.id_in_faction == id.unwrap_or(place);
            scenario.units.iter().position(|unit| is_it(&unit)).expect("a unit")
        };
        let hp: Vec<f64> = numbers(&layout, &record, Column::Hp, f64::from_le_bytes);
        let types: Vec<u32> = numbers(&layout, &record, Column::UnitType, u32::from_le_bytes);
        let targets: Vec<i32> = numbers(&layout, &record, Column::Target, i32::from_le_bytes);
        let units = battle.units();
        for place in 0..sizes.n_units() {
            let id = of(place);
            assert_eq!(hp[place], units.hp[id], "{name}");
            assert_eq!(types[place] as usize, scenario.units[id].unit_type, "{name}");
            let target = usize::try_from(targets[place]).ok().map(|place| of(place) as u32);
            assert_eq!(target, units.target[id], "{name}");
        }
        // Killing the first unit of the columns kills agent 0.
        layout.column_mut(&mut record, Column::Alive)[0] = 0;
        layout.seal(&mut record);
        let (edited, _) = Snapshot::of_edited_record(&arena, 0, &record).expect("one unit less");
        battle.restore(&edited).expect("a state of this map");
        let mut alive = vec![1; sizes.n_agents];
        battle.write_alive(Faction::Ally, &mut alive);
        assert_eq!(alive[0], 0, "{name}");
    }
}

fn numbers<T, const N: usize>(
    layout: &RecordLayout,
    record: &[u8],
    column: Column,
    read: fn([u8; N]) -> T,
) -> Vec<T> {
    layout.column(record, column).as_chunks().0.iter().map(|bytes| read(*bytes)).collect()
}

/// What units are pushed or overshoot off the map stops at its margin, so that positions have a range.
#[test]
fn no_unit_leaves_the_margin_of_the_map() {
    let (_, files) = ScenarioFiles::resolve("3m").expect("a scenario");
    let hare = include_str!("../../units/data/MARINE.json").replace("\"speed\": 3.15", "\"speed\": 1e6");
    assert!(hare.contains("1e6"), "{hare}");
    let unit_files = vec![UnitFile { name: "hare".into(), keys: vec!["hare".into()], text: hare }];
    let text = files.text.replace("MARINE", "hare");
    let scenario = ScenarioFiles { text, unit_files, ..files }.scenario().expect("a scenario");
    let arena = Arc::new(Arena::new(&scenario, Rules::Smaclite));
    let (mut battle, mut scratch) = (Battle::new(Arc::clone(&arena), 1), Scratch::new());
    let mut farthest = 0.0_f32;
    for _ in 0..40 {
        play(&mut battle, 1, &mut scratch);
        farthest = battle.units().pos.iter().map(|pos| pos.max_element()).fold(farthest, f32::max);
        assert_eq!(battle.save().check(&arena), Ok(()));
    }
    assert!((32.0..=48.0).contains(&farthest), "{farthest}");
}

/// It was over where it was restored or copied, and not where it was drawn.
#[test]
fn a_battle_that_begins_with_healers_alone_is_not_over_before_its_step() {
    let text = r#"{"name": "drawn", "ally_has_shields": false, "enemy_has_shields": false,
        "terrain_preset": "FLAT", "episode_limit": 30, "start_positions": {"distribution": "surrounded"},
        "teams": {"distribution": "all_teams", "unit_types": ["MARINE", "MEDIVAC"]}, "num_unit_types": 0,
        "num_allied_units": 1, "num_enemy_units": 1, "smacv2": {}}"#;
    let files = ScenarioFiles { source: "drawn.json".into(), text: text.into(), unit_files: Vec::new() };
    let arena = Arc::new(BattleSetup::new(files).arena().unwrap().1);
    let mut scratch = Scratch::new();
    let mut of_healers = 0;
    for seed in 0..20 {
        let mut battle = Battle::new(Arc::clone(&arena), seed);
        let mut restored = Battle::new(Arc::clone(&arena), 99);
        let saved = battle.save();
        restored.restore(&saved).unwrap();
        assert!(!battle.is_over() && !restored.is_over() && !saved.is_over(&arena), "seed {seed}");
        let played = [&mut battle, &mut restored].map(|battle| battle.step(&[1], &mut scratch).unwrap());
        assert_eq!(played[0], played[1]);
        assert_eq!(battle.is_over(), battle.save().is_over(&arena));
        of_healers += u32::from(battle.is_over());
    }
    assert!(of_healers > 0, "no seed drew them");
}
