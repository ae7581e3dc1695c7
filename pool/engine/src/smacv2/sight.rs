//! Who sees whom, and who can target whom.

use std::f64::consts::{PI, TAU};

use super::{Frame, Interface, Perception};

impl Interface {
    /// Whether an agent sees a unit, alive or not.
    pub(super) fn sees(&self, frame: &Frame, perception: &Perception, agent: usize, unit: usize) -> bool {
        let (range, distance) = (self.kind(frame, agent).sight, frame.distance(agent, unit));
        // With cones the range itself is within sight.
        if self.n_looks > 0 {
            return distance <= range && self.is_in_cone(frame, perception.looks[agent], agent, unit);
        }
        distance < range
    }

    /// Whether a unit is within the targeting range of an agent.
    pub(super) fn reaches(&self, frame: &Frame, perception: &Perception, agent: usize, unit: usize) -> bool {
        frame.distance(agent, unit) <= self.kind(frame, agent).reach
            && (self.n_looks == 0 || self.is_in_cone(frame, perception.looks[agent], agent, unit))
    }

    /// Whether a unit is in the cone of an agent that looks in this direction.
    pub(super) fn is_in_cone(&self, frame: &Frame, look: [f64; 2], agent: usize, unit: usize) -> bool {
        let ([dx, dy], [look_x, look_y]) = (frame.offset(agent, unit), look);
        let half = TAU / self.n_looks as f64 / 2.0;
        if !self.options.published {
            // The angle between look and offset, from their products; a unit at the same point is in sight.
            let angle = libm::atan2((look_x * dy - look_y * dx).abs(), look_x * dx + look_y * dy);
            return angle < half || half >= PI;
        }
        let least = |x: f64| if dx > 0.0 { x.max(1e-7) } else { x.min(-1e-7) };
        (libm::atan(dy / least(dx)) - libm::atan(look_y / least(look_x))).abs() < half
    }

    /// Which units each agent sees whatever else it may see: u8 0 or 1, `[n_agents, n_agents + n_enemies]`.
    /// In the published code, whether two agents see each other depends on the sight of the one with the
    /// lower number.
    ///
    /// # Panics
    /// If `out` has another size.
    pub fn write_visibility(&self, frame: &Frame, out: &mut [u8]) {
        let n_units = self.n_agents + self.n_enemies;
        assert_eq!(out.len(), self.n_agents * n_units, "one byte per agent and unit");
        out.fill(0);
        for agent in (0..self.n_agents).filter(|agent| frame.is_alive(*agent)) {
            for unit in (0..n_units).filter(|unit| *unit != agent && frame.is_alive(*unit)) {
                let judge = if self.options.published && unit < agent { unit } else { agent };
                let sees = frame.distance(agent, unit) < self.kind(frame, judge).sight;
                out[agent * n_units + unit] = u8::from(sees);
            }
        }
    }
}
