//! A snapshot that was edited, with a valid checksum: it is refused with a reason, or the battle is played
//! on with finite numbers, and stays in the ranges of snapshots. A fuzzer does not find the checksum, and
//! seldom all other bytes of a record, so its bytes say what changes: the scenario, how many steps are
//! played, then places and bytes.

use smaclite_engine::policy::Random;
use smaclite_engine::{Arena, Battle, Faction, RecordLayout, RecordSizes, Rules, Scratch, Snapshot};
use smaclite_scenarios::Scenario;
use std::sync::{Arc, LazyLock};

/// Healers and shields, beams, enemies first, many units, SMACv2's interface, phases of attacks.
const SCENARIOS: [(&str, Rules); 8] = [
    ("MMM", Rules::Smaclite),
    ("2s3z", Rules::Smaclite),
    ("bane_vs_bane", Rules::Smaclite),
    ("corridor", Rules::Smaclite),
    ("25m", Rules::Smaclite),
    ("terran_5_vs_5", Rules::Smaclite),
    ("MMM", Rules::Starcraft),
    ("2c_vs_64zg", Rules::Starcraft),
];

/// A battle of each scenario in its tenth step.
static BATTLES: LazyLock<Vec<Battle>> = LazyLock::new(|| SCENARIOS.map(begun).into());

fn begun((name, rules): (&str, Rules)) -> Battle {
    let scenario = Scenario::resolve(name).expect("a standard scenario");
    let mut battle = Battle::new(Arc::new(Arena::new(&scenario, rules)), 1);
    play(&mut battle, 10);
    battle
}

fn play(battle: &mut Battle, steps: usize) {
    let (mut policy, mut scratch) = (Random::new(2), Scratch::new());
    let sizes = battle.arena().sizes();
    let mut actions = vec![0; sizes.n_agents];
    let mut obs = vec![f32::NAN; sizes.n_agents * sizes.obs_size];
    let mut state = vec![f32::NAN; sizes.state_size];
    for _ in 0..steps {
        policy.act(battle, &mut actions);
        let step = battle.step(&actions, &mut scratch).expect("legal actions");
        battle.write_obs(Faction::Ally, &mut obs, &mut scratch);
        battle.write_state(Faction::Ally, &mut state);
        assert!(step.reward.is_finite() && (battle.episode_return() as f32).is_finite(), "{step:?}");
        assert!(obs.iter().chain(&state).all(|x| x.is_finite()), "{obs:?} {state:?}");
        assert_eq!(battle.save().check(battle.arena()), Ok(()), "a battle left the ranges");
    }
}

pub fn run(bytes: &[u8]) {
    let [scenario, steps, edits @ ..] = bytes else { return };
    let mut battle = BATTLES[usize::from(*scenario) % SCENARIOS.len()].clone();
    let arena = Arc::clone(battle.arena());
    let layout = RecordLayout::new(RecordSizes::new(&arena.sizes(), 0));
    let mut record = vec![0; layout.size()];
    battle.write_record(&layout, &[], &mut record);
    // What is before says which battle it is.
    let first = RecordLayout::START_OF_VALUES;
    for edit in edits.chunks_exact(10) {
        let at = first + usize::from(u16::from_le_bytes([edit[0], edit[1]])) % (layout.size() - first);
        // Eight bytes, so that a whole number is replaced at once.
        for (byte, new) in record[at..].iter_mut().zip(&edit[2..]) {
            *byte = *new;
        }
    }
    layout.seal(&mut record);
    let mut snapshot = Snapshot::default();
    match snapshot.read_record(&arena, 0, &record, &mut Vec::new()) {
        Err(error) => assert!(!error.to_string().is_empty()),
        Ok(()) => {
            battle.restore(&snapshot).expect("it was checked");
            play(&mut battle, usize::from(*steps % 4));
        }
    }
}
