//! What follows from the types of the units: in a fixed scenario computed once, in a generated one at every
//! reset, in memory that is kept.

use glam::Vec2;
use smaclite_scenarios::Drawn;
use smaclite_units::UnitType;

use super::{Approach, Arena, Regeneration, StarcraftStats, UnitStats};
use crate::buffers::refill;
use crate::rules::Rules;

impl Arena {
    /// Lets the units have these types, by battle-wide id.
    pub(crate) fn set_types(&mut self, types: impl Iterator<Item = u32> + Clone) {
        let of_unit = || types.clone().map(|unit_type| &self.types[unit_type as usize]);
        self.largest_radius = of_unit().map(UnitType::radius).fold(0.0, f64::max);
        let largest_radius = self.largest_radius;
        refill(&mut self.all_stats, of_unit().map(|unit_type| UnitStats::new(unit_type, largest_radius)));
        let all_stats = &self.all_stats;
        refill(&mut self.avoidance, all_stats.iter().map(|stats| stats.avoid));
        refill(&mut self.regenerations, all_stats.iter().map(Regeneration::new));
        let starcraft = self.rules == Rules::Starcraft;
        refill(&mut self.starcraft_stats, of_unit().filter(|_| starcraft).map(StarcraftStats::new));
        self.has_reserves = all_stats.iter().any(|stats| stats.shield > 0.0 || stats.energy > 0.0);
        self.has_area_attacks = all_stats.iter().any(UnitStats::attacks_an_area);
        let heals = |id: &&u32| all_stats[**id as usize].is_healer;
        (self.agents_heal, self.enemies_heal) =
            (self.agents.iter().any(|id| heals(&id)), self.enemies.iter().any(|id| heals(&id)));
        let healers = || self.agents.iter().filter(heals).map(|&id| all_stats[id as usize].plane);
        let approach = |(unit_type, stats): (u32, &UnitStats)| {
            let attacks_healers = healers().any(|plane| self.types[unit_type as usize].can_attack(plane));
            Approach::new(unit_type, stats, attacks_healers)
        };
        refill(&mut self.approaches, types.zip(all_stats).map(approach));
        self.max_rewards = [self.greatest_return(&self.enemies), self.greatest_return(&self.agents)];
    }

    /// Takes over the units that were drawn, allies first: so a scenario whose units are drawn numbers them.
    pub(crate) fn set_drawn(&mut self, drawn: impl Iterator<Item = Drawn> + Clone) {
        refill(&mut self.starts, drawn.clone().map(|unit| Vec2::from(unit.position.map(|x| x as f32))));
        self.set_types(drawn.map(|unit| unit.unit_type as u32));
    }

    /// The type of each unit, as an index into all types, by battle-wide id.
    pub(crate) fn type_indices(&self) -> impl Iterator<Item = u32> + Clone + use<'_> {
        self.approaches.iter().map(|approach| approach.unit_type)
    }

    /// The unscaled return of a win over these units without their regeneration.
    fn greatest_return(&self, ids: &[u32]) -> f64 {
        let total = |&id: &u32| self.all_stats[id as usize].hp + self.all_stats[id as usize].shield;
        // The first two terms are exact, so only the order of the sum of health decides the last bit: it is
        // by in-faction id.
        self.rewards.greatest_return(ids.len(), ids.iter().map(total).sum())
    }
}
