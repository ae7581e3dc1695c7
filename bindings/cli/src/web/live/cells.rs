//! The cells of the grid: the newest row of every environment, as far as frames showed it.

use super::battles::Battles;
use crate::web::protocol::GridCell;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use smaclite_ipc::Batch;
use smaclite_pool::fields::Field;
use smaclite_view::page::encode_moments;
use smaclite_view::{EpisodeResult, Moment};
use std::ops::Range;

pub(super) struct Cells {
    cells: Vec<Cell>,
    /// The frame that was taken last.
    sequence: u64,
    /// The first of the frames up to that one of which none was missed.
    unbroken: u64,
}

/// An environment.
#[derive(Clone, Default)]
struct Cell {
    /// The frame that showed it, or 0.
    sequence: u64,
    length: Option<i32>,
    episode_return: Option<f32>,
    /// How the episode ended that the row shows the end of.
    outcome: Option<EpisodeResult>,
    /// How the last episode ended; `None` if its end may have been missed.
    last_outcome: Option<EpisodeResult>,
    state: Vec<f32>,
    /// The encoded moment of the state.
    encoded: Option<String>,
    /// Where the units are; the dead stay where they were.
    moment: Option<Moment>,
}

impl Cells {
    pub(super) fn new(num_envs: usize) -> Cells {
        Cells { cells: vec![Cell::default(); num_envs], sequence: 0, unbroken: 0 }
    }

    /// Takes the rows of a frame.
    pub(super) fn take(&mut self, batch: &Batch) {
        if batch.sequence() == self.sequence {
            return;
        }
        if batch.sequence() != self.sequence + 1 {
            self.unbroken = batch.sequence();
        }
        self.sequence = batch.sequence();
        let lengths = batch.field::<i32>(Field::EpisodeLength);
        let returns = batch.field::<f32>(Field::EpisodeReturn);
        let won = batch.field::<u8>(Field::BattleWon);
        let state_size = batch.layout().sizes().state_size;
        let states = batch.field::<f32>(Field::State);
        for (slot, &env) in batch.env_id().iter().enumerate() {
            let Some(cell) = usize::try_from(env).ok().and_then(|env| self.cells.get_mut(env)) else {
                continue; // a reset of some environments leaves slots empty
            };
            let length = lengths.map(|lengths| lengths[slot]);
            if cell.sequence < self.unbroken && !cell.goes_on(length, batch.sequence()) {
                cell.last_outcome = None;
            }
            cell.sequence = batch.sequence();
            cell.length = length;
            cell.episode_return = returns.map(|returns| returns[slot]);
            cell.outcome = match (batch.terminated()[slot], batch.truncated()[slot]) {
                (0, 0) => None,
                (0, _) => Some(EpisodeResult::Truncated),
                _ => won.map(|won| if won[slot] == 1 { EpisodeResult::Won } else { EpisodeResult::Lost }),
            };
            cell.last_outcome = cell.outcome.or(cell.last_outcome);
            if let Some(states) = states {
                let row = &states[slot * state_size..(slot + 1) * state_size];
                cell.state.clear();
                cell.state.extend_from_slice(row);
                cell.encoded = None;
            }
        }
    }

    /// The cells of some environments that changed after a frame, and the newest frame.
    pub(super) fn news(&mut self, envs: Range<usize>, after: u64, battles: &Battles) -> (Vec<GridCell>, u64) {
        let envs = envs.start.min(self.cells.len())..envs.end.min(self.cells.len());
        let first = envs.start;
        let changed = self.cells[envs].iter_mut().enumerate().filter(|(_, cell)| cell.sequence > after);
        let news = changed.map(|(i, cell)| cell.news(first + i, battles)).collect();
        (news, self.sequence)
    }
}

impl Cell {
    /// Whether each of the frames since the one that showed it, of which some were missed, had one more step
    /// of its episode, or of the next one if that frame showed an end. Else another end may have been missed.
    fn goes_on(&self, length: Option<i32>, sequence: u64) -> bool {
        let (Some(before), Some(now)) = (self.length, length) else { return false };
        let frames = i64::try_from(sequence.saturating_sub(self.sequence)).unwrap_or(i64::MAX);
        let (before, now) = (i64::from(before), i64::from(now));
        // The first frame of an episode may be the one of its reset, which is no step.
        if self.outcome.is_some() { now >= frames - 1 } else { now - before == frames }
    }

    fn news(&mut self, env: usize, battles: &Battles) -> GridCell {
        if self.encoded.is_none() && !self.state.is_empty() {
            let mut moment = Moment::from_state(&battles.scenario, &self.state);
            for (id, unit) in moment.units.iter_mut().enumerate().filter(|(_, unit)| !unit.alive) {
                let before = self.moment.as_ref().map(|moment| moment.units[id].pos);
                unit.pos = before.unwrap_or(glam::Vec2::ZERO);
            }
            self.encoded = Some(STANDARD.encode(encode_moments(std::slice::from_ref(&moment))));
            self.moment = Some(moment);
        }
        GridCell {
            env,
            length: self.length,
            episode_return: self.episode_return,
            outcome: self.outcome,
            last: self.last_outcome,
            moment: self.encoded.clone(),
        }
    }
}
