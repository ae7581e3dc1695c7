//! Plays the episodes of an evaluation, some in lockstep, on several threads.

use crate::battles::{Ended, Pairing, Play, Player};
use crate::config::Enemies;
use crate::description::{OPPONENT, OtherMap, RunDescription, Weights};
use crate::parallel::{self, Interrupted};
use crate::policy::Choice;
use crate::random::{Purpose, seed};
use crate::rollout::Episode;
use crate::setups::with_an_end;
use crate::team::{Network, Team};
use crate::tensors::FileError;
use crate::trained_team::TrainedTeam;
use smaclite_engine::{Faction, Opponent, Scratch};
use std::fmt::Display;
use std::path::Path;
use std::sync::Arc;

/// Episodes in lockstep. Their number decides the last bits of the outputs, so it does not depend on the
/// number of threads; it is small enough for several threads to be busy.
const LOCKSTEP: usize = 8;

/// Which evaluation of a run is played. It decides the seeds.
#[derive(Clone, Copy)]
pub enum Occasion {
    /// While the run trains, at this step count.
    Training {
        /// The step count.
        steps: u64,
    },
    /// At the end, with the best weights.
    Final,
    /// In a report, with the weights of the evaluation at this step count: one of several blocks.
    TimeToWin {
        /// The step count.
        steps: u64,
        /// The number of the block.
        block: u64,
    },
}

impl Occasion {
    /// The seed of the first episode; the next one has the next seed. Actions are drawn from it too.
    fn seed(self, run: u64, choice: Choice) -> u64 {
        let sampled = choice.index() as u64;
        match self {
            Occasion::Training { steps } => seed(run, Purpose::TrainingEvaluations, [steps, sampled]),
            Occasion::Final => seed(run, Purpose::FinalEvaluation, [0, sampled]),
            Occasion::TimeToWin { steps, block } => seed(run, Purpose::TimeToWin, [steps, block]),
        }
    }
}

/// Plays a run's team, on each of its maps, against what it trains against: its scripts, or the team of
/// another run. In self-play the opponent is the script `attack_move`.
pub struct Evaluator {
    seed: u64,
    /// In the order of the run's maps.
    maps: Vec<Meeting>,
    scratches: Vec<Scratch>,
}

/// Who meets on a map.
struct Meeting {
    pairing: Pairing,
    /// The team, and who plays the enemies.
    players: [Player; 2],
}

impl Meeting {
    /// Of a run in a folder, on this map alone.
    fn open(folder: &Path, run: RunDescription) -> Result<Meeting, FileError> {
        let damaged = |path: &Path, why: &dyn Display| FileError::Damaged {
            path: path.join("run.json"),
            why: why.to_string(),
        };
        let (setup, enemies) = match &run.config.enemies {
            // What plays inside the engine has no seat; any script stands for it.
            Enemies::Scripts | Enemies::SelfPlay(_) => {
                (run.setup.clone(), Player::March(Opponent::AttackMove))
            }
            Enemies::Team { .. } => {
                let (opponent, weights) = (folder.join(OPPONENT), Some(Weights::Last));
                let team = TrainedTeam::open_enemies(&opponent, weights, &run.setup);
                let team = team.map_err(|error| match error {
                    OtherMap::File(error) => error,
                    other => damaged(&opponent, &other),
                })?;
                (run.lanes_setup(), Player::Team(Box::new(team)))
            }
        };
        let (_, arena) = with_an_end(setup).arena().map_err(|problems| damaged(folder, &problems))?;
        let network = run.playing(Team::new(&run.config, &run.inputs).actor);
        let team = Player::Team(Box::new(TrainedTeam { run, network }));
        let pairing = Pairing { agents: 0, enemies: 1, arena: Arc::new(arena), is_exchanged: false };
        Ok(Meeting { pairing, players: [team, enemies] })
    }

    fn play(
        &mut self,
        actor: &Network,
        play: Play,
        episodes: usize,
        scratches: &mut [Scratch],
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<Episode>, Interrupted> {
        let Meeting { pairing, players } = self;
        if let Player::Team(team) = &mut players[0] {
            team.network = team.run.playing(actor.without_optimiser());
        }
        let mut ended = vec![Ended::default(); episodes];
        let jobs = ended.chunks_mut(LOCKSTEP).enumerate();
        parallel::run(jobs, scratches, interrupted, |(job, ended), scratch| {
            play.episodes(pairing, players, job * LOCKSTEP, ended, scratch);
        })?;
        let against_team = matches!(players[1], Player::Team(_));
        let episode = |ended: Ended| Episode {
            episode_return: ended.returns[0] as f32,
            length: ended.length.cast_signed(),
            won: if against_team { ended.winner == Some(Faction::Ally) } else { ended.battle_won },
        };
        Ok(ended.into_iter().map(episode).collect())
    }
}

impl Evaluator {
    /// Of the run in a folder.
    ///
    /// # Errors
    /// If its files, or those of the team that plays the enemies, are damaged.
    pub fn open(folder: &Path, run: &RunDescription, threads: usize) -> Result<Evaluator, FileError> {
        let runs = run
            .on_each_map()
            .map_err(|error| FileError::Damaged { path: folder.join("run.json"), why: error.to_string() })?;
        let maps = runs.into_iter().map(|run| Meeting::open(folder, run)).collect::<Result<_, _>>()?;
        let scratches = (0..threads.max(1)).map(|_| Scratch::new()).collect();
        Ok(Evaluator { seed: run.config.seed, maps, scratches })
    }

    /// Plays so many episodes on each map of the run with these weights, as files have them, and returns
    /// those of one map after the other. The same run, occasion and weights give the same episodes.
    ///
    /// # Errors
    /// If `interrupted` returned true.
    pub fn play(
        &mut self,
        actor: &Network,
        occasion: Occasion,
        choice: Choice,
        episodes: usize,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<Episode>, Interrupted> {
        // A team that plays the enemies draws its actions, as in the training.
        let play = Play { seed: occasion.seed(self.seed, choice), choices: [choice, Choice::Sampled] };
        let mut all = Vec::with_capacity(episodes * self.maps.len());
        for map in &mut self.maps {
            all.extend(map.play(actor, play, episodes, &mut self.scratches, interrupted)?);
        }
        Ok(all)
    }
}
