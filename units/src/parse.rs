//! The reader of unit files: the keys, their defaults, and the checks of their values.

use crate::file::{Json, MAX_UNIT_BYTES, Node, Object, Range, read_text, shown_path};
use crate::{Attribute, CombatType, Keyword, Plane, Targeter, UnitError, UnitType};
use std::path::Path;

/// Every key of a unit file.
const KEYS: [&str; 21] = [
    "hp",
    "shield",
    "hp_regen",
    "energy",
    "initial_energy",
    "starting_energy",
    "armor",
    "damage",
    "attacks",
    "bonuses",
    "cooldown",
    "speed",
    "attack_range",
    "minimum_scan_range",
    "size",
    "plane",
    "combat_type",
    "valid_targets",
    "attributes",
    "targeter",
    "targeter_kwargs",
];

/// No useful value comes near these limits; they keep the simulator's f32 arithmetic finite.
const MAX_VALUE: f64 = 1e6;
const MAX_SIZE: f64 = 1024.0;
const MAX_ATTACKS: u32 = 1000;

const NON_NEGATIVE: Range = Range::closed(0.0, MAX_VALUE);
const POSITIVE: Range = Range::left_open(0.0, MAX_VALUE);
const SIZE: Range = Range::left_open(0.0, MAX_SIZE);

/// The attack range that `MELEE` stands for, in squares.
const MELEE_RANGE: f64 = 0.1;
const DEFAULT_SCAN_RANGE: f64 = 5.0;

impl UnitType {
    /// Reads a unit file's text. `name` becomes the type's name; error messages call the file `source`.
    ///
    /// `hp`, `armor`, `damage`, `cooldown`, `speed`, `attack_range`, `size`, `valid_targets` and `attributes`
    /// are required; the other keys have defaults. `starting_energy` is another name for `initial_energy`,
    /// and `MELEE` an attack range of 0.1.
    ///
    /// ```
    /// use smaclite_units::UnitType;
    ///
    /// let text = r#"{"hp": 45, "armor": 0, "damage": 6, "cooldown": 3, "speed": 3.15, "attack_range": 3,
    ///                "size": 3, "attributes": ["LIGHT"], "valid_targets": ["GROUND", "ARI"]}"#;
    /// let error = UnitType::from_json(text, "scout", "scout.json").unwrap_err();
    /// let expected =
    ///     r#"scout.json: `valid_targets[1]` is "ARI", but must be one of GROUND, AIR, COLOSSUS"#;
    /// assert_eq!(error.to_string(), format!("{expected}; did you mean `AIR`?"));
    ///
    /// let scout = UnitType::from_json(&text.replace("ARI", "AIR"), "scout", "scout.json").unwrap();
    /// assert_eq!((scout.name.as_str(), scout.attacks, scout.shield), ("scout", 1, 0.0));
    /// ```
    ///
    /// # Errors
    /// [`UnitError`] for the first mistake: invalid JSON, an unknown or missing key, a value of the wrong
    /// type or out of range, or values that contradict each other.
    pub fn from_json(text: &str, name: &str, source: &str) -> Result<UnitType, UnitError> {
        let json = Json::parse(text, source)?;
        let file = Node::root(source, &json).object(&KEYS)?;
        let energy = optional(&file, "energy", NON_NEGATIVE, 0.0)?;
        let combat_type = optional_keyword(&file, "combat_type", CombatType::Damage)?;
        Ok(UnitType {
            name: name.into(),
            hp: required(&file, "hp", POSITIVE)?,
            shield: optional(&file, "shield", NON_NEGATIVE, 0.0)?,
            hp_regen: optional(&file, "hp_regen", NON_NEGATIVE, 0.0)?,
            energy,
            initial_energy: initial_energy(&file, energy)?,
            armor: required(&file, "armor", NON_NEGATIVE)?,
            damage: required(&file, "damage", NON_NEGATIVE)?,
            attacks: file.get("attacks").map_or(Ok(1), |node| node.integer(1, MAX_ATTACKS))?,
            bonuses: bonuses(&file)?,
            cooldown: required(&file, "cooldown", NON_NEGATIVE)?,
            speed: required(&file, "speed", NON_NEGATIVE)?,
            attack_range: attack_range(&file)?,
            minimum_scan_range: optional(&file, "minimum_scan_range", NON_NEGATIVE, DEFAULT_SCAN_RANGE)?,
            size: required(&file, "size", SIZE)?,
            plane: optional_keyword(&file, "plane", Plane::Ground)?,
            combat_type,
            valid_targets: keywords::<Plane>(&file, "valid_targets")?.into_iter().collect(),
            attributes: keywords::<Attribute>(&file, "attributes")?.into_iter().collect(),
            targeter: targeter(&file, combat_type)?,
        })
    }

    /// Reads a unit file; the type is named after the file's stem.
    ///
    /// # Errors
    /// As [`from_json`](Self::from_json), and for a file that cannot be read.
    pub fn load(path: &Path) -> Result<UnitType, UnitError> {
        let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        UnitType::from_json(&read_text(path, MAX_UNIT_BYTES)?, &name, &shown_path(path))
    }
}

fn required(file: &Object, key: &str, range: Range) -> Result<f64, UnitError> {
    file.require(key, &range.expected())?.number(range)
}

fn optional(file: &Object, key: &str, range: Range, default: f64) -> Result<f64, UnitError> {
    file.get(key).map_or(Ok(default), |node| node.number(range))
}

fn optional_keyword<T: Keyword>(file: &Object, key: &str, default: T) -> Result<T, UnitError> {
    file.get(key).map_or(Ok(default), |node| node.keyword())
}

/// A required list of keywords; it may be empty.
fn keywords<T: Keyword>(file: &Object, key: &str) -> Result<Vec<T>, UnitError> {
    let names = T::names().collect::<Vec<_>>().join(", ");
    let list = file.require(key, &format!("a list of keywords out of {names}"))?;
    list.items()?.iter().map(Node::keyword).collect()
}

/// The paper calls the key `initial_energy`, existing files `starting_energy`.
fn initial_energy(file: &Object, energy: f64) -> Result<f64, UnitError> {
    let read = |node: &Node| match node.number(NON_NEGATIVE)? {
        value if value <= energy => Ok(value),
        _ => Err(node.invalid(format!("at most `energy`, which is {energy}"))),
    };
    match (file.get("initial_energy"), file.get("starting_energy")) {
        (None, None) => Ok(0.0),
        (Some(node), None) | (None, Some(node)) => read(&node),
        (Some(initial), Some(starting)) => {
            let value = read(&initial)?;
            if read(&starting)? != value {
                return Err(starting.invalid(format!("{value}, the value of its alias `initial_energy`")));
            }
            Ok(value)
        }
    }
}

fn bonuses(file: &Object) -> Result<Vec<(Attribute, f64)>, UnitError> {
    let Some(node) = file.get("bonuses") else { return Ok(Vec::new()) };
    let bonus = |(name, node): (&str, Node)| Ok((node.key_as_keyword(name)?, node.number(NON_NEGATIVE)?));
    node.entries()?.into_iter().map(bonus).collect()
}

fn attack_range(file: &Object) -> Result<f64, UnitError> {
    let expected = format!("{} or \"MELEE\"", NON_NEGATIVE.expected());
    let node = file.require("attack_range", &expected)?;
    match node.json() {
        Json::String(text) if text == "MELEE" => Ok(MELEE_RANGE),
        _ => node.number(NON_NEGATIVE).map_err(|_| node.invalid(expected)),
    }
}

/// The keywords of `targeter`; the parameters of each are in `targeter_kwargs`.
#[derive(Clone, Copy, PartialEq)]
enum TargeterKind {
    Standard,
    Kamikaze,
    LaserBeam,
    Heal,
}

impl Keyword for TargeterKind {
    const KEYWORDS: &'static [(&'static str, TargeterKind)] = &[
        ("STANDARD", TargeterKind::Standard),
        ("KAMIKAZE", TargeterKind::Kamikaze),
        ("LASER_BEAM", TargeterKind::LaserBeam),
        ("HEAL", TargeterKind::Heal),
    ];
}

fn targeter(file: &Object, combat_type: CombatType) -> Result<Targeter, UnitError> {
    let kind = optional_keyword(file, "targeter", TargeterKind::Standard)?;
    check_combat_type(file, kind, combat_type)?;
    let kwargs = |keys: &[&str]| match file.get("targeter_kwargs") {
        Some(node) => node.object(keys),
        None => {
            let (keys, targeter) = (keys.join("` and `"), kind.name());
            Err(file.missing("targeter_kwargs", &format!("an object with `{keys}` for targeter {targeter}")))
        }
    };
    match kind {
        TargeterKind::Kamikaze => {
            let kwargs = kwargs(&["radius"])?;
            Ok(Targeter::Kamikaze { radius: required(&kwargs, "radius", NON_NEGATIVE)? })
        }
        TargeterKind::LaserBeam => {
            let kwargs = kwargs(&["width", "height"])?;
            let width = required(&kwargs, "width", NON_NEGATIVE)?;
            let height = required(&kwargs, "height", NON_NEGATIVE)?;
            Ok(Targeter::LaserBeam { width, height })
        }
        TargeterKind::Standard => check_no_kwargs(file, kind).map(|()| Targeter::Standard),
        TargeterKind::Heal => check_no_kwargs(file, kind).map(|()| Targeter::Heal),
    }
}

/// Healers have the targeter HEAL, and no other units have it.
fn check_combat_type(file: &Object, kind: TargeterKind, combat_type: CombatType) -> Result<(), UnitError> {
    match (kind == TargeterKind::Heal, combat_type == CombatType::Healing, file.get("targeter")) {
        (false, true, None) => Err(file.missing("targeter", "HEAL, because `combat_type` is HEALING")),
        (false, true, Some(node)) => Err(node.invalid("HEAL, because `combat_type` is HEALING")),
        (true, false, _) => match file.get("combat_type") {
            Some(node) => Err(node.invalid("HEALING, because `targeter` is HEAL")),
            None => Err(file.missing("combat_type", "HEALING, because `targeter` is HEAL")),
        },
        _ => Ok(()),
    }
}

fn check_no_kwargs(file: &Object, kind: TargeterKind) -> Result<(), UnitError> {
    match file.get("targeter_kwargs") {
        Some(node) if !node.entries()?.is_empty() => {
            Err(node.invalid(format!("left out: targeter {} has no parameters", kind.name())))
        }
        _ => Ok(()),
    }
}
