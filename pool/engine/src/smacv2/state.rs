//! The state, and the capabilities of agents.

use super::{Frame, Interface, Perception, ratio};

impl Interface {
    /// Writes the state, f32 `[state_size]`; `last_actions` are those of the agents.
    ///
    /// # Panics
    /// If `out` has another size.
    #[inline(never)]
    pub fn write_state(
        &self,
        frame: &Frame,
        perception: &Perception,
        last_actions: &[Option<u32>],
        out: &mut [f32],
    ) {
        assert_eq!(out.len(), self.sizes.state, "one state");
        if self.options.obs_instead_of_state {
            return self.write_obs(frame, perception, last_actions, out);
        }
        out.fill(0.0);
        let (allies, rest) = out.split_at_mut(self.n_agents * self.sizes.state_ally);
        let (enemies, rest) = rest.split_at_mut(self.n_enemies * self.sizes.state_enemy);
        for (agent, row) in allies.chunks_exact_mut(self.sizes.state_ally).enumerate() {
            if frame.is_alive(agent) {
                self.write_ally(frame, perception, agent, row);
            }
        }
        for (enemy, row) in enemies.chunks_exact_mut(self.sizes.state_enemy).enumerate() {
            let unit = self.n_agents + enemy;
            if frame.is_alive(unit) {
                self.write_enemy(frame, unit, row);
            }
        }
        if self.options.state_last_action {
            for (row, action) in rest.chunks_exact_mut(self.n_actions).zip(last_actions) {
                if let Some(action) = action {
                    row[*action as usize] = 1.0;
                }
            }
        }
        if self.options.state_timestep_number {
            out[self.sizes.state - 1] = self.time(perception) as f32;
        }
    }

    fn write_ally(&self, frame: &Frame, perception: &Perception, agent: usize, row: &mut [f32]) {
        let kind = self.kind(frame, agent);
        let [x, y] = self.relative(frame, agent);
        let readiness = ratio(frame.readiness[agent], kind.readiness);
        row[..4].copy_from_slice(&[
            self.health_share(frame, perception, agent) as f32,
            readiness as f32,
            x,
            y,
        ]);
        let mut at = 4;
        let mut put = |value: f64| {
            row[at] = value as f32;
            at += 1;
        };
        if self.ally_shields {
            put(ratio(frame.shield[agent], kind.shield));
        }
        perception.attack.get(agent).into_iter().for_each(|attack| put(*attack));
        perception.health.get(agent).into_iter().for_each(|level| put(*level));
        if self.options.conic_fov {
            perception.looks[agent].into_iter().for_each(&mut put);
        }
        if self.n_types > 0 {
            row[at + kind.bit] = 1.0;
        }
    }

    fn write_enemy(&self, frame: &Frame, unit: usize, row: &mut [f32]) {
        let kind = self.kind(frame, unit);
        let [x, y] = self.relative(frame, unit);
        row[..3].copy_from_slice(&[ratio(frame.health[unit], kind.health) as f32, x, y]);
        let mut at = 3;
        if self.enemy_shields {
            row[at] = ratio(frame.shield[unit], kind.shield) as f32;
            at += 1;
        }
        if self.n_types > 0 {
            row[at + kind.bit] = 1.0;
        }
    }

    /// A position relative to the centre of the map, in shares of its sides.
    fn relative(&self, frame: &Frame, unit: usize) -> [f32; 2] {
        let x = (f64::from(frame.x[unit]) - self.width / 2.0) / self.width;
        let y = (f64::from(frame.y[unit]) - self.height / 2.0) / self.height;
        [x as f32, y as f32]
    }

    /// Writes the capabilities, f32 `[n_agents, cap_size]`: attack probability, health level, type.
    ///
    /// # Panics
    /// If `out` has another size.
    pub fn write_capabilities(&self, frame: &Frame, perception: &Perception, out: &mut [f32]) {
        assert_eq!(out.len(), self.n_agents * self.cap_size(), "one row per agent");
        out.fill(0.0);
        // Without capabilities and types there is nothing to write.
        for (agent, row) in out.chunks_exact_mut(self.cap_size().max(1)).enumerate() {
            let drawn = perception.attack.get(agent).into_iter().chain(perception.health.get(agent));
            let n_drawn = drawn.zip(&mut *row).map(|(value, out)| *out = *value as f32).count();
            if self.n_types > 0 {
                row[n_drawn + self.kind(frame, agent).bit] = 1.0;
            }
        }
    }
}
