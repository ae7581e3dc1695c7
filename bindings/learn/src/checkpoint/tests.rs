//! Tests of `checkpoint`: what is written is read, and what is damaged or foreign is refused.

use super::*;
use crate::config::{Enemies, SelfPlay};
use smaclite_engine::Sizes;
use std::fs;

const SIZES: Sizes = Sizes {
    n_agents: 2,
    n_enemies: 3,
    n_actions: 9,
    obs_size: 4,
    state_size: 6,
    perception_size: 0,
    n_phases: 0,
    enemies: None,
};

fn checkpoint(config: &Config) -> Checkpoint {
    let mut team = Team::new(config, &SIZES.into());
    team.observe_returns([1.0, 2.0].into_iter());
    team.actor.adam.mean.fill(0.25);
    team.critic.adam.steps = 7;
    let progress = Progress { updates: 3, steps: 500, episodes: 4, seconds: 1.5, cpu_seconds: 2.5 };
    let episode = Episode { episode_return: 3.5, length: 20, won: true };
    let recent = vec![Recent { ended: Ended { episode, against: Against::Script }, map: 0 }];
    let envs = Some(SavedEnvs { snapshots: vec![5; 3 * 16], over: vec![0, 1, 0] });
    Checkpoint { team, progress, recent, envs: envs.map(|envs| vec![envs]), league: League::default() }
}

fn read_checkpoint(path: &Path, config: &Config) -> Result<Checkpoint, FileError> {
    // Each rival is the first team of another seed.
    let mut rival = |seed| Ok(Team::new(&Config { seed, ..config.clone() }, &SIZES.into()).actor);
    Checkpoint::read(path, config, &SIZES.into(), &mut rival)
}

#[test]
fn a_league_is_read_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    let enemies = Enemies::SelfPlay(SelfPlay::LEAGUE);
    let config = Config { num_envs: 3, hidden: vec![8], enemies, ..Config::for_agents(3) };
    let actor = |seed| Team::new(&Config { seed, ..config.clone() }, &SIZES.into()).actor;
    let rivals = vec![
        Rival { win_rate: 0.75, is_retired: true, ..Rival::new(10, actor(10)) },
        Rival { win_rate: 0.125, ..Rival::new(20, actor(20)) },
    ];
    let players = vec![Player::Rival(10), Player::Own, Player::Rival(20)];
    let mut written = Checkpoint { league: League { rivals, players }, ..checkpoint(&config) };
    for against in [Against::Own, Against::Rival] {
        let Recent { ended: Ended { episode, .. }, .. } = written.recent[0];
        written.recent.push(Recent { ended: Ended { episode, against }, map: 2 });
    }
    written.write(&path).unwrap();
    assert_eq!(read_checkpoint(&path, &config).unwrap(), written);
    written.league.players[0] = Player::Rival(30);
    written.write(&path).unwrap();
    let error = read_checkpoint(&path, &config).unwrap_err().to_string();
    assert!(error.contains("`league.rivals` has no 30, which plays"), "{error}");
}

#[test]
fn a_checkpoint_is_read_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    let config = Config { num_envs: 3, hidden: vec![8], ..Config::for_agents(3) };
    let written = checkpoint(&config);
    written.write(&path).unwrap();
    assert_eq!(read_checkpoint(&path, &config).unwrap(), written);
    let written = Checkpoint { envs: None, ..written };
    written.write(&path).unwrap();
    assert_eq!(read_checkpoint(&path, &config).unwrap(), written);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file remains");
}

#[test]
fn weights_have_the_names_and_shapes_of_pytorch() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("weights.safetensors");
    let config = Config { hidden: vec![8, 5], ..Config::for_agents(3) };
    let team = checkpoint(&config).team;
    write_weights(&path, &team).unwrap();
    let actor = read_actor(&path, team.actor.architecture.clone()).unwrap();
    assert_eq!(actor.params, team.actor.params);
    let bytes = fs::read(&path).unwrap();
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let shape = |name: &str| tensors.tensor(name).unwrap().shape().to_vec();
    assert_eq!(shape("actor.0.weight"), [8, 4]);
    assert_eq!(shape("actor.id_bias"), [2, 8]);
    assert_eq!(shape("actor.2.weight"), [9, 5]);
    assert_eq!(shape("critic.2.bias"), [1]);
    assert_eq!(shape("critic.id_bias"), [2, 8], "it values what an agent observes");
    assert_eq!(tensors.names().len(), 7 + 7);
}

#[test]
fn damaged_and_foreign_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    let config = Config { num_envs: 3, hidden: vec![8], ..Config::for_agents(3) };
    checkpoint(&config).write(&path).unwrap();
    let good = fs::read(&path).unwrap();
    let check = |bytes: &[u8], config: &Config, expected: &str| {
        fs::write(&path, bytes).unwrap();
        let error = read_checkpoint(&path, config).unwrap_err().to_string();
        assert!(error.contains(expected) && error.contains("checkpoint.safetensors"), "{error}");
    };
    let mut flipped = good.clone();
    *flipped.last_mut().unwrap() ^= 1;
    check(&flipped, &config, "damaged");
    let middle = good.len() / 2;
    flipped = good.clone();
    flipped[middle] ^= 0x10;
    check(&flipped, &config, "its checksum differs");
    check(&good[..good.len() - 1], &config, "damaged");
    check(&[], &config, "damaged");
    check(b"{\"this is\": \"JSON\"}", &config, "damaged");
    let wider = Config { hidden: vec![16], ..config.clone() };
    check(&good, &wider, "`actor.params` has the shape");
    let error = read_checkpoint(folder.path(), &config).unwrap_err().to_string();
    assert!(error.contains("not a regular file"), "{error}");

    let weights = folder.path().join("weights.safetensors");
    let mut team = checkpoint(&config).team;
    team.actor.params[0] = f32::NAN;
    write_weights(&weights, &team).unwrap();
    let error = read_actor(&weights, team.actor.architecture.clone()).unwrap_err().to_string();
    assert!(error.contains("`actor.0.weight` contains NaN"), "{error}");
    let error = read_actor(&path, team.actor.architecture.clone()).unwrap_err().to_string();
    assert!(error.contains("it has no `actor.0.weight`"), "{error}");
}

/// `evaluate` played with whatever weights a damaged disk had made of the right ones.
#[test]
fn weights_with_flipped_bits_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("weights.safetensors");
    let config = Config { hidden: vec![8], ..Config::for_agents(3) };
    let team = checkpoint(&config).team;
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
