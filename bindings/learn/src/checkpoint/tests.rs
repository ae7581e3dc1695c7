//! Tests of `checkpoint`: what is written is read, and what is damaged or foreign is refused.

use super::*;
use crate::config::{Activation, Config, Enemies, SelfPlay};
use crate::setups::resolve_scenario;
use crate::weights::{read_actor, write_weights};
use smaclite_engine::Rules;
use std::fs;

/// A run with these hyperparameters and small networks.
fn run(config: Config) -> RunDescription {
    let config = Config { num_envs: 3, last_actions: 0, hidden: vec![8], ..config };
    RunDescription::new(config, resolve_scenario("3m", Rules::default()).unwrap()).unwrap()
}

fn team(run: &RunDescription) -> Team {
    Team::new(&run.config, &run.inputs)
}

fn checkpoint(run: &RunDescription) -> Checkpoint {
    let mut team = team(run);
    team.observe_returns([1.0, 2.0].into_iter());
    team.actor.adam.mean.fill(0.25);
    team.critic.adam.steps = 7;
    let progress = Progress { updates: 3, steps: 500, episodes: 4, seconds: 1.5, cpu_seconds: 2.5 };
    let episode = Episode { episode_return: 3.5, length: 20, won: true };
    let recent = vec![Recent { ended: Ended { episode, against: Against::Script }, map: 0 }];
    let envs = Some(vec![SavedEnvs { snapshots: vec![5; 3 * 16], over: vec![0, 1, 0] }]);
    Checkpoint { team, progress, recent, envs, league: League::default() }
}

/// Each rival is the first team of another seed.
fn rival(of: &RunDescription, seed: u64) -> Network {
    team(&run(Config { seed, ..of.config.clone() })).actor
}

fn read_checkpoint(path: &Path, run: &RunDescription) -> Result<Checkpoint, FileError> {
    Checkpoint::read(path, run, &mut |seed| Ok(rival(run, seed)))
}

#[test]
fn a_league_is_read_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    let run = run(Config { enemies: Enemies::SelfPlay(SelfPlay::LEAGUE), ..Config::for_agents(3) });
    let rivals = vec![
        Rival { win_rate: 0.75, is_retired: true, ..Rival::new(10, rival(&run, 10)) },
        Rival { win_rate: 0.125, ..Rival::new(20, rival(&run, 20)) },
    ];
    let players = vec![Player::Rival(10), Player::Own, Player::Rival(20)];
    let mut written = Checkpoint { league: League { rivals, players }, ..checkpoint(&run) };
    for against in [Against::Own, Against::Rival] {
        let Recent { ended: Ended { episode, .. }, .. } = written.recent[0];
        written.recent.push(Recent { ended: Ended { episode, against }, map: 2 });
    }
    written.write(&path, &run).unwrap();
    assert_eq!(read_checkpoint(&path, &run).unwrap(), written);
    written.league.players[0] = Player::Rival(30);
    written.write(&path, &run).unwrap();
    let error = read_checkpoint(&path, &run).unwrap_err().to_string();
    assert!(error.contains("`league.rivals` has no 30, which plays"), "{error}");
}

#[test]
fn a_checkpoint_is_read_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    let run = run(Config::for_agents(3));
    let written = checkpoint(&run);
    written.write(&path, &run).unwrap();
    assert_eq!(read_checkpoint(&path, &run).unwrap(), written);
    let written = Checkpoint { envs: None, ..written };
    written.write(&path, &run).unwrap();
    assert_eq!(read_checkpoint(&path, &run).unwrap(), written);
    write_arrays(&path, &written.arrays()).unwrap(); // of an older release
    assert_eq!(read_checkpoint(&path, &run).unwrap(), written);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file remains");
}

#[test]
fn weights_have_the_names_and_shapes_of_pytorch() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("weights.safetensors");
    let run = run(Config::for_agents(3));
    let team = Team::new(&Config { hidden: vec![8, 5], ..run.config }, &run.inputs);
    write_weights(&path, &team).unwrap();
    let actor = read_actor(&path, team.actor.architecture.clone()).unwrap();
    assert_eq!(actor.params, team.actor.params);
    let bytes = fs::read(&path).unwrap();
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let shape = |name: &str| tensors.tensor(name).unwrap().shape().to_vec();
    assert_eq!(shape("actor.0.weight"), [8, run.sizes.obs_size]);
    assert_eq!(shape("actor.id_bias"), [3, 8]);
    assert_eq!(shape("actor.2.weight"), [9, 5]);
    assert_eq!(shape("critic.2.bias"), [1]);
    assert_eq!(shape("critic.id_bias"), [3, 8], "it values what an agent observes");
    assert_eq!(tensors.names().len(), 7 + 7);
}

#[test]
fn damaged_and_foreign_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    let run = run(Config::for_agents(3));
    checkpoint(&run).write(&path, &run).unwrap();
    let good = fs::read(&path).unwrap();
    let check = |bytes: &[u8], expected: &str| {
        fs::write(&path, bytes).unwrap();
        let error = read_checkpoint(&path, &run).unwrap_err().to_string();
        assert!(error.contains(expected) && error.contains("checkpoint.safetensors"), "{error}");
    };
    let mut flipped = good.clone();
    *flipped.last_mut().unwrap() ^= 1;
    check(&flipped, "damaged");
    let middle = good.len() / 2;
    flipped = good.clone();
    flipped[middle] ^= 0x10;
    check(&flipped, "its checksum differs");
    check(&good[..good.len() - 1], "damaged");
    check(&[], "damaged");
    check(b"{\"this is\": \"JSON\"}", "damaged");
    let mut wider = run.clone();
    wider.config.hidden = vec![16];
    write_arrays(&path, &checkpoint(&wider).arrays()).unwrap(); // of an older release
    check(&fs::read(&path).unwrap(), "`actor.params` has the shape");
    let error = read_checkpoint(folder.path(), &run).unwrap_err().to_string();
    assert!(error.contains("not a regular file"), "{error}");

    let weights = folder.path().join("weights.safetensors");
    let mut team = team(&run);
    team.actor.params[0] = f32::NAN;
    write_weights(&weights, &team).unwrap();
    let error = read_actor(&weights, team.actor.architecture.clone()).unwrap_err().to_string();
    assert!(error.contains("`actor.0.weight` contains NaN"), "{error}");
    let error = read_actor(&path, team.actor.architecture.clone()).unwrap_err().to_string();
    assert!(error.contains("it has no `actor.0.weight`"), "{error}");
}

/// Any with networks of the same shapes was continued: under the name of one run, another one.
#[test]
fn a_checkpoint_of_another_run_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    let own = run(Config { seed: 1, ..Config::for_agents(3) });
    let state = checkpoint(&own);
    let config = |change: fn(&mut Config)| {
        let mut other = own.clone();
        change(&mut other.config);
        other
    };
    let mut edited = own.clone();
    edited.setup.files.text.push('\n');
    let mut moved = config(|config| config.steps = 7);
    moved.setup.files.source = "runs/3m.json".to_owned();
    for (of, expected) in [
        (moved, None),
        (config(|config| config.seed = 2), Some("seed (2 instead of 1)")),
        (config(|config| config.activation = Activation::Tanh), Some("activation (\"tanh\" instead of")),
        (edited, Some("scenario or unit types")),
    ] {
        state.write(&path, &of).unwrap();
        let error = read_checkpoint(&path, &own).err().map(|error| error.to_string());
        assert_eq!(error.is_some(), expected.is_some(), "{error:?}");
        if let (Some(error), Some(expected)) = (error, expected) {
            let expected = format!("does not fit the run: it is of a run that differs in {expected}");
            assert!(error.contains("checkpoint.safetensors") && error.contains(&expected), "{error}");
        }
    }
}

/// `evaluate` played with whatever weights a damaged disk had made of the right ones.
#[test]
fn weights_with_flipped_bits_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("weights.safetensors");
    let run = run(Config::for_agents(3));
    let team = Team::new(&Config { hidden: vec![2], ..run.config }, &run.inputs);
    write_weights(&path, &team).unwrap();
    let good = fs::read(&path).unwrap();
    let (header, _) = safetensors::SafeTensors::read_metadata(&good).unwrap();
    for at in size_of::<u64>() + header..good.len() {
        let mut flipped = good.clone();
        flipped[at] ^= 1;
        fs::write(&path, flipped).unwrap();
        let error = read_actor(&path, team.actor.architecture.clone()).unwrap_err().to_string();
        assert!(error.contains("weights.safetensors` is damaged") && error.contains("checksum"), "{error}");
    }
    // Learners in Python write files without a checksum.
    let tensors = safetensors::SafeTensors::deserialize(&good).unwrap();
    fs::write(&path, safetensors::serialize(tensors.tensors(), None).unwrap()).unwrap();
    assert_eq!(read_actor(&path, team.actor.architecture.clone()).unwrap().params, team.actor.params);
}
