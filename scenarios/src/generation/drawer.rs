//! Draws the units of an episode of a generated scenario: SMACv2's distributions of teams and start
//! positions. `place` then spreads the units to free places.
//!
//! u is uniform on `[0, 1)`. With n agents and m enemies:
//!
//! - **Teams**, as [`Teams`] says. The enemies are the list of the agents; if they are fewer its first m, if
//!   they are more m - n further units, drawn by the same law for themselves: their exceptions, too.
//! - **Reflect**: ally i at (15 u, 32 u') on a map of 32 x 32, that is u times half the width less 1; enemy i
//!   at (32 - x, y). Further enemies are uniform in the east half.
//! - **Surrounded**: all allies in the centre. The enemies are divided among 1 to 4 groups, each number
//!   equally probable, by a multinomial with equal chances, in the order of the list; each group has another
//!   corner, and stands on the way from it to the centre: u of the way up to 2 squares before the centre (the
//!   corner itself on maps narrower than 4 squares).

use super::place::{Placer, exact};
use crate::{Drawn, DrawnTeams, Faction, Generation, Scenario, Starts, Teams};

/// How often the units of an episode are drawn at most. A scenario is refused if a unit of its samples has no
/// room, so most need one draw.
const MAX_DRAWS: usize = 16;

/// Draws the units of the episodes of a scenario.
#[derive(Clone, Debug)]
pub struct Drawer {
    generation: Generation,
    n_allies: usize,
    n_enemies: usize,
    /// The units of the scenario's groups, or of its sample.
    allies: Vec<Drawn>,
    enemies: Vec<Drawn>,
    width: f64,
    height: f64,
    placer: Placer,
}

/// A uniform number from 0 to less than 1.
type Share<'a> = &'a mut dyn FnMut() -> f64;

impl Drawer {
    /// Prepares the draws of a scenario; `None` if its units are always the same.
    pub fn new(scenario: &Scenario) -> Option<Drawer> {
        Drawer::of_counts(scenario, [scenario.n_agents(), scenario.n_enemies()])
    }

    /// The same of a scenario that has no sample yet, with these numbers of allies and enemies.
    pub(crate) fn of_counts(scenario: &Scenario, counts: [usize; 2]) -> Option<Drawer> {
        let generation = scenario.generation.clone()?;
        let of = |faction| {
            let units = scenario.units.iter().filter(move |unit| unit.faction == faction);
            units.map(|unit| Drawn { unit_type: unit.unit_type, position: unit.position }).collect::<Vec<_>>()
        };
        Some(Drawer {
            generation,
            n_allies: counts[0],
            n_enemies: counts[1],
            allies: of(Faction::Ally),
            enemies: of(Faction::Enemy),
            width: scenario.terrain.width().into(),
            height: scenario.terrain.height().into(),
            placer: Placer::new(scenario),
        })
    }

    /// Draws the units of an episode, in the order of the lists that the distributions give. `share` gives
    /// uniform numbers from 0 to less than 1. Nothing is allocated from the second call on.
    pub fn draw(&self, share: &mut dyn FnMut() -> f64, into: &mut DrawnTeams) {
        self.draw_teams(share, into);
        self.draw_starts(share, into);
    }

    /// Moves units that have no room to the nearest free places, and gives the allies their numbers: by the
    /// name of their type, then from west to east, then from south to north. The enemies keep their order.
    ///
    /// Where a unit has no room, all are drawn again; a unit that has none in the last draw stays where it
    /// was drawn.
    pub fn place(&self, share: &mut dyn FnMut() -> f64, teams: &mut DrawnTeams) {
        for _ in 1..MAX_DRAWS {
            if self.has_room(teams) {
                return self.number(&mut teams.allies);
            }
            self.draw(share, teams);
        }
        self.placer.spread(teams, true);
        self.number(&mut teams.allies);
    }

    /// Gives the units places, up to the first one without room. Whether all have room.
    pub(crate) fn has_room(&self, teams: &mut DrawnTeams) -> bool {
        self.placer.spread(teams, false)
    }

    /// Gives allies their numbers.
    pub fn number(&self, allies: &mut [Drawn]) {
        self.placer.number(allies);
    }

    fn draw_teams(&self, share: Share<'_>, into: &mut DrawnTeams) {
        let DrawnTeams { allies, enemies } = into;
        allies.clear();
        enemies.clear();
        match &self.generation.teams {
            Teams::OfGroups => {
                allies.extend_from_slice(&self.allies);
                enemies.extend_from_slice(&self.enemies);
                return;
            }
            Teams::Weighted { types, weights, exceptions } => {
                let mut draw = |n: usize, into: &mut Vec<Drawn>| {
                    append_weighted(types, weights, exceptions, n, share, into);
                };
                draw(self.n_allies, allies);
                enemies.extend(allies.iter().take(self.n_enemies).copied());
                if self.n_enemies > self.n_allies {
                    draw(self.n_enemies - self.n_allies, enemies);
                }
                return;
            }
            Teams::All { types, exceptions } => {
                draw_multiset(types, exceptions, self.n_allies, share, allies);
            }
            Teams::Fixed { teams } => {
                let team = &teams[below(teams.len(), share)];
                allies.extend(team.iter().map(|&unit_type| of_type(unit_type)));
            }
        }
        shuffle(allies, share);
        enemies.extend_from_slice(allies);
    }

    fn draw_starts(&self, share: Share<'_>, into: &mut DrawnTeams) {
        match self.generation.starts {
            Starts::OfGroups => {
                let places = self.allies.iter().zip(&mut into.allies);
                let places = places.chain(self.enemies.iter().zip(&mut into.enemies));
                places.for_each(|(place, unit)| unit.position = place.position);
            }
            Starts::Reflect => self.reflect(share, into),
            Starts::Surrounded => self.surround(share, into),
            Starts::SurroundedAndReflect { p } => {
                if share() > p {
                    self.surround(share, into)
                } else {
                    self.reflect(share, into)
                }
            }
            Starts::Uniform { allies, enemies } => {
                for (units, area) in [(&mut into.allies, allies), (&mut into.enemies, enemies)] {
                    units.iter_mut().for_each(|unit| unit.position = uniform(area, share));
                }
            }
        }
    }

    fn reflect(&self, share: Share<'_>, into: &mut DrawnTeams) {
        let (width, height) = (self.width, self.height);
        let west = [0.0, 0.0, (width / 2.0 - 1.0).max(0.0), height];
        into.allies.iter_mut().for_each(|unit| unit.position = uniform(west, share));
        let mirrored = into.allies.iter().map(|unit| [width - unit.position[0], unit.position[1]]);
        into.enemies.iter_mut().zip(mirrored).for_each(|(unit, position)| unit.position = position);
        let east = [width / 2.0, 0.0, width, height];
        let further = into.enemies.iter_mut().skip(into.allies.len());
        further.for_each(|unit| unit.position = uniform(east, share));
    }

    fn surround(&self, share: Share<'_>, into: &mut DrawnTeams) {
        let centre = [self.width / 2.0, self.height / 2.0];
        into.allies.iter_mut().for_each(|unit| unit.position = centre);
        let n_groups = 1 + below(4, share);
        let mut sizes = [0; 4];
        into.enemies.iter().for_each(|_| sizes[below(n_groups, share)] += 1);
        let mut corners = [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]];
        shuffle(&mut corners, share);
        let mut rest = into.enemies.iter_mut();
        for (size, corner) in sizes.into_iter().take(n_groups).zip(corners) {
            let way = share();
            let position = [0, 1].map(|axis| {
                let (centre, side) = (centre[axis], 2.0 * centre[axis] * corner[axis]);
                let before = centre.min(2.0); // a smaller map ends there
                let inner = centre + if corner[axis] == 0.0 { -before } else { before };
                exact(way * inner + (1.0 - way) * side)
            });
            rest.by_ref().take(size).for_each(|unit| unit.position = position);
        }
    }
}

fn of_type(unit_type: usize) -> Drawn {
    Drawn { unit_type, position: [0.0; 2] }
}

/// Appends a team of independent draws; one of exception types alone is drawn again. Its order is random
/// without a shuffle.
fn append_weighted(
    types: &[usize],
    weights: &[f64],
    exceptions: &[usize],
    n: usize,
    share: Share<'_>,
    into: &mut Vec<Drawn>,
) {
    let begin = into.len();
    loop {
        for _ in 0..n {
            let mut rest = share();
            let found = weights.iter().position(|weight| {
                rest -= weight;
                rest < 0.0
            });
            into.push(of_type(types[found.unwrap_or(types.len() - 1)]));
        }
        if !into[begin..].iter().all(|unit| exceptions.contains(&unit.unit_type)) {
            return;
        }
        into.truncate(begin);
    }
}

/// Draws one of all multisets of n types, each equally probable; one of exception types alone is drawn again.
///
/// A multiset of n of k types is a choice of n of n + k - 1 places: the number of places that are left out
/// before a chosen one is its type.
fn draw_multiset(types: &[usize], exceptions: &[usize], n: usize, share: Share<'_>, into: &mut Vec<Drawn>) {
    loop {
        into.clear();
        let (mut places, mut left_out) = (n + types.len() - 1, 0);
        while into.len() < n {
            if below(places, share) < n - into.len() {
                into.push(of_type(types[left_out]));
            } else {
                left_out += 1;
            }
            places -= 1;
        }
        if !into.iter().all(|unit| exceptions.contains(&unit.unit_type)) {
            return;
        }
    }
}

/// A uniform whole number below `n`.
fn below(n: usize, share: Share<'_>) -> usize {
    ((share() * n as f64) as usize).min(n.saturating_sub(1))
}

fn shuffle<T>(items: &mut [T], share: Share<'_>) {
    for last in (1..items.len()).rev() {
        items.swap(last, below(last + 1, share));
    }
}

/// A uniform point of an area: west, south, east, north.
fn uniform([west, south, east, north]: [f64; 4], share: Share<'_>) -> [f64; 2] {
    let x = west + (east - west) * share();
    [exact(x), exact(south + (north - south) * share())]
}

#[cfg(test)]
mod tests;
