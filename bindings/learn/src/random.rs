//! Generators by purpose. Every random number of a run comes from a generator that is seeded with the run's
//! seed, a purpose and counters, so no generator has to be saved, and none depends on the order in which
//! others are used.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// What the numbers are for.
#[derive(Clone, Copy)]
pub enum Purpose {
    /// First weights; the counter is the network.
    Weights = 1,
    /// Seeds of the environments; the counters are the number of the restart and the updates since then.
    Environments = 2,
    /// Actions; the counters are the step and the environment.
    Actions = 3,
    /// Order of the learnt rows; the counters are the update and the epoch.
    Minibatches = 4,
    /// Actions of an evaluation; the counters are the step and the environment.
    Evaluation = 5,
    /// Actions of enemies; the counters are the step and the environment.
    EnemyActions = 6,
    /// Actions of enemies in an evaluation; the counters are the step and the environment.
    EnemyEvaluation = 7,
    /// Who plays the enemies; the counters are the step and the environment.
    Players = 8,
    /// Seeds of evaluations of a run while it trains; the counters are the step count, and 1 if actions are
    /// sampled.
    TrainingEvaluations = 9,
    /// Seeds of the evaluation of its best weights; the second counter is 1 if actions are sampled.
    FinalEvaluation = 10,
    /// Runs that are drawn for the interval of a statistic; the counter is the repetition.
    Bootstrap = 11,
    /// Seeds of the episodes that say when a team wins; the counters are the step count, and the number of
    /// the block of episodes.
    TimeToWin = 12,
    /// Actions of a team that plays the enemies of a lane; the run is the seed of the battle's generator, and
    /// the counters are what that has drawn, and the steps of the episode.
    Opponents = 13,
    /// Seeds of the maps of a run but the first; the counter is the number of the map.
    Maps = 14,
}

/// Mixes the bits of a number so that numbers that differ in one bit differ in half of the bits: the last
/// step of SplitMix64 (Steele, Lea and Flood, 2014).
fn mix(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// A seed by purpose and counters.
pub fn seed(seed: u64, purpose: Purpose, counters: [u64; 2]) -> u64 {
    const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;
    let parts = [seed, purpose as u64, counters[0], counters[1]];
    parts
        .into_iter()
        .fold(0, |hash: u64, part| mix(hash.wrapping_add(GOLDEN) ^ mix(part.wrapping_add(GOLDEN))))
}

/// A generator by purpose and counters.
pub fn generator(run: u64, purpose: Purpose, counters: [u64; 2]) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(seed(run, purpose, counters))
}

/// Uniform in 0 <= u < 1.
pub fn uniform(generator: &mut Pcg64Mcg) -> f32 {
    (generator.next_u64() >> 40) as f32 / (1u64 << 24) as f32
}

/// A number of the standard normal distribution (Box and Muller, 1958).
pub fn normal(generator: &mut Pcg64Mcg) -> f64 {
    let mut uniform = || ((generator.next_u64() >> 11) as f64 + 0.5) / (1u64 << 53) as f64;
    let (radius, angle) = ((-2.0 * uniform().ln()).sqrt(), std::f64::consts::TAU * uniform());
    radius * angle.cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn purposes_and_counters_give_different_seeds() {
        let mut seeds: Vec<u64> = Vec::new();
        let purposes = [Purpose::Weights, Purpose::Environments, Purpose::Actions, Purpose::Minibatches];
        for purpose in purposes.into_iter().chain([
            Purpose::EnemyActions,
            Purpose::Players,
            Purpose::TrainingEvaluations,
            Purpose::FinalEvaluation,
            Purpose::Bootstrap,
            Purpose::TimeToWin,
            Purpose::Opponents,
        ]) {
            for run in 0..3 {
                seeds.extend((0..100).map(|i| seed(run, purpose, [i / 10, i % 10])));
            }
        }
        let count = seeds.len();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), count);
    }

    #[test]
    fn normal_numbers_have_mean_0_and_variance_1() {
        let mut generator = generator(1, Purpose::Weights, [0, 0]);
        let numbers: Vec<f64> = (0..10_000).map(|_| normal(&mut generator)).collect();
        let mean = numbers.iter().sum::<f64>() / 1e4;
        let variance = numbers.iter().map(|x| x * x).sum::<f64>() / 1e4;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05, "{mean} {variance}");
    }
}
