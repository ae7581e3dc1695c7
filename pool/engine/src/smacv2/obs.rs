//! Observations.

use super::{Frame, Interface, Perception, ratio};

/// Writes floats from left to right.
struct Row<'a> {
    out: &'a mut [f32],
    at: usize,
}

impl Row<'_> {
    fn put(&mut self, value: f64) {
        self.out[self.at] = value as f32;
        self.at += 1;
    }

    fn put_single(&mut self, value: f32) {
        self.out[self.at] = value;
        self.at += 1;
    }

    fn skip(&mut self, n: usize) {
        self.at += n;
    }

    /// A one-hot of `n`.
    fn put_one_hot(&mut self, n: usize, place: usize) {
        if n > 0 {
            self.out[self.at + place] = 1.0;
        }
        self.at += n;
    }
}

impl Interface {
    /// Writes the observations of all agents as they perceived the battle: f32 `[n_agents, obs_size]`, or
    /// longer rows, whose rest becomes 0. `last_actions` are those of the agents; the time is rounded to f32.
    ///
    /// # Panics
    /// If `out` has another size.
    #[inline(never)]
    pub fn write_obs(
        &self,
        frame: &Frame,
        perception: &Perception,
        last_actions: &[Option<u32>],
        out: &mut [f32],
    ) {
        let row_len = out.len() / self.n_agents;
        assert!(row_len >= self.sizes.obs && out.len() == self.n_agents * row_len, "one row per agent");
        for (agent, row) in out.chunks_exact_mut(row_len).enumerate() {
            row.fill(0.0);
            if self.options.obs_starcraft && frame.is_alive(agent) {
                self.write_row(frame, perception, last_actions, agent, row);
            }
            if self.options.obs_timestep_number {
                row[self.sizes.obs - 1] = self.time(perception) as f32;
            }
        }
    }

    fn write_row(
        &self,
        frame: &Frame,
        perception: &Perception,
        last_actions: &[Option<u32>],
        agent: usize,
        out: &mut [f32],
    ) {
        let mut row = Row { out, at: 0 };
        self.put_moves(frame, agent, &mut row);
        self.put_enemies(frame, perception, agent, &mut row);
        self.put_allies(frame, perception, last_actions, agent, &mut row);
        self.put_own(frame, perception, agent, &mut row);
    }

    fn put_moves(&self, frame: &Frame, agent: usize, row: &mut Row<'_>) {
        let moves = self.moves(frame, agent);
        (0..4).for_each(|i| row.put(f64::from(moves >> i & 1)));
        let o = &self.options;
        if !o.obs_pathing_grid && !o.obs_terrain_height {
            return;
        }
        let (x, y) = (f64::from(frame.x[agent]).trunc(), f64::from(frame.y[agent]).trunc());
        let (near, far) = (o.move_amount, 2.0 * o.move_amount);
        let around = [
            [0.0, far],
            [0.0, -far],
            [far, 0.0],
            [-far, 0.0],
            [near, near],
            [-near, -near],
            [near, -near],
            [-near, near],
            [0.0, 0.0],
        ];
        let squares = around.map(|[dx, dy]| [(x + dx).trunc() as i64, (y + dy).trunc() as i64]);
        if o.obs_pathing_grid {
            let is_open = |[x, y]: [i64; 2]| !self.is_on_map(x, y) || self.terrain.is_walkable(x, y);
            squares[..8].iter().for_each(|square| row.put(f64::from(u8::from(is_open(*square)))));
        }
        if o.obs_terrain_height {
            squares.iter().for_each(|[x, y]| row.put(self.height_at(*x, *y)));
        }
    }

    fn is_on_map(&self, x: i64, y: i64) -> bool {
        x >= 0 && y >= 0 && x < self.width as i64 && y < self.height as i64
    }

    /// The height of a square; 1 off the map.
    fn height_at(&self, x: i64, y: i64) -> f64 {
        const FLAT: f64 = 127.0 / 255.0;
        if !self.is_on_map(x, y) {
            return 1.0;
        }
        let at = y as usize * self.width as usize + x as usize;
        self.heights.as_ref().map_or(FLAT, |heights| heights[at])
    }

    fn put_enemies(&self, frame: &Frame, perception: &Perception, agent: usize, row: &mut Row<'_>) {
        let (own, size) = (*self.kind(frame, agent), self.sizes.enemy);
        let end = row.at + self.n_enemies * size;
        let shown = &perception.shown[agent * self.n_enemies..][..self.n_enemies];
        let seen = shown.iter().zip(frame.distances_to_enemies(agent)).enumerate();
        let only_range_matters = !own.is_healer && self.n_looks == 0;
        for (block, (enemy, (shown, distance))) in row.out[row.at..end].chunks_exact_mut(size).zip(seen) {
            if !shown {
                continue;
            }
            let unit = self.n_agents + enemy;
            // Of a healer this says whether it can heal the ally of that number.
            let is_targetable = match only_range_matters {
                true => *distance <= own.reach,
                false => self.is_targetable(frame, perception, agent, enemy),
            };
            let offset = frame.offset(agent, unit).map(|x| (x / own.sight) as f32);
            block[0] = f32::from(u8::from(is_targetable));
            block[1] = (distance / own.sight) as f32;
            block[2..4].copy_from_slice(&offset);
            if perception.mask.get(agent * self.n_enemies + enemy).is_some_and(|is_masked| *is_masked) {
                continue;
            }
            let mut at = 4;
            if self.options.obs_all_health {
                let n = 1 + usize::from(self.enemy_shields);
                block[at..at + n].copy_from_slice(&frame.shares[unit][..n]);
                at += n;
            }
            if self.n_types > 0 {
                block[at + self.kind(frame, unit).bit] = 1.0;
            }
        }
        row.at = end;
    }

    fn put_allies(
        &self,
        frame: &Frame,
        perception: &Perception,
        last_actions: &[Option<u32>],
        agent: usize,
        row: &mut Row<'_>,
    ) {
        let (o, sight, size) = (&self.options, self.kind(frame, agent).sight, self.sizes.ally);
        let end = row.at + self.n_agents.saturating_sub(1) * size;
        // Without `observe` the health is hidden, too, not only the level.
        let hides_health = o.health.is_some_and(|health| !health.observe);
        let distances =
            frame.distances_to_allies(agent).iter().enumerate().filter(|(ally, _)| *ally != agent);
        for (block, (ally, distance)) in row.out[row.at..end].chunks_exact_mut(size).zip(distances) {
            let is_shown = o.fully_observable
                || match self.n_looks {
                    0 => *distance < sight,
                    _ => self.sees(frame, perception, agent, ally),
                };
            if !is_shown || !frame.is_alive(ally) {
                continue;
            }
            let offset = frame.offset(agent, ally).map(|x| (x / sight) as f32);
            block[0] = 1.0;
            block[1] = (distance / sight) as f32;
            block[2..4].copy_from_slice(&offset);
            let mut block = Row { out: block, at: 4 };
            if o.obs_all_health {
                let [share, shield] = frame.shares[ally];
                match o.health {
                    None => block.put_single(share),
                    Some(_) if hides_health => block.skip(1),
                    Some(_) => block.put(self.health_share(frame, perception, ally)),
                }
                if self.ally_shields {
                    block.put_single(shield);
                }
            }
            if let Some(attack) = o.attack {
                block.put(if attack.observe { perception.attack[ally] } else { 0.0 });
            }
            if let Some(health) = o.health {
                block.put(if health.observe { perception.health[ally] } else { 0.0 });
            }
            match o.observe_team {
                true => block.put_one_hot(self.n_types, self.kind(frame, ally).bit),
                false => block.skip(self.n_types),
            }
            if let (true, Some(action)) = (o.obs_last_action, last_actions[ally]) {
                block.put_one_hot(self.n_actions, action as usize);
            }
        }
        row.at = end;
    }

    fn put_own(&self, frame: &Frame, perception: &Perception, agent: usize, row: &mut Row<'_>) {
        let (o, kind) = (&self.options, self.kind(frame, agent));
        if o.obs_own_health || o.obs_all_health {
            row.put(self.health_share(frame, perception, agent));
            if self.ally_shields {
                row.put(ratio(frame.shield[agent], kind.shield));
            }
        }
        if o.attack.is_some() {
            row.put(perception.attack[agent]);
        }
        if o.health.is_some() {
            row.put(perception.health[agent]);
        }
        if o.obs_own_pos {
            row.put(f64::from(frame.x[agent]) / self.width);
            row.put(f64::from(frame.y[agent]) / self.height);
        }
        if o.conic_fov {
            perception.looks[agent].into_iter().for_each(|look| row.put(look));
        }
        row.put_one_hot(self.n_types, kind.bit);
    }

    /// The health of an agent as a share; with health levels the share of what is above the level, which is
    /// negative below it.
    pub(crate) fn health_share(&self, frame: &Frame, perception: &Perception, agent: usize) -> f64 {
        let share = ratio(frame.health[agent], self.kind(frame, agent).health);
        match perception.health.get(agent) {
            Some(level) => 1.0 / (1.0 - level) * (share - level),
            None => share,
        }
    }
}
