//! What is allowed in a scenario, and most probably a mistake. Published scenarios may do it, so that these
//! are warnings and no problems, and no rule of a battle depends on them.

use crate::generation::lists_of;
use crate::groups::with_article;
use crate::keys::{self, GROUP_KEYS};
use crate::{Faction, Placement, Scenario, ScenarioFiles, Terrain};
use serde_json::json;
use smaclite_units::file::{Document, Node, Report};
use smaclite_units::{Plane, Problem};
use std::collections::BTreeSet;

impl ScenarioFiles {
    /// What is probably a mistake in a valid scenario, in the order of the file's lines:
    ///
    /// - ground units that start on blocked squares, which they may never leave;
    /// - agents and enemies, all of them ground units, that no path connects;
    /// - agents that attack, but none of the enemies, also of teams that are drawn;
    /// - agents that all heal, also of teams that are drawn.
    ///
    /// An invalid scenario has none. Where start positions are drawn, nothing is said of those of groups.
    ///
    /// ```
    /// use smaclite_scenarios::ScenarioFiles;
    ///
    /// let (_, mut files) = ScenarioFiles::resolve("3m").unwrap();
    /// assert!(files.warnings().is_empty());
    /// files.text = files.text.replace("9, \"y\": 16", "9, \"y\": 30");
    /// assert!(files.warnings()[0].message.contains("blocked square"));
    /// ```
    pub fn warnings(&self) -> Vec<Problem> {
        self.scenario().map_or_else(|_| Vec::new(), |scenario| self.warnings_of(&scenario, false))
    }

    /// The warnings of this scenario as rules play it, with their unit types; and whether units that would
    /// start on blocked squares start on free ones.
    pub fn warnings_of(&self, scenario: &Scenario, starts_are_free: bool) -> Vec<Problem> {
        let report = Report::default();
        if let Ok(document) = Document::parse(&self.text, &self.source, &report) {
            for (key, node) in document.root().entries().unwrap_or_default() {
                match key {
                    _ if key == keys::GROUPS.name => {
                        warn(scenario, &self.units_of_groups(scenario), &node, starts_are_free);
                    }
                    _ if key == keys::TEAMS.name => warn_of_teams(scenario, &node),
                    _ => {}
                }
            }
        }
        let found = report.finish(Ok(())).err();
        found.map_or_else(Vec::new, |found| self.placed(found).list().to_vec())
    }

    /// The units in the order of the groups, which is not that of a scenario whose start positions are drawn.
    fn units_of_groups(&self, scenario: &Scenario) -> Vec<Placement> {
        if scenario.generation.is_none() {
            return scenario.units.clone();
        }
        // Groups need the attack point, which drawn positions do not.
        let keys = [
            (keys::START_POSITIONS.name, json!(null)),
            (keys::ATTACK_POINT.name, json!(scenario.attack_point)),
        ];
        let fixed = self.with_keys(keys.map(|(key, value)| (key.to_owned(), value))).scenario();
        fixed.map_or_else(|_| Vec::new(), |fixed| fixed.units)
    }
}

/// Adds the warnings to the report of `groups`, the groups of a valid scenario with these units.
fn warn(scenario: &Scenario, units: &[Placement], groups: &Node, starts_are_free: bool) {
    let mut rest = units;
    let enemies = || {
        let units = scenario.units.iter().filter(|unit| unit.faction == Faction::Enemy);
        units.map(|unit| unit.unit_type)
    };
    let mut warned = BTreeSet::new(); // types without targets, of which the first entry is enough
    for group in groups.items().unwrap_or_default() {
        let Ok(units) = group.object(&GROUP_KEYS).and_then(|group| group.require(&keys::UNITS)) else {
            return;
        };
        let mut of_group = 0;
        for (_, entry) in units.entries().unwrap_or_default() {
            let Some(first) = rest.get(of_group) else { return };
            let is_agent = first.faction == Faction::Ally;
            if is_agent
                && has_no_target(scenario, first.unit_type, enemies())
                && warned.insert(first.unit_type)
            {
                entry.wrong_key(&format!("can {NO_TARGET}"));
            }
            of_group += entry.integer(1, crate::MAX_UNITS).map_or(0, |n| n as usize);
        }
        let (here, others) = rest.split_at(of_group.min(rest.len()));
        if scenario.generation.is_none() && !starts_are_free {
            warn_of_blocked_squares(scenario, &group, here);
        }
        rest = others;
    }
    let mut agents = scenario.units.iter().filter(|unit| unit.faction == Faction::Ally);
    if agents.all(|unit| scenario.unit_types[unit.unit_type].is_healer()) {
        groups.conflict("have no agent that attacks, so no battle can be won");
    }
    if scenario.generation.is_none() && are_separated(scenario) {
        groups.conflict("are separated by walls: no path connects the agents with the enemies");
    }
}

/// Adds the warnings to the report of `teams`, the teams of a valid scenario: those of healers alone, and
/// types without targets, each once.
fn warn_of_teams(scenario: &Scenario, node: &Node) {
    let Some(generation) = &scenario.generation else { return };
    let mut warned = BTreeSet::new();
    for (list, types) in lists_of(node, &generation.teams).unwrap_or_default() {
        if types.iter().all(|unit_type| scenario.unit_types[*unit_type].is_healer()) {
            list.conflict("has no type that attacks, so none of its battles can be won");
        }
        for (entry, unit_type) in list.items().unwrap_or_default().iter().zip(types) {
            if has_no_target(scenario, *unit_type, types.iter().copied()) && warned.insert(*unit_type) {
                let name = with_article(&scenario.unit_types[*unit_type].name);
                entry.wrong_key(&format!("is {name}, which can {NO_TARGET}"));
            }
        }
    }
}

/// What agents are told of that attack, but none of the enemies.
const NO_TARGET: &str = "attack none of the enemies: its `valid_targets` lack their planes";

fn warn_of_blocked_squares(scenario: &Scenario, group: &Node, units: &[Placement]) {
    let is_blocked = |unit: &&Placement| {
        let [x, y] = square_of(unit);
        is_on_ground(scenario, unit) && !scenario.terrain.is_walkable(x, y)
    };
    let mut blocked = units.iter().filter(is_blocked);
    let Some(first) = blocked.next() else { return };
    let (name, [x, y]) = (&scenario.unit_types[first.unit_type].name, first.position.map(|at| at as f32));
    let others = match blocked.count() {
        0 => String::new(),
        n => format!(", and {n} more"),
    };
    group.conflict(&format!(
        "puts {} at ({x}, {y}), on a blocked square that it may never leave{others}; rules `starcraft` \
         choose free squares",
        with_article(name)
    ));
}

/// Whether a type attacks, but none of the types of enemies.
fn has_no_target(scenario: &Scenario, unit_type: usize, mut enemies: impl Iterator<Item = usize>) -> bool {
    let unit_type = &scenario.unit_types[unit_type];
    !unit_type.is_healer() && !enemies.any(|enemy| unit_type.can_attack(scenario.unit_types[enemy].plane))
}

/// Whether walls lie between all agents and all enemies. Units that are on blocked squares do not count, and
/// units that fly or stride over walls reach everything.
fn are_separated(scenario: &Scenario) -> bool {
    if !scenario.units.iter().all(|unit| is_on_ground(scenario, unit)) {
        return false;
    }
    let areas = Areas::of(&scenario.terrain);
    let areas_of = |faction| -> Vec<u32> {
        let units = scenario.units.iter().filter(|unit| unit.faction == faction);
        units.filter_map(|unit| areas.at(square_of(unit))).collect()
    };
    let (agents, enemies) = (areas_of(Faction::Ally), areas_of(Faction::Enemy));
    !agents.is_empty() && !enemies.is_empty() && !agents.iter().any(|area| enemies.contains(area))
}

fn is_on_ground(scenario: &Scenario, unit: &Placement) -> bool {
    scenario.unit_types[unit.unit_type].plane == Plane::Ground
}

/// The square on which a unit starts, as battles have its position.
fn square_of(unit: &Placement) -> [i64; 2] {
    unit.position.map(|coordinate| (coordinate as f32).floor() as i64)
}

/// The connected areas of a map: walkable squares that share an edge. Between squares that share only a
/// corner, units do not fit through.
struct Areas<'a> {
    terrain: &'a Terrain,
    /// By square, row by row: the number of its area, 0 for none.
    numbers: Vec<u32>,
}

impl Areas<'_> {
    fn of(terrain: &Terrain) -> Areas<'_> {
        let (width, height) = (i64::from(terrain.width()), i64::from(terrain.height()));
        let mut areas = Areas { terrain, numbers: vec![0; (width * height) as usize] };
        let mut number = 0;
        let mut reached = Vec::new();
        for square in (0..height).flat_map(|y| (0..width).map(move |x| [x, y])) {
            number += 1;
            reached.push(square);
            while let Some([x, y]) = reached.pop() {
                if areas.claim([x, y], number) {
                    reached.extend([[x + 1, y], [x - 1, y], [x, y + 1], [x, y - 1]]);
                }
            }
        }
        areas
    }

    /// Gives a square to an area, if it is walkable and in none.
    fn claim(&mut self, [x, y]: [i64; 2], number: u32) -> bool {
        let is_free = self.terrain.is_walkable(x, y) && self.at([x, y]).is_none();
        if is_free {
            let index = self.index([x, y]);
            self.numbers[index] = number;
        }
        is_free
    }

    /// The area of a square.
    fn at(&self, [x, y]: [i64; 2]) -> Option<u32> {
        let number = self.terrain.is_walkable(x, y).then(|| self.numbers[self.index([x, y])]);
        number.filter(|number| *number > 0)
    }

    fn index(&self, [x, y]: [i64; 2]) -> usize {
        (y * i64::from(self.terrain.width()) + x) as usize
    }
}
