//! The reader of `teams` and `start_positions`: the values of the keys, and what must agree.

use super::keys::{self, STARTS_KEYS, StartsKind, TEAMS_KEYS, TeamsKind};
use super::{Drawer, DrawnTeams, Generation, Starts, Teams};
use crate::groups::Roster;
use crate::unit_files::UnitFiles;
use crate::{Faction, Placement, Scenario, Terrain};
use smaclite_units::file::{Key, Node, Object, Range, Reported, Shape};

/// The distributions of a scenario file, and the roster of its types: that of the groups, or of `teams`.
pub(crate) fn read_generated<'a>(
    file: &Object<'a>,
    files: &UnitFiles,
    map: Option<&Terrain>,
    counts: [Option<usize>; 2],
) -> Result<(Roster<'a>, Option<Generation>), Reported> {
    let starts = file.get(&crate::keys::START_POSITIONS).map(|node| read_starts(&node, map)).transpose();
    let Some(node) = file.get(&crate::keys::TEAMS) else {
        let groups = file.require(&crate::keys::GROUPS)?;
        let mut roster = Roster::read(&groups, files, map)?;
        let generation = starts?.map(|starts| Generation { teams: Teams::OfGroups, starts });
        if generation.is_some() {
            roster.number_as_drawn();
        }
        return Ok((roster, generation));
    };
    if let Some(groups) = file.get(&crate::keys::GROUPS) {
        return Err(groups.wrong_key("must be left out, because `teams` says which units there are"));
    }
    let mut roster = Roster::default();
    let teams = read_teams(&node, files, counts, &mut roster);
    let starts = starts?.ok_or_else(|| {
        let expected = "an object with a `distribution`, because `teams` has no positions";
        file.missing(crate::keys::START_POSITIONS.name, expected)
    });
    let teams = teams?;
    map.map_or(Ok(()), |map| roster.check_sight(map))?;
    Ok((roster, Some(Generation { teams, starts: starts? })))
}

/// Draws that are tried before a scenario is accepted.
const SAMPLES: usize = 8;

/// One sample of the units, so that the scenario can be shown; the same for equal files.
///
/// # Errors
/// If units of this or of one of the next samples have no room: battles would begin with units at one point.
pub(crate) fn sample(
    file: &Object,
    scenario: &Scenario,
    counts: [usize; 2],
) -> Result<Vec<Placement>, Reported> {
    let mut drawn = DrawnTeams::default();
    if let Some(drawer) = Drawer::of_counts(scenario, counts) {
        let mut share = shares();
        drawer.draw(&mut share, &mut drawn);
        if !have_room(&drawer, drawn.clone(), &mut share) {
            let n_units = counts[0] + counts[1];
            let conflict = format!("must leave room for {n_units} units on the map, of which none overlap");
            return Err(file.require(&crate::keys::START_POSITIONS)?.conflict(&conflict));
        }
        drawer.place(&mut share, &mut drawn);
    }
    let sides = [(Faction::Ally, &drawn.allies), (Faction::Enemy, &drawn.enemies)];
    let of_side = |(faction, units): (Faction, &Vec<super::Drawn>)| {
        let placement = move |(id_in_faction, unit): (usize, &super::Drawn)| {
            let (unit_type, position) = (unit.unit_type, unit.position);
            Placement { unit_type, faction, id_in_faction, position, centre: position }
        };
        units.iter().enumerate().map(placement).collect::<Vec<_>>()
    };
    Ok(sides.into_iter().flat_map(of_side).collect())
}

impl Scenario {
    /// Whether units of the size and plane that its types have now find room in the first samples of its
    /// episodes, as those of its files did; true if none are drawn.
    pub fn leaves_room(&self) -> bool {
        Drawer::new(self).is_none_or(|drawer| {
            let (mut share, mut drawn) = (shares(), DrawnTeams::default());
            drawer.draw(&mut share, &mut drawn);
            have_room(&drawer, drawn, &mut share)
        })
    }
}

/// Numbers of a Weyl sequence, which are spread evenly; nothing depends on their quality.
fn shares() -> impl FnMut() -> f64 {
    let mut state = 0.0;
    move || {
        state = (state + 0.618_033_988_749_894_9_f64).fract();
        state
    }
}

/// Whether units have room in this sample and in the next ones.
fn have_room(drawer: &Drawer, mut sample: DrawnTeams, share: &mut dyn FnMut() -> f64) -> bool {
    (0..SAMPLES).all(|_| {
        let has_room = drawer.has_room(&mut sample);
        drawer.draw(share, &mut sample);
        has_room
    })
}

fn read_teams<'a>(
    node: &Node<'a>,
    files: &UnitFiles,
    counts: [Option<usize>; 2],
    roster: &mut Roster<'a>,
) -> Result<Teams, Reported> {
    let object = node.object(&TEAMS_KEYS)?;
    let kind = object.read(&keys::TEAMS_KIND)?;
    let used: &[&str] = match kind {
        TeamsKind::Weighted => &["unit_types", "weights", "exception_unit_types"],
        TeamsKind::All => &["unit_types", "exception_unit_types"],
        TeamsKind::Fixed => &["teams"],
    };
    check_used(node, used)?;
    if kind != TeamsKind::Weighted
        && let [Some(allies), Some(enemies)] = counts
        && allies != enemies
    {
        return Err(node.conflict(&format!(
            "gives both factions one team, but `num_allied_units` is {allies} and `num_enemy_units` {enemies}"
        )));
    }
    match kind {
        TeamsKind::Weighted => {
            let (types, exceptions) = read_types(&object, files, roster)?;
            let weights = read_weights(&object, &types, &exceptions)?;
            Ok(Teams::Weighted { types, weights, exceptions })
        }
        TeamsKind::All => {
            let (types, exceptions) = read_types(&object, files, roster)?;
            Ok(Teams::All { types, exceptions })
        }
        TeamsKind::Fixed => {
            let list = object.require(&keys::TEAMS_LIST)?;
            let team = |team: &Node<'a>| {
                let types = read_names(team, files, roster)?;
                match counts[0].filter(|count| *count != types.len()) {
                    Some(count) => Err(team.invalid(&format!("a list of {count} unit types, one per unit"))),
                    None => Ok(types),
                }
            };
            let teams = list.items()?.iter().map(team).collect::<Result<Vec<_>, _>>()?;
            if teams.is_empty() {
                Err(list.invalid("a list with at least one team"))
            } else {
                Ok(Teams::Fixed { teams })
            }
        }
    }
}

/// The lists of types of valid `teams`, and the types: one list of which both sides are drawn, or one for
/// each team.
pub(crate) fn lists_of<'a, 'b>(
    node: &Node<'a>,
    teams: &'b Teams,
) -> Result<Vec<(Node<'a>, &'b [usize])>, Reported> {
    let object = node.object(&TEAMS_KEYS)?;
    Ok(match teams {
        Teams::OfGroups => Vec::new(),
        Teams::Weighted { types, .. } | Teams::All { types, .. } => {
            vec![(object.require(&keys::UNIT_TYPES)?, types)]
        }
        Teams::Fixed { teams } => {
            let lists = object.require(&keys::TEAMS_LIST)?.items()?;
            lists.into_iter().zip(teams.iter().map(Vec::as_slice)).collect()
        }
    })
}

/// Every other key of the object than `distribution` must be one that the distribution has.
fn check_used(node: &Node, used: &[&str]) -> Result<(), Reported> {
    for (key, entry) in node.entries()? {
        if key != "distribution" && !used.contains(&key) {
            return Err(entry.wrong_key("is a key of another distribution"));
        }
    }
    Ok(())
}

fn read_types<'a>(
    object: &Object<'a>,
    files: &UnitFiles,
    roster: &mut Roster<'a>,
) -> Result<(Vec<usize>, Vec<usize>), Reported> {
    let node = object.require(&keys::UNIT_TYPES)?;
    let types = read_names(&node, files, roster)?;
    let twice = (1..types.len()).find(|&i| types[..i].contains(&types[i]));
    if types.is_empty() || twice.is_some() {
        return Err(node.invalid("a list of at least one unit type, each once"));
    }
    let Some(node) = object.get(&keys::EXCEPTION_UNIT_TYPES) else { return Ok((types, Vec::new())) };
    let exceptions = read_names(&node, files, roster)?;
    if let Some(place) = exceptions.iter().position(|exception| !types.contains(exception)) {
        return Err(node.items()?[place].invalid("one of `unit_types`"));
    }
    if types.iter().all(|unit_type| exceptions.contains(unit_type)) {
        return Err(node.conflict("must leave out at least one of `unit_types`"));
    }
    Ok((types, exceptions))
}

fn read_names<'a>(
    node: &Node<'a>,
    files: &UnitFiles,
    roster: &mut Roster<'a>,
) -> Result<Vec<usize>, Reported> {
    let read = |item: &Node<'a>| {
        let source = files.find(item.text(crate::keys::MAX_TYPE_NAME)?, item)?;
        roster.type_of(source, item, files)
    };
    node.items()?.iter().map(read).collect()
}

/// The weights, divided by their sum. Those of types that are no exceptions must count, or a team that is not
/// of exceptions alone would be drawn after too many attempts.
fn read_weights(object: &Object, types: &[usize], exceptions: &[usize]) -> Result<Vec<f64>, Reported> {
    let node = object.require(&keys::WEIGHTS)?;
    let (items, n_types) = (node.items()?, types.len());
    if items.len() != n_types {
        return Err(node.invalid(&format!("a list of {n_types} numbers, one for each of `unit_types`")));
    }
    let weights = items.iter().map(|item| item.number(keys::WEIGHT)).collect::<Result<Vec<_>, _>>()?;
    let sum: f64 = weights.iter().sum();
    let weights: Vec<f64> = weights.into_iter().map(|weight| weight / sum).collect();
    let of_types = types.iter().zip(&weights);
    let others = of_types.filter(|(unit_type, _)| !exceptions.contains(unit_type)).map(|(_, weight)| weight);
    if others.sum::<f64>() < keys::LEAST_SHARE {
        return Err(node.conflict(&format!(
            "must give the types that are not in `exception_unit_types` at least {} of the sum",
            keys::LEAST_SHARE
        )));
    }
    Ok(weights)
}

fn read_starts(node: &Node, map: Option<&Terrain>) -> Result<Starts, Reported> {
    let object = node.object(&STARTS_KEYS)?;
    let kind = object.read(&keys::STARTS_KIND)?;
    let used: &[&str] = match kind {
        StartsKind::Reflect | StartsKind::Surrounded => &[],
        StartsKind::SurroundedAndReflect => &["p"],
        StartsKind::Uniform => &["allies", "enemies"],
    };
    check_used(node, used)?;
    Ok(match kind {
        StartsKind::Reflect => Starts::Reflect,
        StartsKind::Surrounded => Starts::Surrounded,
        StartsKind::SurroundedAndReflect => Starts::SurroundedAndReflect { p: object.read(&keys::P)? },
        StartsKind::Uniform => Starts::Uniform {
            allies: read_area(&object, &keys::ALLIES_AREA, map)?,
            enemies: read_area(&object, &keys::ENEMIES_AREA, map)?,
        },
    })
}

fn read_area(object: &Object, key: &Key<Shape>, map: Option<&Terrain>) -> Result<[f64; 4], Reported> {
    let node = object.require(key)?;
    let items = node.items()?;
    let [width, height] = map.map_or([crate::MAX_SIDE; 2], |map| [map.width(), map.height()]).map(f64::from);
    let expected =
        format!("[west, south, east, north], with west < east <= {width} and south < north <= {height}");
    let [west, south, east, north] = items.as_slice() else { return Err(node.invalid(&expected)) };
    let (x, y) = (Range::closed(0.0, width), Range::closed(0.0, height));
    let area = [west.number(x)?, south.number(y)?, east.number(x)?, north.number(y)?];
    if area[0] < area[2] && area[1] < area[3] { Ok(area) } else { Err(node.invalid(&expected)) }
}
