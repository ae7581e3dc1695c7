//! Tournaments: every player, script or trained team, plays against every other and against itself, once with
//! the agents and once with the enemies.
//!
//! | file | contents |
//! | --- | --- |
//! | `pairing` | which players can meet |
//! | `elo` | ratings from points |

mod elo;
mod pairing;

use elo::Battles;
pub(crate) use pairing::check_team;
use pairing::pairings;
use serde::Serialize;
use smaclite_engine::{BattleSetup, Faction, Opponent, Rules, Scratch, SidesError};
use smaclite_learn::battles::{Ended, LOCKSTEP, Pairing, Play, Player};
use smaclite_learn::{Choice, FileError, NetworkKind, TrainedTeam, names_team, parallel, with_an_end};
use smaclite_scenarios::Problems;

/// Who plays what.
///
/// ```
/// use smaclite_engine::Rules;
/// use smaclite_lab::Tournament;
/// use smaclite_learn::resolve_scenario;
///
/// let tournament = Tournament {
///     players: ["attack_move", "nearest", "focus_fire"].map(str::to_owned).to_vec(),
///     setup: Some(resolve_scenario("3m", Rules::Smaclite)?),
///     episodes: 20,
///     seed: 1,
///     greedy: false,
///     threads: 1,
/// };
/// let result = tournament.play(&mut || false)?;
/// assert_eq!(result.scores.len(), 8); // attack_move does not play against itself
/// assert!(result.players[2].elo > result.players[0].elo);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Tournament {
    /// Names of scripts, and folders of runs of `smaclite-pool train`.
    pub players: Vec<String>,
    /// What is played, except for the opponents; `None` for what the teams were trained in.
    pub setup: Option<BattleSetup>,
    /// Number of episodes of each pairing, at least 1.
    pub episodes: usize,
    /// Episode `i` of each pairing is seeded with `seed + i`; actions are drawn from the seed too.
    pub seed: u64,
    /// Whether teams take the most probable action, instead of drawing one by its probability.
    pub greedy: bool,
    /// Number of threads, at least 1. They change no result.
    pub threads: usize,
}

/// The result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TournamentResult {
    /// The scenario's name.
    pub scenario: String,
    /// The rules of the battles.
    pub rules: Rules,
    /// Number of episodes of each pairing.
    pub episodes: usize,
    /// The seed.
    pub seed: u64,
    /// Whether teams took the most probable actions.
    pub greedy: bool,
    /// The players, in the order in which they were named.
    pub players: Vec<PlayerScore>,
    /// The pairings that were played, by the player with the agents and then by the one with the enemies.
    pub scores: Vec<Score>,
}

/// A player, over all battles against others.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlayerScore {
    /// The name of the script, or the folder.
    pub player: String,
    /// Elo rating; the mean of all players has 1000.
    pub elo: f64,
    /// The lower end of the 95 % interval of the rating.
    pub elo_low: f64,
    /// Its upper end.
    pub elo_high: f64,
    /// The share of points: 1 per win, 0.5 per draw.
    pub points: f64,
}

/// How a player with the agents scored against one with the enemies.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Score {
    /// The player with the agents.
    pub agents: String,
    /// The player with the enemies.
    pub enemies: String,
    /// Number of episodes.
    pub episodes: usize,
    /// Of them those in which all enemies died, and not all agents.
    pub wins: usize,
    /// Those in which both sides had units at the end, or both had none.
    pub draws: usize,
    /// Those in which all agents died, and not all enemies.
    pub losses: usize,
    /// Mean return of the agents.
    pub mean_return: f64,
    /// Mean return of the enemies.
    pub mean_enemy_return: f64,
    /// Mean number of steps.
    pub mean_length: f64,
}

impl Score {
    /// The share of points of the agents: 1 per win, 0.5 per draw.
    pub fn points(&self) -> f64 {
        (self.wins as f64 + 0.5 * self.draws as f64) / self.episodes.max(1) as f64
    }

    fn of(agents: &str, enemies: &str, ended: &[Ended]) -> Score {
        let won_by = |side| ended.iter().filter(|ended| ended.winner == side).count();
        let mean =
            |value: &dyn Fn(&Ended) -> f64| ended.iter().map(value).sum::<f64>() / ended.len().max(1) as f64;
        Score {
            agents: agents.to_owned(),
            enemies: enemies.to_owned(),
            episodes: ended.len(),
            wins: won_by(Some(Faction::Ally)),
            draws: won_by(None),
            losses: won_by(Some(Faction::Enemy)),
            mean_return: mean(&|ended| ended.returns[0]),
            mean_enemy_return: mean(&|ended| ended.returns[1]),
            mean_length: mean(&|ended| f64::from(ended.length)),
        }
    }
}

/// Why a tournament cannot be played.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum TournamentError {
    #[error("a tournament needs at least two players, got {0}")]
    TooFewPlayers(usize),
    #[error("episodes must be at least 1, got 0")]
    NoEpisodes,
    #[error("player `{0}` is named twice")]
    Twice(String),
    #[error(
        "player `{0}` is neither a script ({scripts}) nor the folder of a run of `smaclite-pool train`",
        scripts = Opponent::scripts().map(Opponent::name).collect::<Vec<_>>().join(", ")
    )]
    UnknownPlayer(String),
    #[error(
        "attack_move and attack_nearest have no actions of agents, so they cannot play against each other; \
         name another player too"
    )]
    OnlyMarches,
    #[error("no player is a trained team, so the scenario must be named")]
    NoScenario,
    #[error(
        "`{folder}` was trained in {given}, but {expected} is played; they differ in {differences}{hint}"
    )]
    OtherScenario { folder: String, given: String, expected: String, differences: String, hint: String },
    #[error(
        "the sides of {name} differ ({n_agents} agents, {n_enemies} enemies), so a team that was trained \
         with its agents cannot play its enemies; here only scripts play against each other, and \
         `smaclite-pool evaluate --opponent` plays a team against a script"
    )]
    Asymmetric { name: String, n_agents: usize, n_enemies: usize },
    #[error("a trained team plays the enemies, too: {0}")]
    Sides(#[from] SidesError),
    #[error("scenario: {0}")]
    Scenario(#[from] Problems),
    #[error(transparent)]
    File(#[from] FileError),
    #[error("interrupted")]
    Interrupted,
}

/// The script of that name, or the team in the folder of a run.
fn player(name: &str) -> Result<Player, TournamentError> {
    match Opponent::scripts().find(|script| script.name() == name) {
        Some(Opponent::Scripted(tactic)) => Ok(Player::Tactic(tactic)),
        Some(march) => Ok(Player::March(march)),
        None if names_team(name) => Ok(Player::Team(Box::new(TrainedTeam::open(name.as_ref())?))),
        None => Err(TournamentError::UnknownPlayer(name.to_owned())),
    }
}

/// The episodes that are played in lockstep.
struct Job<'a> {
    pairing: &'a Pairing,
    first: usize,
    ended: Vec<Ended>,
}

impl Tournament {
    /// Plays all battles.
    ///
    /// # Errors
    /// If a player cannot play; `Interrupted` if `interrupted` returned true.
    pub fn play(&self, interrupted: &mut dyn FnMut() -> bool) -> Result<TournamentResult, TournamentError> {
        let Tournament { episodes, seed, greedy, .. } = *self;
        self.check_names()?;
        let players = self.players.iter().map(|name| player(name)).collect::<Result<Vec<_>, _>>()?;
        if players.iter().all(Player::marches) {
            return Err(TournamentError::OnlyMarches);
        }
        let setup = with_an_end(self.setup(&players)?);
        let pairings = pairings(&setup, &players)?;
        let play = Play { seed, choices: [Choice::of(greedy); 2] };
        let mut jobs = jobs(&pairings, episodes);
        let mut scratches: Vec<Scratch> = (0..self.threads.max(1)).map(|_| Scratch::new()).collect();
        parallel::run(jobs.iter_mut(), &mut scratches, interrupted, |job, scratch| {
            play.episodes(job.pairing, &players, job.first, &mut job.ended, scratch);
        })
        .map_err(|parallel::Interrupted| TournamentError::Interrupted)?;
        let ended = jobs.chunks(episodes.div_ceil(LOCKSTEP)).zip(&pairings).map(|(jobs, pairing)| {
            let ended: Vec<Ended> = jobs.iter().flat_map(|job| &job.ended).copied().collect();
            Score::of(&self.players[pairing.agents], &self.players[pairing.enemies], &ended)
        });
        let scores: Vec<Score> = ended.collect();
        let players = self.player_scores(&pairings, &scores);
        let scenario = setup.files.scenario()?.name;
        let rules = setup.rules;
        Ok(TournamentResult { scenario, rules, episodes, seed, greedy, players, scores })
    }

    fn check_names(&self) -> Result<(), TournamentError> {
        let Tournament { players, .. } = self;
        if players.len() < 2 {
            return Err(TournamentError::TooFewPlayers(players.len()));
        }
        if self.episodes == 0 {
            return Err(TournamentError::NoEpisodes);
        }
        // The folder of a team has several names.
        let is_script = |name: &str| Opponent::scripts().any(|script| script.name() == name);
        let folder = |name: &str| std::fs::canonicalize(name).ok().filter(|_| !is_script(name));
        let are_one = |a: &String, b: &String| a == b || folder(a).is_some_and(|a| Some(a) == folder(b));
        let is_known = |i: usize, player| players[..i].iter().any(|other| are_one(other, player));
        let twice = players.iter().enumerate().find(|(i, player)| is_known(*i, player));
        twice.map_or(Ok(()), |(_, player)| Err(TournamentError::Twice(player.clone())))
    }

    /// What is played: the given setup, or that of the first team. All teams must be trained in it.
    fn setup(&self, players: &[Player]) -> Result<BattleSetup, TournamentError> {
        let runs = || {
            let names = self.players.iter().zip(players);
            names.filter_map(|(name, player)| Some((name, player.team()?.run())))
        };
        let of_teams = || runs().next().map(|(_, run)| run.setup.clone());
        let setup = self.setup.clone().or_else(of_teams).ok_or(TournamentError::NoScenario)?;
        let (scenario, arena) = setup.arena()?;
        for (folder, run) in runs() {
            let (_, of_run) = run.setup.arena()?;
            if (of_run.scenario_hash(), of_run.episode_limit())
                != (arena.scenario_hash(), arena.episode_limit())
            {
                let played = BattleSetup { episode_limit: arena.episode_limit().into(), ..setup.clone() };
                let of_run = BattleSetup {
                    files: run.setup.files.clone(),
                    rules: run.setup.rules,
                    episode_limit: of_run.episode_limit().into(),
                    ..played.clone()
                };
                let (folder, given) = (folder.clone(), run.name.clone());
                let expected = scenario.name;
                let hint = match run.config.network {
                    NetworkKind::Universal => {
                        "; `smaclite-pool adapt` writes it as a team of another map".to_owned()
                    }
                    NetworkKind::Flat | NetworkKind::Units => String::new(),
                };
                let differences = of_run.differences(&played);
                return Err(TournamentError::OtherScenario { folder, given, expected, differences, hint });
            }
        }
        Ok(setup)
    }

    fn player_scores(&self, pairings: &[Pairing], scores: &[Score]) -> Vec<PlayerScore> {
        let n = self.players.len();
        let [mut points, mut played] = [vec![0.0; n], vec![0.0; n]];
        let mut battles = Vec::new();
        for (pairing, score) in pairings.iter().zip(scores).filter(|(p, _)| p.agents != p.enemies) {
            let (count, players) = (score.episodes as f64, [pairing.agents, pairing.enemies]);
            let of_agents = count * score.points();
            for (player, of_player) in players.into_iter().zip([of_agents, count - of_agents]) {
                points[player] += of_player;
                played[player] += count;
            }
            battles.push(Battles { players, count, points: of_agents, draws: score.draws as f64 });
        }
        let ratings = elo::ratings(n, &battles);
        let player = |(i, rating): (usize, elo::Elo)| PlayerScore {
            player: self.players[i].clone(),
            elo: rating.elo,
            elo_low: rating.elo - rating.half_width,
            elo_high: rating.elo + rating.half_width,
            points: points[i] / played[i].max(1.0),
        };
        ratings.into_iter().enumerate().map(player).collect()
    }
}

/// The jobs of all pairings, equally many per pairing.
fn jobs(pairings: &[Pairing], episodes: usize) -> Vec<Job<'_>> {
    let firsts = || (0..episodes).step_by(LOCKSTEP);
    let job = |pairing, first: usize| {
        let ended = vec![Ended::default(); LOCKSTEP.min(episodes - first)];
        Job { pairing, first, ended }
    };
    pairings.iter().flat_map(|pairing| firsts().map(move |first| job(pairing, first))).collect()
}
