//! Running mean and standard deviation of the returns. The critic predicts returns in these units, so its
//! targets have variance 1 whatever the scale of the rewards.
//!
//! Mean and mean square are moving averages over updates, m = 0.9 m + 0.1 x, divided by 1 - 0.9^t, the weight
//! that the t observations so far have in them.
//!
//! A change of mean μ and deviation σ to μ' and σ' would change every prediction σ v + μ. The last
//! layer v = w a + b is changed so that none does: w' = w σ / σ' and b' = (σ b + μ - μ') / σ' give
//! σ' v' + μ' = σ v + μ (van Hasselt et al., 2016: "preserving outputs precisely").

const KEEP: f64 = 0.9;

/// Running statistics of the returns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Normaliser {
    /// Moving average of the mean of an update's returns.
    pub mean: f64,
    /// Moving average of their mean square.
    pub square: f64,
    /// The sum of the weights of all observations.
    pub weight: f64,
}

impl Normaliser {
    /// The mean and the standard deviation; 0 and 1 before the first update.
    pub fn mean_and_deviation(&self) -> (f64, f64) {
        if self.weight == 0.0 {
            return (0.0, 1.0);
        }
        let (mean, square) = (self.mean / self.weight, self.square / self.weight);
        (mean, (square - mean * mean).max(1e-4).sqrt())
    }

    /// Takes the returns of an update into account.
    pub fn update(&mut self, returns: impl Iterator<Item = f32> + Clone) {
        let count = returns.clone().count();
        if count == 0 {
            return;
        }
        let average = |power: i32| {
            returns.clone().map(|value| f64::from(value).powi(power)).sum::<f64>() / count as f64
        };
        self.mean = KEEP * self.mean + (1.0 - KEEP) * average(1);
        self.square = KEEP * self.square + (1.0 - KEEP) * average(2);
        self.weight = KEEP * self.weight + (1.0 - KEEP);
    }
}

/// Changes the last layer, its weights and its bias, so that predictions of returns stay what they were.
pub(crate) fn preserve_predictions(old: (f64, f64), new: (f64, f64), weight: &mut [f32], bias: &mut [f32]) {
    let ((old_mean, old_deviation), (new_mean, new_deviation)) = (old, new);
    weight.iter_mut().for_each(|w| *w = (f64::from(*w) * old_deviation / new_deviation) as f32);
    for b in bias {
        *b = ((old_deviation * f64::from(*b) + old_mean - new_mean) / new_deviation) as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_update_gives_its_own_mean_and_deviation() {
        let mut normaliser = Normaliser::default();
        assert_eq!(normaliser.mean_and_deviation(), (0.0, 1.0));
        normaliser.update([4.0, 8.0].into_iter());
        let (mean, deviation) = normaliser.mean_and_deviation();
        assert!((mean - 6.0).abs() < 1e-9 && (deviation - 2.0).abs() < 1e-9);
        for _ in 0..200 {
            normaliser.update([1.0, 3.0].into_iter());
        }
        let (mean, deviation) = normaliser.mean_and_deviation();
        assert!((mean - 2.0).abs() < 1e-6 && (deviation - 1.0).abs() < 1e-6, "{mean} {deviation}");
    }

    #[test]
    fn predictions_are_preserved() {
        let (old, new, a) = ((1.0, 2.0), (-3.0, 0.5), [0.3, -0.7]);
        let (mut weight, mut bias) = ([0.4, 0.9], [0.1]);
        let predict = |(mean, deviation): (f64, f64), weight: &[f32], bias: &[f32]| {
            let v = f64::from(weight[0]) * a[0] + f64::from(weight[1]) * a[1] + f64::from(bias[0]);
            deviation * v + mean
        };
        let before = predict(old, &weight, &bias);
        preserve_predictions(old, new, &mut weight, &mut bias);
        assert!((predict(new, &weight, &bias) - before).abs() < 1e-5);
    }
}
