//! Rows of scenarios say the same in the one form.

use super::*;
use smaclite_scenarios::Smacv2;

/// What types are: health, shield, armour, range, speed, radius, damage of an attack, cooldown; whether they
/// heal, hit in a line, explode; their plane; and which planes they hit.
#[test]
fn types_are_their_figures() {
    let check = |unit: &UnitType, numbers: [f32; 8], is: [u8; 8]| {
        let expected = numbers.into_iter().chain(is.map(f32::from)).collect::<Vec<_>>();
        assert_eq!(figures(unit).to_vec(), expected, "{unit:?}");
    };
    let standard = |name| UnitType::standard(name).unwrap();
    let marine = [0.45, 0.0, 0.0, 1.0, 1.05, 0.375, 0.3, 0.305];
    check(&standard("MARINE"), marine, [0, 0, 0, 1, 0, 0, 1, 1]);
    check(&standard("MEDIVAC"), [1.5, 0.0, 0.5, 0.8, 3.5 / 3.0, 0.75, 0.0, 0.0], [1, 0, 0, 0, 1, 0, 0, 0]);
    let colossus = UnitType { plane: Plane::Colossus, ..standard("COLOSSUS") };
    check(&colossus, [2.0, 1.5, 0.5, 1.4, 1.05, 1.0, 1.0, 0.535], [0, 1, 0, 0, 0, 1, 1, 0]);
    check(&standard("BANELING"), [0.3, 0.0, 0.0, 0.05, 1.05, 0.375, 4.0, 0.5], [0, 0, 1, 1, 0, 0, 1, 0]);
}

/// The row of the form that is M x + m, where x is `row` of the scenario.
fn in_the_form(map: &RowMap, row: &[f32]) -> Vec<f32> {
    let [width, columns] = map.widths();
    assert_eq!(row.len(), columns);
    let one = |i, j| if i == j { 1.0 } else { 0.0 };
    let identity: Vec<f32> = (0..width).flat_map(|i| (0..width).map(move |j| one(i, j))).collect();
    let (mut m, mut constant) = (vec![f32::NAN; width * columns], vec![f32::NAN; width]);
    map.forward([&identity, &vec![0.0; width]], [&mut m, &mut constant]);
    let product = |m: &[f32]| m.iter().zip(row).map(|(m, x)| m * x).sum::<f32>();
    m.chunks_exact(columns).zip(constant).map(|(m, constant)| product(m) + constant).collect()
}

fn of_type(name: &str) -> [f32; FIGURES] {
    figures(&UnitType::standard(name).unwrap())
}

#[test]
fn rows_say_the_same_in_the_form() {
    let concat = |parts: &[&[f32]]| parts.concat();
    let obs = UniversalForm::of_obs(2);
    assert_eq!(obs.widths(), [6 + 16, 6 + 16, 8 + 16 + 2 * 7]);

    // Without shields and types: what all units are stands in m.
    let of_3m = obs.rows(&Scenario::standard("3m").unwrap()).unwrap();
    let seen = [1.0, 0.5, 0.25, -0.25, 0.75];
    assert_eq!(in_the_form(&of_3m.enemies, &seen), concat(&[&seen, &[0.0], &of_type("MARINE")]));
    // Moves, health, and two last actions: to stop, and to attack the second enemy.
    let mut own = vec![1.0, 0.0, 1.0, 0.0, 0.75];
    let actions = |action: usize| (0..9).map(move |other| f32::from(u8::from(other == action)));
    own.extend(actions(action::STOP).chain(actions(FIRST_TARGET + 1)));
    let last_actions = [[0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]].concat();
    let expected = concat(&[&own[..5], &[0.0; 3], &of_type("MARINE"), &last_actions]);
    assert_eq!(in_the_form(&of_3m.rest, &own), expected);

    let state = UniversalForm::of_state();
    assert_eq!(state.widths(), [4 + 16, 5 + 16 + 7, 0]);
    let of_2s3z = state.rows(&Scenario::standard("2s3z").unwrap()).unwrap();
    let enemy = [0.5, 0.1, -0.1, 1.0, 0.0, 1.0]; // health, x, y, shield, and that it is a zealot
    assert_eq!(in_the_form(&of_2s3z.enemies, &enemy), concat(&[&enemy[..4], &of_type("ZEALOT")]));
    // Health, cooldown, x, y, shield, a stalker, and it went to the north.
    let mut agent = vec![0.5, 0.3, 0.1, -0.1, 1.0, 1.0, 0.0];
    agent.extend((0..11).map(|other| f32::from(u8::from(other == action::NORTH))));
    let north = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
    let expected = concat(&[&[0.5, 0.1, -0.1, 1.0, 0.3], &of_type("STALKER"), &north]);
    assert_eq!(in_the_form(&of_2s3z.allies, &agent), expected);
    assert_eq!(of_2s3z.rest, RowMap::default(), "the state has nothing else");
}

/// Both are linear: <forward p, g> = <p, backward g> for all p and g, here of whole numbers.
#[test]
fn gradients_come_back_by_the_transpose() {
    let map = RowMap {
        width: 4,
        columns: vec![vec![(0, 1.0)], vec![(1, 2.0), (3, -3.0)], vec![]],
        constant: vec![(1, 5.0), (2, 1.0)],
    };
    let numbers = |n: usize, step: usize| (0..n).map(|i| (i * step % 11) as f32 - 4.0).collect::<Vec<_>>();
    let (weight, bias, of_weight, of_bias) = (numbers(8, 3), numbers(2, 5), numbers(6, 7), numbers(2, 4));
    let (mut to_weight, mut to_bias) = (vec![0.0; 6], vec![0.0; 2]);
    map.forward([&weight, &bias], [&mut to_weight, &mut to_bias]);
    // Added to what is there.
    let (mut back, mut bias_back) = (vec![100.0; 8], vec![10.0; 2]);
    map.backward([&of_weight, &of_bias], [&mut back, &mut bias_back]);
    back.iter_mut().for_each(|gradient| *gradient -= 100.0);
    bias_back.iter_mut().for_each(|gradient| *gradient -= 10.0);
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
    let there = dot(&to_weight, &of_weight) + dot(&to_bias, &of_bias);
    let here = dot(&weight, &back) + dot(&bias, &bias_back);
    assert!(there == here && there != 0.0, "{there} {here}");
    assert_eq!((back[1], bias_back[0]), (2.0 * of_weight[1] + 5.0 * of_bias[0], of_bias[0]));
}

#[test]
fn a_first_part_of_a_row_stays_as_it_is() {
    assert_eq!(in_the_form(&RowMap::prefix(2, 3), &[7.0, 8.0]), [7.0, 8.0, 0.0]);
}

#[test]
fn what_has_no_place_in_the_form_is_refused() {
    let refusal = |form: UniversalForm, change: fn(&mut Scenario)| {
        let mut scenario = Scenario::standard("MMM").unwrap();
        change(&mut scenario);
        form.rows(&scenario).expect_err("a refusal").to_string()
    };
    let obs = || UniversalForm::of_obs(0);
    assert_eq!(refusal(obs(), |s| s.num_unit_types = 0), "observations do not say the types of units");
    let same = |s: &mut Scenario| s.type_ids = vec![0; s.unit_types.len()];
    assert_eq!(refusal(obs(), same), "`type_0` stands for types with other figures");
    let looks = |s: &mut Scenario| s.smacv2 = Some(Smacv2 { conic_fov: true, ..Smacv2::default() });
    assert_eq!(refusal(obs(), looks), "agents have actions to look");
    let blind = |s: &mut Scenario| s.smacv2 = Some(Smacv2 { obs_starcraft: false, ..Smacv2::default() });
    assert_eq!(refusal(obs(), blind), "observations have no units");
    let clock =
        |s: &mut Scenario| s.smacv2 = Some(Smacv2 { state_timestep_number: true, ..Smacv2::default() });
    let unknown = refusal(UniversalForm::of_state(), clock);
    assert!(unknown.starts_with("it does not know the feature `"), "{unknown}");
    // A number that no type has is never seen.
    let mut scenario = Scenario::standard("MMM").unwrap();
    scenario.num_unit_types += 1;
    assert!(obs().rows(&scenario).is_ok());
}
