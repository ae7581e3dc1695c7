//! The teams that play the enemies and do not learn, and which of them plays in which environment: copies
//! of the team that is trained, or one team of another run.
//!
//! Copies that are hard to beat are drawn more often (prioritised fictitious self-play, as in AlphaStar;
//! Vinyals et al., 2019): with the weight (1 - w)², where w is the team's win rate against the copy, or
//! [`EASIEST`] if that is less, so that no copy is forgotten. The estimate of the win rate begins at 0; each
//! episode against the copy moves it by 1 / [`MEMORY`] of the way to 1 if the team won, and to 0 otherwise.
//! So a new copy is hard to beat until episodes show that it is not: it is drawn often, and others retire
//! before it. With 1/2 it was the easiest one wherever draws were common, and the first copies never left.

use crate::random::uniform;
use crate::team::Network;
use rand_pcg::Pcg64Mcg;
use std::sync::Arc;

/// How many episodes an estimate of a win rate is about.
const MEMORY: f64 = 32.0;

/// The win rate that counts for copies that are beaten more often than that.
const EASIEST: f64 = 0.9;

/// Who plays the enemies of an environment, in the episodes that no script plays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Player {
    /// The team that is trained.
    Own,
    /// The rival of this number.
    Rival(u64),
}

/// A team that does not learn.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Rival {
    /// The update after which it was copied; 0 for a team of another run.
    pub number: u64,
    /// Its policy.
    pub actor: Arc<Network>,
    /// How often the trained team wins against it, as estimated.
    pub win_rate: f64,
    /// No more episodes begin against it.
    pub is_retired: bool,
}

impl Rival {
    pub fn new(number: u64, actor: Network) -> Rival {
        Rival { number, actor: Arc::new(actor), win_rate: 0.0, is_retired: false }
    }

    fn weight(&self) -> f64 {
        (1.0 - self.win_rate.min(EASIEST)).powi(2)
    }
}

/// The rivals, and who plays where.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct League {
    /// By number.
    pub rivals: Vec<Rival>,
    /// By environment; empty if scripts play all enemies.
    pub players: Vec<Player>,
}

impl League {
    /// A league in which the team itself plays all enemies, until players are drawn.
    pub fn new(num_envs: usize, rivals: Vec<Rival>) -> League {
        League { rivals, players: vec![Player::Own; num_envs] }
    }

    /// A rival that plays the enemies everywhere.
    pub fn of_one(num_envs: usize, actor: Network) -> League {
        League { rivals: vec![Rival::new(0, actor)], players: vec![Player::Rival(0); num_envs] }
    }

    /// Whether a team plays enemies.
    pub fn is_played(&self) -> bool {
        !self.players.is_empty()
    }

    /// Draws the player of an environment's next episode: the team itself with the probability
    /// `self_share`, or if there is no rival.
    pub fn draw(&mut self, env: usize, self_share: f64, generator: &mut Pcg64Mcg) {
        let (own, share) = (f64::from(uniform(generator)), f64::from(uniform(generator)));
        let active = || self.rivals.iter().filter(|rival| !rival.is_retired);
        let mut rest = share * active().map(Rival::weight).sum::<f64>();
        let mut drawn = Player::Own;
        if own >= self_share {
            for rival in active() {
                drawn = Player::Rival(rival.number);
                rest -= rival.weight();
                if rest < 0.0 {
                    break;
                }
            }
        }
        self.players[env] = drawn;
    }

    /// Takes the outcome of an episode against a rival into account.
    pub fn observe(&mut self, player: Player, won: bool) {
        if let Player::Rival(number) = player
            && let Some(rival) = self.rivals.iter_mut().find(|rival| rival.number == number)
        {
            rival.win_rate += (f64::from(u8::from(won)) - rival.win_rate) / MEMORY;
        }
    }

    /// Adds a new copy. If there are more than `size` then, the one that is easiest to beat retires, the
    /// oldest of equals, so never the new one; it leaves when the last episode against it has ended.
    pub fn add(&mut self, copy: Rival, size: usize) {
        self.rivals.push(copy);
        if self.size() > size {
            let active = self.rivals.iter_mut().filter(|rival| !rival.is_retired);
            let easiest = active.reduce(
                |easiest, rival| {
                    if rival.win_rate > easiest.win_rate { rival } else { easiest }
                },
            );
            easiest.into_iter().for_each(|rival| rival.is_retired = true);
        }
        let League { rivals, players } = self;
        rivals.retain(|rival| !rival.is_retired || players.contains(&Player::Rival(rival.number)));
    }

    /// Rivals against which episodes begin.
    pub fn size(&self) -> usize {
        self.rivals.iter().filter(|rival| !rival.is_retired).count()
    }

    /// The policy of a player, where `own` is that of the team that is trained.
    pub fn actor<'a>(&'a self, player: Player, own: &'a Network) -> &'a Network {
        let rival = self.rivals.iter().find(|rival| Player::Rival(rival.number) == player);
        rival.map_or(own, |rival| &rival.actor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::random::{Purpose, generator};
    use crate::team::Team;
    use smaclite_engine::Sizes;

    fn rival(number: u64, win_rate: f64) -> Rival {
        let sizes = Sizes { n_agents: 2, n_actions: 8, obs_size: 3, state_size: 4, ..Sizes::default() };
        let actor = Team::new(&Config { hidden: vec![4], ..Config::for_agents(3) }, &sizes.into()).actor;
        Rival { win_rate, ..Rival::new(number, actor) }
    }

    fn league(win_rates: &[f64]) -> League {
        League::new(4, (1..).zip(win_rates).map(|(number, win_rate)| rival(number, *win_rate)).collect())
    }

    /// Of 10,000 draws, how many each player got.
    fn counts(league: &League, self_share: f64) -> (u32, Vec<u32>) {
        let (mut league, mut generator) = (league.clone(), generator(1, Purpose::Players, [0, 0]));
        let (mut own, mut of_rivals) = (0, vec![0; league.rivals.len()]);
        for _ in 0..10_000 {
            league.draw(2, self_share, &mut generator);
            match league.players[2] {
                Player::Own => own += 1,
                Player::Rival(number) => of_rivals[number as usize - 1] += 1,
            }
        }
        (own, of_rivals)
    }

    #[test]
    fn copies_that_are_hard_to_beat_are_drawn_more_often() {
        let (own, rivals) = counts(&league(&[0.0, 0.5, 0.8, 1.0]), 0.25);
        let weights = [1.0, 0.25, 0.04, 0.01];
        let total: f64 = weights.iter().sum();
        assert!((f64::from(own) - 2500.0).abs() < 260.0, "{own}"); // six standard deviations
        for (count, weight) in rivals.iter().zip(weights) {
            let share = 0.75 * weight / total;
            let deviation = (10_000.0 * share * (1.0 - share)).sqrt();
            assert!((f64::from(*count) - 10_000.0 * share).abs() < 6.0 * deviation, "{rivals:?}");
        }
    }

    #[test]
    fn the_team_plays_itself_where_there_is_no_rival() {
        assert_eq!(counts(&league(&[]), 0.0), (10_000, vec![]));
        assert_eq!(counts(&league(&[0.5]), 0.0), (0, vec![10_000]));
        assert_eq!(counts(&league(&[0.5]), 1.0), (10_000, vec![0]));
    }

    #[test]
    fn estimates_approach_the_share_of_won_episodes() {
        let mut league = league(&[0.5, 0.5]);
        for i in 0..300 {
            league.observe(Player::Rival(2), i % 4 != 0);
            league.observe(Player::Own, false);
        }
        assert_eq!(league.rivals[0].win_rate, 0.5);
        assert!((league.rivals[1].win_rate - 0.75).abs() < 0.05, "{:?}", league.rivals[1].win_rate);
    }

    /// An episode is played to its end by the team that began it.
    #[test]
    fn the_easiest_copy_retires_and_ends_its_episodes() {
        let mut league = league(&[0.3, 0.9, 0.9]);
        league.players[1] = Player::Rival(2);
        league.add(rival(4, 0.0), 3);
        let numbers = |league: &League| league.rivals.iter().map(|rival| rival.number).collect::<Vec<_>>();
        assert_eq!((numbers(&league), league.size()), (vec![1, 2, 3, 4], 3));
        assert!(league.rivals[1].is_retired);
        league.players[1] = Player::Own;
        league.add(rival(5, 0.0), 3);
        assert_eq!((numbers(&league), league.size()), (vec![1, 4, 5], 3));
    }

    /// Where draws are common, the team wins few episodes even against old copies. The new copy was then the
    /// easiest by its estimate, and retired at once.
    #[test]
    fn new_copies_replace_old_ones_where_wins_are_rare() {
        for (episodes, wins_of) in [(0, 1), (8, 5), (8, 1000), (100, 5)] {
            let (mut league, size) = (league(&[]), 4);
            for number in 1..=40 {
                league.add(Rival::new(number, rival(number, 0.0).actor.without_optimiser()), size);
                assert_eq!(league.rivals.last().map(|rival| rival.number), Some(number));
                for rival in league.rivals.clone() {
                    for i in 1..=episodes {
                        league.observe(Player::Rival(rival.number), i % wins_of == 0);
                    }
                }
            }
            let numbers: Vec<u64> = league.rivals.iter().map(|rival| rival.number).collect();
            assert_eq!(numbers, [37, 38, 39, 40], "{episodes} episodes, one of {wins_of} is won");
        }
    }
}
