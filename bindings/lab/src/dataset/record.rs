//! Recording: a policy plays, some episodes in lockstep on each thread, and its actions are kept.

use super::file::{MAX_POLICIES, MAX_STEPS, this_program};
use super::quality::{self, Quality, name_in};
use super::{Card, Dataset, DatasetError, End, Episode, Policy, starts};
use smaclite_engine::policy::Tactic;
use smaclite_engine::{Arena, BattleSetup, Opponents, Scratch, Sides};
use smaclite_learn::battles::{LOCKSTEP, Play, Player, Players};
use smaclite_learn::{
    Choice, EvaluationFiles, EvaluationRow, RunDescription, TrainedTeam, Weights, parallel, with_an_end,
    zoo_card,
};
use smaclite_scenarios::Scenario;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Jobs per thread between two looks at how many steps there are.
const JOBS_PER_THREAD: usize = 4;

/// What is recorded.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Who plays.
    pub source: Source,
    /// How much.
    pub amount: Amount,
    /// Episode `i` is seeded with `seed + i`; actions are drawn from the seed too.
    pub seed: u64,
    /// Whether a team takes the most probable action, instead of drawing one by its probability.
    pub greedy: bool,
    /// Number of threads, at least 1. They change no result.
    pub threads: usize,
}

/// Who plays.
#[derive(Clone, Debug)]
pub enum Source {
    /// A scripted policy.
    Script {
        /// What it plays.
        setup: BattleSetup,
        /// Its rule.
        tactic: Tactic,
    },
    /// The team in the folder of a training run, which plays what it was trained in.
    Run {
        /// The folder.
        folder: PathBuf,
        /// Which of its weights; `None` for those of [`Weights::of`].
        quality: Option<Quality>,
        /// Who plays the enemies instead of the scripts of the training.
        opponents: Option<Opponents>,
    },
}

/// How much is recorded, at least one step or episode. Episodes are whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Amount {
    /// As many episodes as have this many steps together, or a few more. Policies have equal shares of them.
    Steps(usize),
    /// This many episodes. If policies cannot have equal numbers of them, later ones have one more.
    Episodes(usize),
}

impl Amount {
    /// The part of policy `i` of `n`.
    fn share(self, i: usize, n: usize) -> Amount {
        match self {
            Amount::Steps(steps) => Amount::Steps(steps.div_ceil(n)),
            Amount::Episodes(episodes) => Amount::Episodes((episodes + i) / n),
        }
    }

    fn is_reached(self, episodes: usize, steps: usize) -> bool {
        match self {
            Amount::Steps(wanted) => steps >= wanted,
            Amount::Episodes(wanted) => episodes >= wanted,
        }
    }

    /// How many more episodes there can be. Each has a step at least.
    fn most_needed(self, episodes: usize, steps: usize) -> usize {
        match self {
            Amount::Steps(wanted) => wanted.saturating_sub(steps),
            Amount::Episodes(wanted) => wanted.saturating_sub(episodes),
        }
    }
}

/// An episode that was played.
#[derive(Clone, Default)]
struct Played {
    seed: u64,
    length: u32,
    end: End,
    actions: Vec<u16>,
}

/// Episodes that are played in lockstep.
struct Job {
    first: usize,
    /// At most [`LOCKSTEP`].
    count: usize,
    played: Vec<Played>,
}

impl Dataset {
    /// Plays and records. The result depends on the recording alone, and for teams on the CPU's vector
    /// instructions, not on the number of threads.
    ///
    /// # Errors
    /// If the source cannot play; `Interrupted` if `interrupted` returned true.
    pub fn record(
        recording: &Recording,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Dataset, DatasetError> {
        if matches!(recording.amount, Amount::Steps(0) | Amount::Episodes(0)) {
            return Err(DatasetError::Nothing);
        }
        let (setup, players) = recording.source.open()?;
        let arena = recorded_arena(&setup)?;
        let n_policies = players.len();
        if n_policies > MAX_POLICIES {
            return Err(DatasetError::TooManyPolicies { max: MAX_POLICIES, given: n_policies });
        }
        let (mut policies, mut episodes, mut actions) = (Vec::new(), Vec::new(), Vec::new());
        let mut n_steps = 0;
        for (i, (policy, player)) in players.into_iter().enumerate() {
            let (first, amount) = (episodes.len(), recording.amount.share(i, n_policies));
            let room = MAX_STEPS - n_steps;
            for played in recording.play(&arena, &player, first, amount, room, interrupted)? {
                let Played { seed, length, end, actions: own } = played;
                n_steps += length as usize;
                episodes.push(Episode { seed, length, policy: i as u16, end });
                actions.extend(own);
            }
            policies.push(policy);
        }
        let starts = starts(&episodes);
        let mut dataset = Dataset {
            source: "the recording".to_owned(),
            program: this_program(),
            setup,
            arena,
            policies,
            episodes,
            starts,
            actions,
            hashes: Vec::new(),
            card: Card::default(),
        };
        dataset.measure(recording.threads, interrupted)?;
        Ok(dataset)
    }
}

/// The arena of battles that can be recorded.
fn recorded_arena(setup: &BattleSetup) -> Result<Arc<Arena>, DatasetError> {
    if setup.sides != Sides::default() {
        return Err(DatasetError::BothSides);
    }
    let (_, arena) = setup.arena()?;
    match arena.episode_limit() {
        Some(_) => Ok(Arc::new(arena)),
        None => Err(DatasetError::NoLimit),
    }
}

/// Refuses a script that would act by what states do not have, and so no learner can: it reads the units of
/// battles, as in a pool those of states.
fn check_states(tactic: Tactic, scenario: &Scenario) -> Result<(), DatasetError> {
    let policy = tactic.name();
    match &scenario.smacv2 {
        _ if tactic == Tactic::Random => Ok(()),
        Some(options) if options.obs_instead_of_state => Err(DatasetError::NoUnits { policy }),
        _ if scenario.draws_teams() && !scenario.tells_types_apart() => {
            Err(DatasetError::EqualTypes { policy })
        }
        _ => Ok(()),
    }
}

/// What a dataset says of a team: whose it is, and where that is known how it was trained and plays, for a
/// run on several maps on the first of them.
fn policy_of(folder: &Path, weights: Weights, maps: usize) -> Result<Policy, DatasetError> {
    if let Some(card) = zoo_card(folder)? {
        let name = folder.display().to_string();
        let (training_steps, sampled_win_rate) = (Some(card.steps), Some(card.sampled.win_rate));
        return Ok(Policy { name, training_steps, sampled_win_rate });
    }
    let name = name_in(folder, Path::new(weights.file_name()));
    let mut policy = Policy { name, training_steps: None, sampled_win_rate: None };
    if weights == Weights::Best {
        let files = EvaluationFiles::of(folder);
        policy.training_steps = EvaluationRow::best(&files.rows()?).map(|best| best.steps);
        let rows = files.rows_on_first(maps)?;
        let best = rows.iter().find(|row| Some(row.steps) == policy.training_steps);
        policy.sampled_win_rate = best.map(|best| best.sampled.win_rate);
    }
    Ok(policy)
}

impl Source {
    /// What is played, and who plays.
    fn open(&self) -> Result<(BattleSetup, Vec<(Policy, Player)>), DatasetError> {
        match self {
            Source::Script { setup, tactic } => {
                check_states(*tactic, &setup.files.scenario()?)?;
                let policy =
                    Policy { name: tactic.name().to_owned(), training_steps: None, sampled_win_rate: None };
                Ok((setup.clone(), vec![(policy, Player::Tactic(*tactic))]))
            }
            Source::Run { folder, quality, opponents } => {
                let run = RunDescription::read(folder)?;
                let opponents = opponents.clone().unwrap_or_else(|| run.setup.opponents.clone());
                let setup = with_an_end(BattleSetup { opponents, ..run.setup.clone() });
                let players = match quality {
                    None => {
                        let weights = Weights::of(folder, &run);
                        let policy = policy_of(folder, weights, run.map_count())?;
                        let team = TrainedTeam::open_with(folder, Some(weights))?;
                        vec![(policy, Player::Team(Box::new(team)))]
                    }
                    Some(quality) => {
                        let policies = quality::policies(folder, run.map_count(), *quality)?.into_iter();
                        let open = |(policy, path): (Policy, PathBuf)| {
                            let team = TrainedTeam::open_file(&run, &path)?;
                            Ok::<_, DatasetError>((policy, Player::Team(Box::new(team))))
                        };
                        policies.map(open).collect::<Result<_, _>>()?
                    }
                };
                Ok((setup, players))
            }
        }
    }
}

impl Recording {
    /// Plays episodes from number `first` on; of all policies, `room` steps are left.
    fn play(
        &self,
        arena: &Arc<Arena>,
        player: &Player,
        first: usize,
        amount: Amount,
        room: usize,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<Played>, DatasetError> {
        let mut scratches: Vec<Scratch> = (0..self.threads.max(1)).map(|_| Scratch::new()).collect();
        let (mut all, mut steps) = (Vec::<Played>::new(), 0);
        while !amount.is_reached(all.len(), steps) {
            let needed = amount.most_needed(all.len(), steps);
            let mut jobs = jobs(first + all.len(), needed, scratches.len() * JOBS_PER_THREAD);
            parallel::run(jobs.iter_mut(), &mut scratches, interrupted, |job, scratch| {
                job.played = self.play_in_lockstep(arena, player, job, scratch);
            })
            .map_err(|parallel::Interrupted| DatasetError::Interrupted)?;
            for played in jobs.into_iter().flat_map(|job| job.played) {
                if amount.is_reached(all.len(), steps) {
                    break;
                }
                steps += played.length as usize;
                all.push(played);
            }
            if steps > room {
                return Err(DatasetError::TooManySteps { max: MAX_STEPS });
            }
        }
        Ok(all)
    }

    fn play_in_lockstep(
        &self,
        arena: &Arc<Arena>,
        player: &Player,
        Job { first, count, .. }: &Job,
        scratch: &mut Scratch,
    ) -> Vec<Played> {
        let choice = if self.greedy { Choice::Greedy } else { Choice::Sampled };
        let play = Play { seed: self.seed, choices: [choice; 2] };
        let rows = *first..first + LOCKSTEP;
        let seeds = rows.clone().take(*count).map(|episode| play.seed_of(episode));
        let mut played: Vec<Played> = seeds.map(|seed| Played { seed, ..Played::default() }).collect();
        let players = Players { agents: player, enemies: None };
        play.in_lockstep(arena, players, rows, *count, scratch, |battle, actions, step| {
            let played = &mut played[battle];
            // An available action is below the 6 + 360 + 1000 actions of the largest scenario.
            played.actions.extend(actions.iter().map(|&action| action as u16));
            played.end = End::of(step);
            played.length += 1;
        });
        played
    }
}

/// At most `most` jobs for the episodes from `begin` on, of which no more than `needed` are played.
///
/// All but the last of them have [`LOCKSTEP`] episodes, so they begin at the same episodes however many are
/// played at a time: a team's outputs depend to the last bit on their rows in a matrix.
fn jobs(begin: usize, needed: usize, most: usize) -> Vec<Job> {
    let firsts = (0..needed).step_by(LOCKSTEP).take(most);
    let job = |i: usize| Job { first: begin + i, count: LOCKSTEP.min(needed - i), played: Vec::new() };
    firsts.map(job).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `--episodes 1` played 128 episodes per thread and policy.
    #[test]
    fn no_more_episodes_are_played_than_can_be_needed() {
        let counts = |amount: Amount, episodes, steps, most| {
            let jobs = jobs(100 + episodes, amount.most_needed(episodes, steps), most);
            jobs.iter().map(|job| (job.first, job.count)).collect::<Vec<_>>()
        };
        assert_eq!(counts(Amount::Episodes(1), 0, 0, 8), [(100, 1)]);
        assert_eq!(counts(Amount::Episodes(70), 0, 0, 8), [(100, 32), (132, 32), (164, 6)]);
        assert_eq!(counts(Amount::Episodes(70), 0, 0, 2), [(100, 32), (132, 32)]);
        assert_eq!(counts(Amount::Episodes(70), 64, 900, 2), [(164, 6)]);
        assert_eq!(counts(Amount::Steps(1000), 64, 990, 8), [(164, 10)], "an episode has a step at least");
    }

    /// Episodes that share the rows of a matrix are the same for any number of threads.
    #[test]
    fn jobs_begin_at_the_same_episodes_however_many_there_are_at_a_time() {
        let all = |most| {
            let (mut found, mut played) = (Vec::new(), 0);
            while played < 150 {
                let needed = Amount::Episodes(150).most_needed(played, 0);
                for job in jobs(100 + played, needed, most) {
                    found.push((job.first, job.count));
                    played += job.count;
                }
            }
            found
        };
        assert_eq!(all(1), [(100, 32), (132, 32), (164, 32), (196, 32), (228, 22)]);
        for most in [2, 3, 4, 100] {
            assert_eq!(all(most), all(1), "{most} at a time");
        }
    }
}
