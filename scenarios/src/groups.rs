//! The `groups` of a scenario file: the units and their start positions.

use crate::formation::formation;
use crate::sight::{MAX_OUTLINE_IN_SIGHT, Outlines};
use crate::unit_files::{UnitFiles, UnitSource};
use crate::{Faction, MAX_UNITS, Placement, ScenarioError, Terrain};
use smaclite_units::file::{FileError, Node, Range};
use smaclite_units::{Keyword, Plane, UnitType};
use std::collections::HashSet;

/// Wider than any map; the positions of the units are checked against the map itself.
const COORDINATE: Range = Range::closed(-1e6, 1e6);

/// The units of a scenario and their types; the order defines the ids of both.
#[derive(Default)]
pub(crate) struct Roster {
    pub(crate) unit_types: Vec<UnitType>,
    /// The source of each of `unit_types`.
    pub(crate) sources: Vec<UnitSource>,
    /// The key that first names each of `unit_types`.
    keys: Vec<String>,
    pub(crate) units: Vec<Placement>,
    /// Occupied start positions: plane, and x and y as f32 bits.
    occupied: HashSet<(u8, u32, u32)>,
}

impl Roster {
    /// Reads the list of groups. Every unit must start on the map, and no two units of one plane at one
    /// point.
    pub(crate) fn read(groups: &Node, files: &UnitFiles, terrain: &Terrain) -> Result<Roster, ScenarioError> {
        let mut roster = Roster::default();
        for group in groups.items()? {
            roster.add_group(&group, files, terrain)?;
        }
        for faction in [Faction::Ally, Faction::Enemy] {
            if roster.count(faction) == 0 {
                let expected = format!("a list with at least one group of faction {}", faction.name());
                return Err(groups.invalid(expected).into());
            }
        }
        roster.check_sight(files, terrain)?;
        Ok(roster)
    }

    /// Checks that no type sees more obstacles than a battle can handle in reasonable time.
    fn check_sight(&self, files: &UnitFiles, terrain: &Terrain) -> Result<(), ScenarioError> {
        let range = |unit_type: &UnitType| unit_type.speed + unit_type.radius();
        let types =
            self.unit_types.iter().enumerate().filter(|(_, unit_type)| unit_type.plane == Plane::Ground);
        let Some((i, farthest)) = types.max_by(|a, b| range(a.1).total_cmp(&range(b.1))) else {
            return Ok(());
        };
        let outlines = Outlines::of(terrain);
        if outlines.most_in_sight(range(farthest)) <= MAX_OUTLINE_IN_SIGHT {
            return Ok(());
        }
        let largest = f64::from(outlines.largest_range());
        let (key, value, limit) = match largest - farthest.radius() {
            speed if speed >= 0.0 => ("speed", farthest.speed, speed),
            _ => ("size", farthest.size, 2.0 * largest),
        };
        let expected = format!(
            "at most {limit} on this map: ground units see obstacles within `speed` plus half of `size`, \
             and within more than {largest} squares there are too many"
        );
        let (file, key, value) = (self.sources[i].to_string(), key.into(), value.to_string());
        Err(files.invalid_unit(&self.keys[i], FileError::Invalid { file, key, value, expected }))
    }

    /// Checks a file's count of units against the groups.
    pub(crate) fn check_count(&self, count: &Node, faction: Faction) -> Result<(), ScenarioError> {
        let actual = self.count(faction);
        if count.integer(1, MAX_UNITS)? as usize != actual {
            let expected = format!("{actual}, the number of {} units in `groups`", faction.name());
            return Err(count.invalid(expected).into());
        }
        Ok(())
    }

    fn count(&self, faction: Faction) -> usize {
        self.units.iter().filter(|unit| unit.faction == faction).count()
    }

    fn add_group(&mut self, node: &Node, files: &UnitFiles, terrain: &Terrain) -> Result<(), ScenarioError> {
        let group = node.object(&["x", "y", "faction", "units"])?;
        let x =
            group.require("x", "the group's centre, in squares from the west edge")?.number(COORDINATE)?;
        let y =
            group.require("y", "the group's centre, in squares from the south edge")?.number(COORDINATE)?;
        let faction: Faction = group.require("faction", "ALLY or ENEMY")?.keyword()?;
        let units = group.require("units", "an object of unit types and their counts")?;
        let types = self.read_units(&units, files)?;
        let radii: Vec<f64> = types.iter().map(|&unit_type| self.unit_types[unit_type].radius()).collect();
        for (unit_type, position) in types.into_iter().zip(formation([x, y], faction, &radii)) {
            self.check_position(node, unit_type, position, terrain)?;
            let id_in_faction = self.count(faction);
            self.units.push(Placement { unit_type, faction, id_in_faction, position });
        }
        Ok(())
    }

    /// The type of each unit of a group, in listed order.
    fn read_units(&mut self, units: &Node, files: &UnitFiles) -> Result<Vec<usize>, ScenarioError> {
        let mut types = Vec::new();
        for (name, count) in units.entries()? {
            let source = files.find(name, &count)?;
            let unit_type = match self.sources.iter().position(|known| *known == source) {
                Some(known) => known,
                None => {
                    self.unit_types.push(files.load(&source, &count)?);
                    self.sources.push(source);
                    self.keys.push(count.key().into());
                    self.sources.len() - 1
                }
            };
            let n = count.integer(1, MAX_UNITS)? as usize;
            if self.units.len() + types.len() + n > MAX_UNITS as usize {
                let total = self.units.len() + types.len() + n;
                let conflict =
                    format!("raises the number of units to {total}; at most {MAX_UNITS} are allowed");
                return Err(count.conflict(conflict).into());
            }
            types.extend(std::iter::repeat_n(unit_type, n));
        }
        if types.is_empty() {
            return Err(units.invalid("an object with at least one unit type").into());
        }
        Ok(types)
    }

    /// Checks a start position, rounded to f32 as in a battle.
    fn check_position(
        &mut self,
        group: &Node,
        unit_type: usize,
        position: [f64; 2],
        terrain: &Terrain,
    ) -> Result<(), ScenarioError> {
        let [x, y] = position.map(|coordinate| coordinate as f32);
        let (width, height) = (terrain.width(), terrain.height());
        let UnitType { name, plane, .. } = &self.unit_types[unit_type];
        if !(0.0..width as f32).contains(&x) || !(0.0..height as f32).contains(&y) {
            let conflict = format!("puts a {name} at ({x}, {y}), outside the {width} x {height} map");
            return Err(group.conflict(conflict).into());
        }
        // Collision avoidance has no direction in which it could separate two units at one point.
        if !self.occupied.insert((*plane as u8, x.to_bits(), y.to_bits())) {
            let conflict =
                format!("puts a {name} at ({x}, {y}), where another {plane} unit starts; move the group");
            return Err(group.conflict(conflict).into());
        }
        Ok(())
    }
}
