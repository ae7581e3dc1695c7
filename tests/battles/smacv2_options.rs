//! What single options of SMACv2's interface do, in battles of a few units. What they do together is compared
//! with recordings of the published code in `../smacv2`.

use std::sync::Arc;

use smaclite_engine::{
    Arena, Battle, ExecutionOrder, Faction, Rules, Scratch, TICKS_PER_STEP, Tick, action, obs_features,
};
use smaclite_scenarios::{Capability, EnemyMask, Scenario, Smacv2};

use crate::generated::{arena, duel, duel_of, seen};

const STOP: i32 = action::STOP as i32;

/// The features of an agent whose names begin so.
fn features(battle: &Battle, options: &Smacv2, agent: usize, begin: &str) -> Vec<f32> {
    let mut scenario = Scenario::standard("terran_5_vs_5").expect("a standard scenario");
    scenario.smacv2 = Some(options.clone());
    let sizes = battle.arena().sizes();
    let mut obs = vec![f32::NAN; sizes.n_agents * sizes.obs_size];
    battle.write_obs(Faction::Ally, &mut obs, &mut Scratch::new());
    let row = &obs[agent * sizes.obs_size..][..sizes.obs_size];
    let moves = &obs_features(&scenario)[0];
    let named = moves.features.iter().zip(&row[moves.start..]);
    named.filter(|(name, _)| name.starts_with(begin)).map(|(_, feature)| *feature).collect()
}

/// All squares of the map are open and of one height, 127 of 255; off the map they count as open, and as high
/// as can be. North, south, east and west are two moves away, the other squares one in each direction.
#[test]
fn agents_feel_the_ground_around_them() {
    const FLAT: f32 = 127.0 / 255.0;
    for (walkable, height) in [(true, false), (false, true), (true, true), (false, false)] {
        let mut options = None;
        let arena = arena("terran_5_vs_5", |all| {
            (all.obs_pathing_grid, all.obs_terrain_height, all.move_amount) = (walkable, height, 3.0);
            options = Some(all.clone());
        });
        let options = options.expect("options");
        // Four squares from the northern edge, and five from the eastern one.
        let battle = duel(&arena, &[[26.5, 27.5]], &[[1.0, 1.0]]);
        let open = if walkable { vec![1.0; 8] } else { vec![] };
        assert_eq!(features(&battle, &options, 0, "walkable_"), open);
        let (north, east) = (1.0, 1.0);
        let heights = [north, FLAT, east, FLAT, FLAT, FLAT, FLAT, FLAT, FLAT];
        let heights = if height { heights.to_vec() } else { vec![] };
        assert_eq!(features(&battle, &options, 0, "height_"), heights);
    }
}

/// Agents below their level of health die so many ticks before the end of a step, and not before.
#[test]
fn agents_below_their_level_die_at_their_tick() {
    for ticks_left in [1, 2, 5] {
        let arena = arena("terran_5_vs_5", |options| {
            options.health = Some(Capability { lower_bound: 0.99, upper_bound: 0.99, observe: true });
            options.kill_unit_step_mul = ticks_left;
        });
        // The first is shot at.
        let mut battle = duel(&arena, &[[16.0, 16.0], [2.0, 30.0]], &[[18.0, 16.0], [18.0, 17.0]]);
        let (mut actions, mut lived) = ([0; 5], Vec::new());
        (actions[0], actions[1]) = (STOP, STOP);
        let observe = |tick: Tick<'_>| lived.push(tick.units.alive[..2].to_vec());
        battle
            .step_observed(&actions, ExecutionOrder::Drawn, &mut Scratch::new(), observe)
            .expect("they stop");
        let dies = TICKS_PER_STEP - ticks_left as usize;
        let first: Vec<bool> = lived.iter().map(|alive| alive[0]).collect();
        assert_eq!(first, (0..TICKS_PER_STEP).map(|tick| tick < dies).collect::<Vec<_>>(), "{ticks_left}");
        assert!(lived.iter().all(|alive| alive[1]), "who is not hurt lives");
    }
}

/// Without cones sight ends before its range, and with them at it, as in the published code. The dead are not
/// seen; those that are absent lie half a square east of the agent.
#[test]
fn sight_ends_at_its_range() {
    for (cones, at_range) in [(false, false), (true, true)] {
        let arena =
            arena("terran_5_vs_5", |options| (options.conic_fov, options.num_fov_actions) = (cones, 4));
        let battle = duel(&arena, &[[0.5, 1.0]], &[[9.25, 1.0], [9.5, 1.0]]);
        assert_eq!(seen(&battle, 0), [true, at_range, false, false, false], "cones: {cones}");
        let battle = duel(&arena, &[[0.5, 1.0], [9.5, 1.0]], &[[30.0, 30.0]]);
        let sizes = arena.sizes();
        let mut obs = vec![f32::NAN; sizes.n_agents * sizes.obs_size];
        battle.write_obs(Faction::Ally, &mut obs, &mut Scratch::new());
        let scenario = Scenario::standard("terran_5_vs_5").expect("a standard scenario");
        let allies =
            obs_features(&scenario).into_iter().find(|block| block.name == "allies").expect("allies");
        assert_eq!(obs[allies.start] == 1.0, at_range, "cones: {cones}");
    }
}

#[test]
fn units_without_types_have_no_bits_of_types() {
    let mut scenario = Scenario::standard("3m").expect("a standard scenario");
    scenario.smacv2 = Some(Smacv2::default());
    let mut battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::Smaclite)), 1);
    battle.reset();
    let sizes = battle.arena().sizes();
    let mut obs = vec![f32::NAN; sizes.n_agents * sizes.obs_size];
    battle.write_obs(Faction::Ally, &mut obs, &mut Scratch::new());
    for row in obs.chunks_exact(sizes.obs_size) {
        // Moves, three enemies out of sight, two allies at hand, and the own health.
        assert_eq!(row[..4 + 3 * 5], [[1.0; 4].as_slice(), &[0.0; 15]].concat());
        assert!([19, 24].iter().all(|ally| row[*ally] == 1.0 && row[ally + 4] == 1.0));
        assert_eq!(row[29..], [1.0]);
    }
    let mut state = vec![f32::NAN; sizes.state_size];
    battle.write_state(Faction::Ally, &mut state);
    // Health, cooldown, and place; of enemies without a cooldown.
    assert!(state[..12].chunks_exact(4).all(|row| row[..2] == [1.0, 0.0]));
    assert!(state[12..21].chunks_exact(3).all(|row| row[0] == 1.0 && row[1] > 0.0));
}

/// Of 400 battles of two agents that see an enemy: who sees it first is drawn, and whether the other may. Six
/// standard deviations are 60.
#[test]
fn sight_attacks_and_masks_have_the_chances_of_their_options() {
    let arena = arena("terran_5_vs_5", |options| {
        options.prob_obs_enemy = 0.5;
        options.attack = Some(Capability { lower_bound: 0.25, upper_bound: 0.75, observe: true });
        options.enemy_mask = Some(EnemyMask { mask_probability: 0.25 });
    });
    let (mut blind, mut hits, mut masked, mut chances) = ([0_i32; 2], 0_i32, 0_i32, Vec::new());
    for seed in 0..400 {
        let mut battle = duel_of(&arena, seed, &[[10.0, 16.0], [10.0, 18.0]], &[[12.0, 16.0]]);
        let sees = [0, 1].map(|agent| seen(&battle, agent)[0]);
        assert!(sees[0] || sees[1], "the first to see it may see it");
        (0..2).for_each(|agent| blind[agent] += i32::from(!sees[agent]));
        let (_, _, perception) = battle.perceived().expect("an interface");
        masked += i32::from(perception.mask[0]);
        chances.push(perception.attack[0]);
        let mut actions = [0; 5];
        (actions[0], actions[1]) = (action::FIRST_TARGET as i32, STOP);
        let step = battle.step(&actions, &mut Scratch::new()).expect("an enemy in range");
        hits += i32::from(step.reward > 0.0);
    }
    assert!(blind.iter().all(|n| (n - 100).abs() < 60), "{blind:?}");
    assert!((hits - 200).abs() < 60, "{hits}");
    assert!((masked - 300).abs() < 60, "{masked}");
    assert!(chances.iter().all(|chance| (0.25..=0.75).contains(chance)));
    assert!(chances.iter().any(|chance| *chance < 0.3) && chances.iter().any(|chance| *chance > 0.7));
}
