//! What a run is resumed from, `checkpoint.safetensors`.
//!
//! A resumed run continues with the same bits. So a checkpoint has the networks and their optimisers and the
//! statistics of the returns, snapshots of all environments, and the description of its run, as in
//! `run.json`.

use crate::adam::Adam;
use crate::description::RunDescription;
use crate::lanes::SavedEnvs;
use crate::league::{League, Player, Rival};
use crate::normaliser::Normaliser;
use crate::rollout::{Against, Ended, Episode, Recent};
use crate::team::{Network, Team};
use crate::tensors::{Array, Arrays, FileError, read, write_arrays};
use std::path::Path;

/// How far a run has come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Progress {
    pub updates: u64,
    /// Environment steps, without those that only reset an environment.
    pub steps: u64,
    /// Episodes that ended.
    pub episodes: u64,
    /// Seconds of training.
    pub seconds: f64,
    /// Seconds of processor time.
    pub cpu_seconds: f64,
}

impl Progress {
    /// Reads how far the run of a checkpoint was, and nothing else of it.
    pub fn read(path: &Path) -> Result<Progress, FileError> {
        let bytes = read(path)?;
        Ok(read_progress(&Arrays::decode(path, &bytes)?)?.0)
    }
}

/// The state of a run between two updates.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Checkpoint {
    pub team: Team,
    pub progress: Progress,
    /// The newest episodes that ended, the oldest first.
    pub recent: Vec<Recent>,
    /// Of each map. `None` before the first update, and if a lane does not serve snapshots.
    pub envs: Option<Vec<SavedEnvs>>,
    /// Who plays the enemies. The policies of rivals are in files of their own.
    pub league: League,
}

/// The array with the description of the run.
const RUN: &str = "run";

/// Reads the policy of the rival of this number.
pub(crate) type ReadRival<'a> = dyn FnMut(u64) -> Result<Network, FileError> + 'a;

impl Checkpoint {
    /// Writes the file whole or not at all.
    pub fn write(&self, path: &Path, run: &RunDescription) -> Result<(), FileError> {
        let mut arrays = self.arrays();
        arrays.push(Array::flat(RUN, &run.to_json()));
        write_arrays(path, &arrays)
    }

    fn arrays(&self) -> Vec<Array> {
        let Checkpoint { team, progress, recent, envs, league } = self;
        let Progress { updates, steps, episodes, seconds, cpu_seconds } = *progress;
        let Normaliser { mean, square, weight } = team.normaliser;
        let counts = [updates, steps, episodes, team.actor.adam.steps, team.critic.adam.steps];
        let against: Vec<u8> = recent.iter().map(|recent| recent.ended.against as u8).collect();
        let maps: Vec<u64> = recent.iter().map(|recent| recent.map).collect();
        let recent: Vec<f32> = recent
            .iter()
            .flat_map(|Recent { ended: Ended { episode, .. }, .. }| {
                [episode.episode_return, episode.length as f32, f32::from(u8::from(episode.won))]
            })
            .collect();
        let mut arrays = vec![
            Array::flat("counts", &counts),
            Array::flat("times", &[seconds, cpu_seconds]),
            Array::flat("normaliser", &[mean, square, weight]),
            Array::flat("recent_episodes", &recent),
        ];
        if maps.iter().any(|map| *map > 0) {
            arrays.push(Array::flat("recent_maps", &maps));
        }
        for (map, SavedEnvs { snapshots, over }) in envs.iter().flatten().enumerate() {
            arrays.push(Array::flat(of_map("snapshots", map), snapshots));
            arrays.push(Array::flat(of_map("over", map), over));
        }
        if league.is_played() {
            arrays.push(Array::flat("recent_against", &against));
            arrays.extend(league_arrays(league));
        }
        for (name, network) in [("actor", &team.actor), ("critic", &team.critic)] {
            arrays.push(Array::flat(format!("{name}.params"), &network.params));
            arrays.push(Array::flat(format!("{name}.adam.mean"), &network.adam.mean));
            arrays.push(Array::flat(format!("{name}.adam.square"), &network.adam.square));
        }
        arrays
    }

    /// Reads the checkpoint of a run.
    pub fn read(
        path: &Path,
        run: &RunDescription,
        read_rival: &mut ReadRival<'_>,
    ) -> Result<Checkpoint, FileError> {
        let bytes = read(path)?;
        let arrays = Arrays::decode(path, &bytes)?;
        check_run(&arrays, run)?;
        let RunDescription { config, inputs, .. } = run;
        let (progress, adam_steps) = read_progress(&arrays)?;
        let normaliser: Vec<f64> = arrays.shaped("normaliser", &[3])?;
        let mut team = Team::new(config, inputs);
        team.normaliser = Normaliser { mean: normaliser[0], square: normaliser[1], weight: normaliser[2] };
        read_network(&arrays, "actor", adam_steps[0], &mut team.actor)?;
        read_network(&arrays, "critic", adam_steps[1], &mut team.critic)?;
        let recent = read_recent(&arrays)?;
        let mut envs = Vec::new();
        while arrays.has(&of_map("snapshots", envs.len())) {
            let snapshots = arrays.values(&of_map("snapshots", envs.len()))?;
            envs.push(SavedEnvs { snapshots, over: arrays.values(&of_map("over", envs.len()))? });
        }
        let counted: usize = envs.iter().map(|envs| envs.over.len()).sum();
        if !envs.is_empty() && counted != config.num_envs {
            let expected = config.num_envs;
            return Err(arrays.damaged(format!("`over` has {counted} elements instead of {expected}")));
        }
        let envs = (!envs.is_empty()).then_some(envs);
        let league = if config.enemies.are_scripts() {
            League::default()
        } else {
            read_league(&arrays, config.num_envs, read_rival)?
        };
        Ok(Checkpoint { team, progress, recent, envs, league })
    }
}

/// Checks that a checkpoint is of this run; those of older releases do not say whose they are. A run can be
/// resumed with another number of steps.
fn check_run(arrays: &Arrays, run: &RunDescription) -> Result<(), FileError> {
    if !arrays.has(RUN) {
        return Ok(());
    }
    let given = RunDescription::from_json(&arrays.values::<u8>(RUN)?);
    let given = given.map_err(|why| arrays.damaged(format!("`{RUN}`: {why}")))?;
    match given.differences(run, &["steps"]) {
        differences if differences.is_empty() => Ok(()),
        differences => Err(arrays.other_run(format!("it is of a run that differs in {differences}"))),
    }
}

/// The name of an array of a map; that of the first is the name alone.
fn of_map(name: &str, map: usize) -> String {
    if map == 0 { name.to_owned() } else { format!("{name}.{map}") }
}

/// Stands for the team itself among the numbers of rivals.
const OWN: u64 = u64::MAX;

fn league_arrays(league: &League) -> [Array; 4] {
    let number = |player: &Player| match player {
        Player::Own => OWN,
        Player::Rival(number) => *number,
    };
    let players: Vec<u64> = league.players.iter().map(number).collect();
    let of_rivals = league.rivals.iter();
    let numbers: Vec<u64> = of_rivals.clone().map(|rival| rival.number).collect();
    let win_rates: Vec<f64> = of_rivals.clone().map(|rival| rival.win_rate).collect();
    let retired: Vec<u8> = of_rivals.map(|rival| u8::from(rival.is_retired)).collect();
    [
        Array::flat("league.players", &players),
        Array::flat("league.rivals", &numbers),
        Array::flat("league.win_rates", &win_rates),
        Array::flat("league.retired", &retired),
    ]
}

fn read_league(
    arrays: &Arrays,
    num_envs: usize,
    read_rival: &mut ReadRival<'_>,
) -> Result<League, FileError> {
    let players: Vec<u64> = arrays.shaped("league.players", &[num_envs])?;
    let numbers: Vec<u64> = arrays.values("league.rivals")?;
    let win_rates: Vec<f64> = arrays.shaped("league.win_rates", &[numbers.len()])?;
    let retired: Vec<u8> = arrays.shaped("league.retired", &[numbers.len()])?;
    if let Some(player) = players.iter().find(|player| **player != OWN && !numbers.contains(player)) {
        return Err(arrays.damaged(format!("`league.rivals` has no {player}, which plays")));
    }
    let mut rivals = Vec::new();
    for (number, (win_rate, retired)) in numbers.into_iter().zip(win_rates.into_iter().zip(retired)) {
        let rival = Rival::new(number, read_rival(number)?);
        rivals.push(Rival { win_rate, is_retired: retired != 0, ..rival });
    }
    let player = |number| if number == OWN { Player::Own } else { Player::Rival(number) };
    Ok(League { rivals, players: players.into_iter().map(player).collect() })
}

fn read_recent(arrays: &Arrays) -> Result<Vec<Recent>, FileError> {
    let recent: Vec<f32> = arrays.values("recent_episodes")?;
    let against: Vec<u8> = match arrays.has("recent_against") {
        true => arrays.shaped("recent_against", &[recent.len() / 3])?,
        false => vec![Against::Script as u8; recent.len() / 3],
    };
    let maps: Vec<u64> = match arrays.has("recent_maps") {
        true => arrays.shaped("recent_maps", &[recent.len() / 3])?,
        false => vec![0; recent.len() / 3],
    };
    let ended = |(values, against): (&[f32], u8)| Ended {
        episode: Episode { episode_return: values[0], length: values[1] as i32, won: values[2] != 0.0 },
        against: match against {
            1 => Against::Own,
            2 => Against::Rival,
            _ => Against::Script,
        },
    };
    let ended = recent.chunks_exact(3).zip(against).map(ended);
    Ok(ended.zip(maps).map(|(ended, map)| Recent { ended, map }).collect())
}

/// Reads how far a run was, and how many steps the optimisers of actor and critic had made.
fn read_progress(arrays: &Arrays) -> Result<(Progress, [u64; 2]), FileError> {
    let counts: Vec<u64> = arrays.shaped("counts", &[5])?;
    let times: Vec<f64> = arrays.shaped("times", &[2])?;
    let [updates, steps, episodes] = [counts[0], counts[1], counts[2]];
    let progress = Progress { updates, steps, episodes, seconds: times[0], cpu_seconds: times[1] };
    Ok((progress, [counts[3], counts[4]]))
}

/// Reads the parameters of a network and its optimiser, which has made `steps` steps.
fn read_network(arrays: &Arrays, name: &str, steps: u64, network: &mut Network) -> Result<(), FileError> {
    let shape = [network.architecture.n_params()];
    network.params = arrays.shaped(&format!("{name}.params"), &shape)?;
    let mean = arrays.shaped(&format!("{name}.adam.mean"), &shape)?;
    let square = arrays.shaped(&format!("{name}.adam.square"), &shape)?;
    network.adam = Adam { steps, mean, square };
    Ok(())
}

#[cfg(test)]
mod tests;
