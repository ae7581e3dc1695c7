//! Elo ratings from the points of a tournament: the Bradley-Terry model (Bradley and Terry, 1952) by maximum
//! likelihood, a draw as half a win.
//!
//! With strengths θ, player i scores against j the share p_ij = 1 / (1 + exp(θ_j - θ_i)). If i has s_ij
//! points of n_ij battles against j, the logarithm of the likelihood is the sum of s_ij ln p_ij over all
//! ordered pairs. Its derivatives are
//!
//!   g_i = Σ_j (s_ij - n_ij p_ij),    -∂g_i/∂θ_j = H_ij = -n_ij p_ij p_ji,    H_ii = -Σ_j≠i H_ij.
//!
//! H is singular, since only differences of strengths matter. With the mean strength held at 0 its inverse is
//! P = (H + J/n)⁻¹ - J/n, where J is all ones.
//!
//! The covariance of the strengths is P B P, where B is the covariance of the gradient (the sandwich of
//! Huber, 1967): as H, with n_ij σ_ij² in the place of n_ij p_ij p_ji, where σ_ij² is the variance of the
//! scores that i had in these battles. P alone, the inverse of the Fisher information, takes a draw for a
//! battle that is lost or won by chance, which is far too wide an interval for players who draw most of their
//! battles. The battles in which i has the agents and those in which j has them have a variance each, and
//! n_ij σ_ij² is their sum: that one side of a scenario is the stronger one is no chance.
//!
//! A player who wins all battles would have an infinite strength. So each pair that has played is given one
//! more battle, half won and half lost, of which each of its pairings gets an equal part.

/// The Elo of a player whose strength is the mean of all.
const MEAN: f64 = 1000.0;

/// Ten to one are 400 points, by the definition of Elo.
const PER_STRENGTH: f64 = 400.0 / std::f64::consts::LN_10;

/// Standard deviations on either side of a 95 % interval.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// Newton's method converges in a few iterations; the bound is for points that are no numbers.
const MAX_ITERATIONS: usize = 1000;

/// An Elo rating, and the half width of its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Elo {
    pub elo: f64,
    pub half_width: f64,
}

/// The battles of a pairing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Battles {
    /// Two that differ.
    pub players: [usize; 2],
    pub count: f64,
    /// Those of the first player, with draws as halves.
    pub points: f64,
    pub draws: f64,
}

/// Rates players, who must all be connected by battles.
pub(super) fn ratings(n: usize, pairings: &[Battles]) -> Vec<Elo> {
    let pairings = with_prior(pairings);
    let mut points = vec![vec![0.0; n]; n];
    for Battles { players: [one, other], count, points: of_one, .. } in pairings.iter().copied() {
        points[one][other] += of_one;
        points[other][one] += count - of_one;
    }
    let mut strengths = vec![0.0; n];
    for _ in 0..MAX_ITERATIONS {
        let (gradient, inverse) = (gradient(&points, &strengths), inverse(information(&points, &strengths)));
        let step: Vec<f64> = inverse.iter().map(|row| dot(row, &gradient)).collect();
        let longest = step.iter().fold(0.0, |longest: f64, x| longest.max(x.abs()));
        // A whole step could overshoot where the likelihood is flat.
        let share = 1.0 / longest.max(1.0);
        strengths.iter_mut().zip(&step).for_each(|(strength, step)| *strength += share * step);
        if longest < 1e-10 {
            break;
        }
    }
    let inverse = inverse(information(&points, &strengths));
    let variance = |i: usize| -> f64 {
        let of_pairing = |battles: &Battles| {
            let [one, other] = battles.players;
            battles.points_variance() * (inverse[i][one] - inverse[i][other]).powi(2)
        };
        pairings.iter().map(of_pairing).sum()
    };
    let rating = |(i, strength): (usize, &f64)| Elo {
        elo: MEAN + PER_STRENGTH * strength,
        half_width: NORMAL_95 * PER_STRENGTH * variance(i).sqrt(),
    };
    strengths.iter().enumerate().map(rating).collect()
}

impl Battles {
    /// The sum of the squared distances of the scores from their mean. A score is 1, 1/2 for a draw, or 0.
    fn points_variance(&self) -> f64 {
        // A draw gives half a point, whose square is a quarter.
        let of_squares = self.points - self.draws / 4.0;
        (of_squares - self.points * self.points / self.count).max(0.0)
    }
}

/// With one battle more per pair.
fn with_prior(pairings: &[Battles]) -> Vec<Battles> {
    let pair = |battles: &Battles| {
        let [one, other] = battles.players;
        [one.min(other), one.max(other)]
    };
    let with_prior = |battles: &Battles| {
        let of_pair = pairings.iter().filter(|other| pair(other) == pair(battles)).count();
        let share = 1.0 / of_pair as f64;
        Battles { count: battles.count + share, points: battles.points + share / 2.0, ..*battles }
    };
    pairings.iter().map(with_prior).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// p_ij.
fn share(strengths: &[f64], i: usize, j: usize) -> f64 {
    1.0 / (1.0 + (strengths[j] - strengths[i]).exp())
}

fn gradient(points: &[Vec<f64>], strengths: &[f64]) -> Vec<f64> {
    let part = |i: usize, j: usize| points[i][j] - (points[i][j] + points[j][i]) * share(strengths, i, j);
    (0..points.len()).map(|i| (0..points.len()).map(|j| part(i, j)).sum()).collect()
}

/// H + J/n.
fn information(points: &[Vec<f64>], strengths: &[f64]) -> Vec<Vec<f64>> {
    let n = points.len();
    let weight =
        |i: usize, j: usize| (points[i][j] + points[j][i]) * share(strengths, i, j) * share(strengths, j, i);
    let mut matrix = vec![vec![1.0 / n as f64; n]; n];
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|(i, j)| i != j) {
        matrix[i][j] -= weight(i, j);
        matrix[i][i] += weight(i, j);
    }
    matrix
}

/// The inverse of a positive definite matrix, by Gauss-Jordan elimination, which needs no pivots for it.
fn inverse(mut matrix: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let n = matrix.len();
    let unit = |i: usize| (0..n).map(|j| f64::from(u8::from(i == j))).collect();
    let mut inverse: Vec<Vec<f64>> = (0..n).map(unit).collect();
    for column in 0..n {
        let pivot = 1.0 / matrix[column][column];
        for row in [&mut matrix[column], &mut inverse[column]] {
            row.iter_mut().for_each(|x| *x *= pivot);
        }
        let (from, of_inverse) = (matrix[column].clone(), inverse[column].clone());
        for row in (0..n).filter(|row| *row != column) {
            let factor = matrix[row][column];
            matrix[row].iter_mut().zip(&from).for_each(|(x, y)| *x -= factor * y);
            inverse[row].iter_mut().zip(&of_inverse).for_each(|(x, y)| *x -= factor * y);
        }
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_learn::random::{Purpose, generator, uniform};

    fn battles(players: [usize; 2], count: f64, points: f64) -> Battles {
        Battles { players, count, points, draws: 0.0 }
    }

    /// Of two players the maximum is where the expected share is the scored one, and the difference of their
    /// strengths has the variance 1 / (n p q).
    #[test]
    fn two_players_have_the_ratings_of_the_closed_form() {
        let ratings = ratings(2, &[battles([0, 1], 199.0, 149.5)]);
        let difference = 400.0 * (150.0f64 / 50.0).log10();
        let deviation = PER_STRENGTH * (1.0 / (200.0 * 0.75 * 0.25_f64)).sqrt();
        for (rating, sign) in ratings.iter().zip([0.5, -0.5]) {
            assert!((rating.elo - (1000.0 + sign * difference)).abs() < 1e-9, "{ratings:?}");
            assert!((rating.half_width - NORMAL_95 * deviation / 2.0).abs() < 1e-9, "{ratings:?}");
        }
    }

    #[test]
    fn who_wins_all_battles_has_a_finite_rating_and_a_wide_interval() {
        let ratings = ratings(2, &[battles([0, 1], 1000.0, 1000.0)]);
        assert!((ratings[0].elo - ratings[1].elo - 400.0 * 2001.0f64.log10()).abs() < 1e-6, "{ratings:?}");
        assert!(ratings[0].half_width > 200.0, "{ratings:?}");
    }

    /// Where the agents always win, intervals were ten times as wide, as if they won half of the battles by
    /// chance.
    #[test]
    fn the_stronger_side_is_no_chance() {
        let mut pairings = vec![battles([0, 1], 50.0, 50.0), battles([1, 0], 50.0, 50.0)];
        let certain = ratings(2, &pairings);
        assert!(certain.iter().all(|rating| (rating.elo - 1000.0).abs() < 1e-9), "{certain:?}");
        assert!(certain[0].half_width < 5.0, "{certain:?}");
        pairings.iter_mut().for_each(|battles| battles.points = 25.0);
        assert!(ratings(2, &pairings)[0].half_width > 30.0);
    }

    /// Tournaments of players whose strengths are known: each true rating is in its interval in about 95 % of
    /// them. Of the pairs one does not play. Intervals were up to fifteen times too wide where battles are
    /// drawn.
    #[test]
    fn intervals_contain_the_true_ratings() {
        let truth = [1.0, 0.4, -0.1, -1.3];
        let (n_tournaments, n_battles) = (400, 60);
        for of_draws in [0.0, 0.9] {
            let mut inside = 0;
            for tournament in 0..n_tournaments {
                let mut generator = generator(1, Purpose::Evaluation, [tournament, 0]);
                let mut pairings = Vec::new();
                let pairs = (0..truth.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
                for (i, j) in pairs.filter(|pair| *pair != (3, 0)) {
                    // As many draws as leave the expected share what it is.
                    let expected = share(&truth, i, j);
                    let drawn = of_draws * 2.0 * expected.min(1.0 - expected);
                    let mut of_pair = battles([i, j], f64::from(n_battles), 0.0);
                    for _ in 0..n_battles {
                        let chance = f64::from(uniform(&mut generator));
                        let is_drawn = chance < drawn;
                        let i_wins = !is_drawn && chance < expected + drawn / 2.0;
                        of_pair.points += if is_drawn { 0.5 } else { f64::from(u8::from(i_wins)) };
                        of_pair.draws += f64::from(u8::from(is_drawn));
                    }
                    pairings.push(of_pair);
                }
                let contains = |(rating, strength): (&Elo, &f64)| {
                    (rating.elo - (MEAN + PER_STRENGTH * strength)).abs() < rating.half_width
                };
                let ratings = ratings(truth.len(), &pairings);
                inside += ratings.iter().zip(&truth).filter(|&pair| contains(pair)).count();
            }
            let share = inside as f64 / (n_tournaments as f64 * truth.len() as f64);
            assert!((0.92..0.97).contains(&share), "{share}, {of_draws}");
        }
    }
}
