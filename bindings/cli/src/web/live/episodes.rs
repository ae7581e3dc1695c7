//! The log of a followed environment: its last episodes, within a bound on memory.

use smaclite_engine::Snapshot;
use smaclite_ipc::FollowedPart;
use smaclite_view::EpisodeResult;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// How long an episode is kept after its end.
const KEPT: Duration = Duration::from_secs(300);

/// Bytes that the log may use, about.
const MAX_BYTES: usize = 64 << 20;

/// Bytes of a snapshot per unit, about: the columns of a battle and its neighbour orders.
const SNAPSHOT_BYTES_PER_UNIT: usize = 160;

/// An episode, as far as it is known.
pub(super) struct Episode {
    pub(super) number: u64,
    pub(super) start: Snapshot,
    pub(super) actions: Vec<u16>,
    pub(super) is_over: bool,
    /// How it ended, once it was played to its end.
    pub(super) result: Option<EpisodeResult>,
    /// Whether it was played for that, or cannot be.
    pub(super) is_judged: bool,
    /// When its first and its newest part arrived.
    pub(super) began: Instant,
    pub(super) newest: Instant,
}

impl Episode {
    fn bytes(&self) -> usize {
        self.start.units.pos.len() * SNAPSHOT_BYTES_PER_UNIT + self.actions.len() * size_of::<u16>()
    }
}

#[derive(Default)]
pub(super) struct Episodes {
    /// By number.
    all: VecDeque<Episode>,
    bytes: usize,
}

impl Episodes {
    pub(super) fn newest(&self) -> Option<&Episode> {
        self.all.back()
    }

    pub(super) fn get(&self, number: u64) -> Option<&Episode> {
        let index = self.all.binary_search_by_key(&number, |episode| episode.number).ok()?;
        self.all.get(index)
    }

    /// From the newest to the oldest.
    pub(super) fn recent(&self) -> impl Iterator<Item = &Episode> {
        self.all.iter().rev()
    }

    /// The newest episode that is over and was not judged yet.
    pub(super) fn unjudged(&mut self, listed: usize) -> Option<&mut Episode> {
        self.all.iter_mut().rev().take(listed).find(|episode| episode.is_over && !episode.is_judged)
    }

    /// Adds a part. One that continues an episode whose start is unknown is dropped.
    pub(super) fn add(&mut self, part: FollowedPart) {
        let now = Instant::now();
        if let Some(start) = part.start {
            let FollowedPart { number, actions, is_over, .. } = part;
            // A number that is not new is a mistake of the pool; the order of numbers must hold.
            if self.newest().is_none_or(|newest| newest.number < number) {
                let (began, newest, result) = (now, now, None);
                let episode =
                    Episode { number, start, actions, is_over, result, is_judged: false, began, newest };
                self.bytes += episode.bytes();
                self.all.push_back(episode);
            }
        } else if let Some(episode) = self.all.back_mut().filter(|episode| episode.number == part.number) {
            self.bytes += part.actions.len() * size_of::<u16>();
            episode.actions.extend_from_slice(&part.actions);
            episode.is_over |= part.is_over;
            episode.newest = now;
        }
    }

    /// Forgets the oldest episodes, except for one that is shown and the newest.
    pub(super) fn trim(&mut self, shown: Option<u64>) {
        loop {
            let last = self.all.len().saturating_sub(1);
            let oldest = self.all.iter().take(last).position(|episode| Some(episode.number) != shown);
            let Some(oldest) = oldest else { return };
            if self.bytes <= MAX_BYTES && self.all[oldest].newest.elapsed() < KEPT {
                return;
            }
            let forgotten = self.all.remove(oldest);
            self.bytes -= forgotten.map_or(0, |episode| episode.bytes());
        }
    }
}
