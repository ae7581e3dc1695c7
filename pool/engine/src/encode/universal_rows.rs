//! Rows of units in one form for all scenarios, for networks whose weights fit every one.
//!
//! The rows of units differ between scenarios in what they say of a unit's type (`type_2` is another type on
//! every map), in whether they have a shield, and in how many actions there are. Rows of the one form have
//! every feature that a scenario may have, and, in place of the number of the type, its *figures*; of a last
//! action only whether it had a target.
//!
//! A row u of that form follows from the row x of a scenario by u = M x + m: M copies features and gives each
//! type its figures, and m are those of a type that observations do not name, because it is the only one. So
//! an affine map of u is one of x: W u + b = (W M) x + (b + W m).

use super::features::{action_names, obs_features, state_features};
use super::unit_layout::TargetLayout;
use crate::command::action;
use crate::features::FeatureBlock;
use smaclite_scenarios::{Faction, Placement, Scenario};
use smaclite_units::{Plane, Targeter, UnitType};

/// The first action with a target.
const FIRST_TARGET: usize = action::FIRST_TARGET;

/// What is kept of a last action: which of those without a target it was, or that it had one.
const ACTION_CLASSES: usize = FIRST_TARGET + 1;

/// How many numbers say what a type is.
const FIGURES: usize = 16;

/// What a unit type is, each number divided by a constant so that those of the standard types are about 1.
fn figures(unit: &UnitType) -> [f32; FIGURES] {
    let is = f64::from;
    let hits = f64::from(unit.attacks);
    let attacks = !unit.is_healer();
    let [beam, explosion] = match unit.targeter {
        Targeter::LaserBeam { .. } => [true, false],
        Targeter::Kamikaze { .. } => [false, true],
        Targeter::Standard | Targeter::Heal => [false, false],
    };
    let can_hit = |plane| unit.valid_targets.contains(plane);
    [
        unit.hp / 100.0,
        unit.shield / 100.0,
        unit.armor / 2.0,
        unit.attack_range / 5.0,
        unit.speed / 3.0,
        unit.radius(),
        if attacks { unit.damage * hits / 20.0 } else { 0.0 },
        unit.cooldown / 2.0,
        is(unit.is_healer()),
        is(beam),
        is(explosion),
        is(unit.plane == Plane::Ground),
        is(unit.plane == Plane::Air),
        is(unit.plane == Plane::Colossus),
        is(attacks && can_hit(Plane::Ground)),
        is(attacks && can_hit(Plane::Air)),
    ]
    .map(|number| number as f32)
}

/// Why a network for every scenario cannot play one: its rows have what the one form has not.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NotUniversal(String);

/// The form of an observation or of the state.
#[derive(Clone, Debug)]
pub struct UniversalForm {
    enemies: Form,
    allies: Form,
    rest: Form,
    is_obs: bool,
}

/// How the rows of a scenario become rows of the one form.
#[derive(Clone, Debug, PartialEq)]
pub struct UniversalRows {
    /// Those of enemies.
    pub enemies: RowMap,
    /// Those of allies.
    pub allies: RowMap,
    /// What belongs to no other unit.
    pub rest: RowMap,
}

impl UniversalForm {
    /// That of observations, with so many last actions.
    pub fn of_obs(last_actions: usize) -> UniversalForm {
        let seen = ["distance", "dx", "dy", "health", "shield"];
        let own = ["north", "south", "east", "west", "health", "shield", "x", "y"];
        UniversalForm {
            enemies: Form::new(&[&["targetable"], &seen[..]].concat(), true, 0),
            allies: Form::new(&[&["visible"], &seen[..]].concat(), true, 0),
            rest: Form::new(&own, true, last_actions),
            is_obs: true,
        }
    }

    /// That of the state.
    pub fn of_state() -> UniversalForm {
        let enemies = ["health", "rel_x", "rel_y", "shield"];
        UniversalForm {
            enemies: Form::new(&enemies, true, 0),
            allies: Form::new(&[&enemies[..], &["energy/cooldown"]].concat(), true, 1),
            rest: Form::new(&[], false, 0),
            is_obs: false,
        }
    }

    /// The widths of rows: of enemies, of allies, and of the rest.
    pub fn widths(&self) -> [usize; 3] {
        [&self.enemies, &self.allies, &self.rest].map(Form::width)
    }

    /// How rows of a scenario become rows of this form.
    ///
    /// # Errors
    /// If the scenario's observations or states do not have the features, or not the actions, that all have.
    pub fn rows(&self, scenario: &Scenario) -> Result<UniversalRows, NotUniversal> {
        self.find(scenario).map_err(NotUniversal)
    }

    fn find(&self, scenario: &Scenario) -> Result<UniversalRows, String> {
        let targets = TargetLayout::new(scenario).ok_or("observations have no units")?;
        if targets.first != FIRST_TARGET {
            return Err("agents have actions to look".into());
        }
        let blocks = if self.is_obs { obs_features(scenario) } else { state_features(scenario) };
        let reader = Reader { scenario, blocks: &blocks };
        Ok(UniversalRows {
            enemies: reader.enemies(&self.enemies)?,
            allies: reader.allies(&self.allies)?,
            rest: reader.rest(&self.rest)?,
        })
    }
}

/// The features of a row, in their order: by name, then figures, then the last actions.
#[derive(Clone, Debug)]
struct Form {
    names: Vec<String>,
    n_figures: usize,
    last_actions: usize,
}

impl Form {
    fn new(names: &[&str], has_figures: bool, last_actions: usize) -> Form {
        let n_figures = if has_figures { FIGURES } else { 0 };
        Form { names: names.iter().map(|&name| name.to_owned()).collect(), n_figures, last_actions }
    }

    fn width(&self) -> usize {
        self.names.len() + self.n_figures + self.last_actions * ACTION_CLASSES
    }

    fn of_type(&self, figures: &[f32]) -> Vec<(usize, f32)> {
        (self.names.len()..).zip(figures.iter().copied()).filter(|(_, figure)| *figure != 0.0).collect()
    }

    /// The column of an action, `age` steps ago.
    fn of_action(&self, age: usize, action: usize) -> Vec<(usize, f32)> {
        let class = action.min(FIRST_TARGET);
        vec![(self.names.len() + self.n_figures + age * ACTION_CLASSES + class, 1.0)]
    }
}

/// M and m: each column of a scenario's row adds to some columns of the form.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RowMap {
    /// The width of the form.
    width: usize,
    /// By column of the scenario.
    columns: Vec<Vec<(usize, f32)>>,
    constant: Vec<(usize, f32)>,
}

impl RowMap {
    /// The first `n` columns of `width`.
    pub fn prefix(n: usize, width: usize) -> RowMap {
        RowMap { width, columns: (0..n).map(|column| vec![(column, 1.0)]).collect(), constant: Vec::new() }
    }

    /// The widths of a row of the form, and of one of the scenario.
    pub fn widths(&self) -> [usize; 2] {
        [self.width, self.columns.len()]
    }

    /// Of W and b, row by row, W M and b + W m, to `to_weight` and `to_bias`.
    pub fn forward(&self, [weight, bias]: [&[f32]; 2], [to_weight, to_bias]: [&mut [f32]; 2]) {
        let width = self.columns.len();
        for (output, bias) in bias.iter().enumerate() {
            let weight = &weight[output * self.width..][..self.width];
            let product = |terms: &[(usize, f32)]| {
                terms.iter().map(|(column, factor)| weight[*column] * factor).sum::<f32>()
            };
            to_bias[output] = bias + product(&self.constant);
            let row = &mut to_weight[output * width..][..width];
            row.iter_mut().zip(&self.columns).for_each(|(to, terms)| *to = product(terms));
        }
    }

    /// From G and g, the gradients of W M and b + W m: adds G Mᵀ + g mᵀ and g to those of W and b.
    pub fn backward(&self, [weight, bias]: [&[f32]; 2], [to_weight, to_bias]: [&mut [f32]; 2]) {
        let width = self.columns.len();
        for (output, of_bias) in bias.iter().enumerate() {
            to_bias[output] += of_bias;
            let row = &mut to_weight[output * self.width..][..self.width];
            let mut add = |terms: &[(usize, f32)], gradient: f32| {
                terms.iter().for_each(|(column, factor)| row[*column] += factor * gradient);
            };
            add(&self.constant, *of_bias);
            let gradients = &weight[output * width..][..width];
            self.columns.iter().zip(gradients).for_each(|(terms, gradient)| add(terms, *gradient));
        }
    }
}

/// Reads what the rows of a scenario mean.
struct Reader<'a> {
    scenario: &'a Scenario,
    blocks: &'a [FeatureBlock],
}

impl Reader<'_> {
    fn enemies(&self, form: &Form) -> Result<RowMap, String> {
        self.rows(form, Faction::Enemy, &["enemies"])
    }

    fn allies(&self, form: &Form) -> Result<RowMap, String> {
        self.rows(form, Faction::Ally, &["allies", "agents", "last_action"])
    }

    /// What belongs to no other unit; lanes append the agent's last actions.
    fn rest(&self, form: &Form) -> Result<RowMap, String> {
        let of_units = ["enemies", "allies", "agents", "last_action"];
        let names = self.blocks.iter().map(|block| block.name).filter(|name| !of_units.contains(name));
        let mut map = self.rows(form, Faction::Ally, &names.collect::<Vec<_>>())?;
        let n_actions = action_names(self.scenario).len();
        if self.blocks.iter().any(|block| block.name == "own") {
            let ages = (0..form.last_actions).flat_map(|age| (0..n_actions).map(move |action| (age, action)));
            map.columns.extend(ages.map(|(age, action)| form.of_action(age, action)));
        }
        Ok(map)
    }

    /// The columns of the blocks with these names, one after the other.
    fn rows(&self, form: &Form, side: Faction, names: &[&str]) -> Result<RowMap, String> {
        let mut map = RowMap { width: form.width(), ..RowMap::default() };
        let mut names_types = false;
        for block in self.blocks.iter().filter(|block| names.contains(&block.name)) {
            for (number, feature) in block.features.iter().enumerate() {
                map.columns.push(if block.name == "last_action" {
                    form.of_action(0, number)
                } else if let Some(number) = feature.strip_prefix("type_") {
                    names_types = true;
                    form.of_type(&self.figures_of(number)?)
                } else {
                    let place = form.names.iter().position(|name| name == feature);
                    let missing = || format!("it does not know the feature `{feature}` of `{}`", block.name);
                    vec![(place.ok_or_else(missing)?, 1.0)]
                });
            }
        }
        if form.n_figures > 0 && !names_types {
            map.constant = form.of_type(&self.only_figures(side)?);
        }
        Ok(map)
    }

    fn figures_of(&self, number: &str) -> Result<[f32; FIGURES], String> {
        let types = self.scenario.type_ids.iter().zip(&self.scenario.unit_types);
        let mut found = types.filter(|(id, _)| id.to_string() == number).map(|(_, unit)| figures(unit));
        // A number that no type has is never seen.
        let first = found.next().unwrap_or_default();
        let is_one = found.all(|other| other == first);
        is_one.then_some(first).ok_or_else(|| format!("`type_{number}` stands for types with other figures"))
    }

    /// Those of a side whose observations have no types.
    fn only_figures(&self, side: Faction) -> Result<[f32; FIGURES], String> {
        let Scenario { units, unit_types, .. } = self.scenario;
        let is_possible = |number: &usize| {
            let is_of_side = |unit: &Placement| unit.faction == side && unit.unit_type == *number;
            self.scenario.draws_teams() || units.iter().any(is_of_side)
        };
        let possible = (0..unit_types.len()).filter(is_possible);
        let mut figures = possible.map(|number| figures(&unit_types[number]));
        let first = figures.next().unwrap_or_default();
        let is_one = figures.all(|other| other == first);
        is_one.then_some(first).ok_or_else(|| "observations do not say the types of units".into())
    }
}

#[cfg(test)]
mod tests;
