//! The `groups` of a scenario file: the units and their start positions.

use crate::formation::formation;
use crate::keys::{self, GROUP_KEYS};
use crate::terrain::{MAX_OUTLINE_IN_SIGHT, Outlines};
use crate::unit_files::{UnitFiles, UnitSource};
use crate::{Faction, MAX_UNITS, Placement, Terrain};
use smaclite_units::file::{Node, Reported};
use smaclite_units::{Keyword, Plane, UnitType};
use std::collections::HashSet;

/// The units of a scenario and their types; the order defines the ids of both.
#[derive(Default)]
pub(crate) struct Roster<'a> {
    pub(crate) unit_types: Vec<UnitType>,
    /// The source of each of `unit_types`, and the entry that first names it.
    sources: Vec<(UnitSource, Node<'a>)>,
    /// Unit types with problems, which are reported once.
    refused: Vec<(UnitSource, Reported)>,
    pub(crate) units: Vec<Placement>,
    pub(crate) placed: Placed,
    /// Occupied start positions: plane, and x and y as f32 bits.
    occupied: HashSet<(u8, u32, u32)>,
}

/// Whether all units can start where they are; counts and ids can be compared even if they cannot.
pub(crate) struct Placed(pub(crate) Result<(), Reported>);

impl Default for Placed {
    fn default() -> Placed {
        Placed(Ok(()))
    }
}

impl<'a> Roster<'a> {
    /// Reads the list of groups. Every unit must start on the map, and no two units of one plane at one
    /// point; if the map is invalid, positions are not checked.
    pub(crate) fn read(
        groups: &Node<'a>,
        files: &UnitFiles,
        map: Option<&Terrain>,
    ) -> Result<Roster<'a>, Reported> {
        let mut roster = Roster::default();
        let added: Vec<_> = groups.items()?.iter().map(|group| roster.add_group(group, files, map)).collect();
        let sight = map.map_or(Ok(()), |map| roster.check_sight(map));
        roster.placed.0 = roster.placed.0.and(sight);
        added.into_iter().collect::<Result<(), _>>()?;
        for faction in [Faction::Ally, Faction::Enemy] {
            if roster.count(faction) == 0 {
                let expected = format!("a list with at least one group of faction {}", faction.name());
                return Err(groups.invalid(&expected));
            }
        }
        Ok(roster)
    }

    /// The source and the name of each of `unit_types`.
    pub(crate) fn types(&self) -> impl Iterator<Item = (&UnitSource, &str)> {
        let names = self.unit_types.iter().map(|unit_type| unit_type.name.as_str());
        self.sources.iter().map(|(source, _)| source).zip(names)
    }

    /// The number of units of a faction.
    pub(crate) fn count(&self, faction: Faction) -> usize {
        self.units.iter().filter(|unit| unit.faction == faction).count()
    }

    /// Numbers the units as drawers do: agents by the name of their type, then enemies in their order.
    pub(crate) fn number_as_drawn(&mut self) {
        let Roster { units, unit_types, .. } = self;
        let name = |unit: &Placement| match unit.faction {
            Faction::Ally => Some(unit_types[unit.unit_type].name.as_str()),
            Faction::Enemy => None,
        };
        units.sort_by_key(|unit| (unit.faction == Faction::Enemy, name(unit)));
        let mut counts = [0; 2];
        for unit in units {
            let count = &mut counts[unit.faction as usize];
            unit.id_in_faction = *count;
            *count += 1;
        }
    }

    /// Checks that no type sees more obstacles than a battle can handle in reasonable time.
    pub(crate) fn check_sight(&self, map: &Terrain) -> Result<(), Reported> {
        let range = |unit_type: &UnitType| unit_type.speed + unit_type.radius();
        let types =
            self.unit_types.iter().enumerate().filter(|(_, unit_type)| unit_type.plane == Plane::Ground);
        let Some((i, farthest)) = types.max_by(|a, b| range(a.1).total_cmp(&range(b.1))) else {
            return Ok(());
        };
        let outlines = Outlines::of(map);
        if outlines.most_in_sight(range(farthest)) <= MAX_OUTLINE_IN_SIGHT {
            return Ok(());
        }
        let largest = f64::from(outlines.largest_range());
        let (key, value, limit) = match largest - farthest.radius() {
            speed if speed >= 0.0 => ("speed", farthest.speed, speed),
            _ => ("size", farthest.size, 2.0 * largest),
        };
        let (source, entry) = &self.sources[i];
        Err(entry.wrong_key(&format!(
            "refers to {source}, where `{key}` is {value}, but must be at most {limit} on this map: ground \
             units see obstacles within `speed` plus half of `size`, and within more than {largest} squares \
             there are too many"
        )))
    }

    fn add_group(
        &mut self,
        node: &Node<'a>,
        files: &UnitFiles,
        map: Option<&Terrain>,
    ) -> Result<(), Reported> {
        let group = node.object(&GROUP_KEYS)?;
        let (x, y, faction) = (group.read(&keys::X), group.read(&keys::Y), group.read(&keys::FACTION));
        let types = group.require(&keys::UNITS).and_then(|units| self.read_units(&units, files));
        let (centre, faction, types) = ([x?, y?], faction?, types?);
        let radii: Vec<f64> = types.iter().map(|&unit_type| self.unit_types[unit_type].radius()).collect();
        let mut placed = Ok(());
        for (unit_type, position) in types.into_iter().zip(formation(centre, faction, &radii)) {
            // One problem per group: its other units are probably in the same situation.
            if let (Ok(()), Some(map)) = (placed, map) {
                placed = self.check_position(node, unit_type, position, map);
            }
            let id_in_faction = self.count(faction);
            self.units.push(Placement { unit_type, faction, id_in_faction, position, centre });
        }
        self.placed.0 = self.placed.0.and(placed);
        Ok(())
    }

    /// The type of each unit of a group, in listed order.
    fn read_units(&mut self, units: &Node<'a>, files: &UnitFiles) -> Result<Vec<usize>, Reported> {
        let (mut types, mut outcome) = (Vec::new(), Ok(()));
        for (name, entry) in units.entries()? {
            let unit_type = files.find(name, &entry).and_then(|source| self.type_of(source, &entry, files));
            let count = entry.integer(1, MAX_UNITS).and_then(|n| {
                let total = self.units.len() + types.len() + n as usize;
                if total > MAX_UNITS as usize {
                    let limit = format!("at most {MAX_UNITS} are allowed");
                    return Err(entry.conflict(&format!("raises the number of units to {total}; {limit}")));
                }
                Ok(n as usize)
            });
            match (unit_type, count) {
                (Ok(unit_type), Ok(n)) => types.extend(std::iter::repeat_n(unit_type, n)),
                (Err(reported), _) | (_, Err(reported)) => outcome = Err(reported),
            }
        }
        outcome?;
        if types.is_empty() {
            return Err(units.invalid("an object with at least one unit type"));
        }
        Ok(types)
    }

    /// The index of the type of `source`, which `entry` names; reads it at its first mention.
    pub(crate) fn type_of(
        &mut self,
        source: UnitSource,
        entry: &Node<'a>,
        files: &UnitFiles,
    ) -> Result<usize, Reported> {
        if let Some(known) = self.sources.iter().position(|(known, _)| *known == source) {
            return Ok(known);
        }
        if let Some((_, reported)) = self.refused.iter().find(|(refused, _)| *refused == source) {
            return Err(*reported);
        }
        match files.load(&source, entry).and_then(|unit_type| self.with_own_name(unit_type, &source, entry)) {
            Ok(unit_type) => {
                self.unit_types.push(unit_type);
                self.sources.push((source, entry.clone()));
                Ok(self.sources.len() - 1)
            }
            Err(reported) => {
                self.refused.push((source, reported));
                Err(reported)
            }
        }
    }

    /// The type, if no other has its name: views, pictures and other sections of the file know types by
    /// names.
    fn with_own_name(
        &self,
        unit_type: UnitType,
        source: &UnitSource,
        entry: &Node,
    ) -> Result<UnitType, Reported> {
        let name = &unit_type.name;
        let Some((other, _)) = self.types().find(|(_, known)| known == name) else { return Ok(unit_type) };
        Err(entry.wrong_key(&format!(
            "refers to {source}, but {other} is another type of the name {name} in this scenario; rename a \
             unit file"
        )))
    }

    /// Checks a start position, rounded to f32 as in a battle.
    fn check_position(
        &mut self,
        group: &Node,
        unit_type: usize,
        position: [f64; 2],
        map: &Terrain,
    ) -> Result<(), Reported> {
        let [x, y] = position.map(|coordinate| coordinate as f32);
        let (width, height) = (map.width(), map.height());
        let UnitType { name, plane, .. } = &self.unit_types[unit_type];
        if !(0.0..width as f32).contains(&x) || !(0.0..height as f32).contains(&y) {
            let conflict =
                format!("puts {} at ({x}, {y}), outside the {width} x {height} map", with_article(name));
            return Err(group.conflict(&conflict));
        }
        // Collision avoidance has no direction in which it could separate two units at one point.
        if !self.occupied.insert((*plane as u8, x.to_bits(), y.to_bits())) {
            let conflict = format!(
                "puts {} at ({x}, {y}), where another {plane} unit starts; move the group",
                with_article(name)
            );
            return Err(group.conflict(&conflict));
        }
        Ok(())
    }
}

/// A unit of a type in a sentence: "a MARINE", "an archer".
pub(crate) fn with_article(name: &str) -> String {
    let article =
        if name.starts_with(['a', 'e', 'i', 'o', 'u', 'A', 'E', 'I', 'O', 'U']) { "an" } else { "a" };
    format!("{article} {name}")
}

#[cfg(test)]
mod tests {
    /// Warnings said "puts a archer".
    #[test]
    fn names_have_the_article_that_fits() {
        assert_eq!(
            ["MARINE", "archer", "ULTRALISK"].map(super::with_article),
            ["a MARINE", "an archer", "an ULTRALISK"]
        );
    }
}
