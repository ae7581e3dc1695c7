//! Rewards: from what a side did in a step to its reward, by SMAC's options, and the share of each unit.
//!
//! Both interfaces use this formula. They differ in what they count as damage: SMAClite's rules what hits
//! removed, SMACv2's code by how much health and shields have become less.

use smaclite_scenarios::Rewards;

/// How a battle ended, for one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum End {
    Won,
    Lost,
    Draw,
}

/// What a side did and lost in a step, in points.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Points {
    /// Damage to the other side.
    pub damage: f64,
    /// For deaths of units of the other side, less those of the own side where these count.
    pub deaths: f64,
    /// What the own units lost, as much as it counts.
    pub lost: f64,
}

impl Points {
    /// The reward of the side for which the step ended so. `greatest` is the greatest return before scaling.
    pub fn reward(&self, options: &Rewards, end: Option<End>, greatest: f64) -> f64 {
        let earned = self.damage + self.deaths;
        let earned = if options.only_positive { earned.max(0.0) } else { earned - self.lost };
        let reward = match end {
            _ if options.sparse => end.map_or(0.0, |end| match end {
                End::Won => 1.0,
                End::Lost => -1.0,
                End::Draw => 0.0,
            }),
            Some(End::Won) => earned + options.win,
            Some(End::Lost) => earned + options.defeat,
            Some(End::Draw) | None => earned,
        };
        scaled(reward, options, greatest)
    }
}

/// Points as a reward.
pub(crate) fn scaled(points: f64, options: &Rewards, greatest: f64) -> f64 {
    if !options.scale {
        return points;
    }
    // The return of a win over one unit is at least its health. Only SMACv2's published code scales by any
    // number, where negative points can cancel the health; rewards remain finite then.
    let is_too_near_0 = greatest.abs() < smaclite_units::MIN_POSITIVE;
    let greatest = if is_too_near_0 { smaclite_units::MIN_POSITIVE } else { greatest };
    // Two divisions, as in the published environment: the last bit depends on it.
    points / (greatest / options.scale_rate)
}

/// Adds to what the units of a side earned themselves, by battle-wide id, an equal part of what none of them
/// earned, so that their shares add up to the reward of the side.
pub(crate) fn divide(reward: f64, ids: &[u32], shares: &mut [f64]) {
    let of_side = || ids.iter().map(|&id| id as usize);
    let (own, size) = of_side().fold((0.0, 0.0), |(own, size), i| (own + shares[i], size + shares[i].abs()));
    let rest = reward - own;
    // Sums round, and a unit that did nothing has a share of exactly 0 where nothing is common.
    if rest.abs() > 1e-9 * (reward.abs() + size) {
        let part = rest / ids.len() as f64;
        of_side().for_each(|i| shares[i] += part);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn divided<const N: usize>(reward: f64, mut shares: [f64; N]) -> [f64; N] {
        divide(reward, &[0, 1], &mut shares);
        shares
    }

    /// The third unit is of the other side.
    #[test]
    fn what_no_unit_earned_is_divided_in_equal_parts() {
        assert_eq!(divided(7.0, [1.0, 2.0, 9.0]), [3.0, 4.0, 9.0]);
        assert_eq!(divided(-1.0, [3.0, 0.0, 9.0]), [1.0, -2.0, 9.0]);
        assert_eq!(divided(1.0, [0.0; 2]), [0.5; 2]);
    }

    /// Sums of shares that nearly cancel each other round as much as the greatest of them.
    #[test]
    fn what_is_left_by_rounding_is_not_divided() {
        assert_eq!(divided(3.0 + 1e-12, [3.0, 0.0]), [3.0, 0.0]);
        assert_eq!(divided(1e-7, [1e3, -1e3]), [1e3, -1e3]);
        assert_eq!(divided(0.0, [0.0; 2]), [0.0; 2]);
        assert_ne!(divided(1e-7, [1.0, -1.0]), [1.0, -1.0]);
    }

    /// Negative points cancel what a win over the enemies is worth.
    #[test]
    fn a_greatest_return_of_0_scales_by_a_finite_number() {
        let options = Rewards { scale: true, ..Rewards::DEFAULT };
        assert_eq!(scaled(3.0, &options, 60.0), 3.0 / (60.0 / options.scale_rate));
        assert_eq!(scaled(3.0, &options, -60.0), 3.0 / (-60.0 / options.scale_rate));
        for greatest in [0.0, 1e-300, -1e-300] {
            let least = smaclite_units::MIN_POSITIVE / options.scale_rate;
            assert_eq!(scaled(3.0, &options, greatest), 3.0 / least);
        }
    }
}
