//! The reader of unit files: which keys there are, their defaults, and what is refused.

use crate::file::{Json, Limits, MAX_UNIT_BYTES, Node, Object, read_text, shown_path};
use crate::{Attribute, CombatType, Plane, Targeter, UnitError, UnitType, Word};
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

/// No real figure comes near these; they keep the simulator's f32 arithmetic finite.
const LARGEST: f64 = 1e6;
const LARGEST_SIZE: f64 = 1024.0;
const MOST_ATTACKS: u32 = 1000;

const AMOUNT: Limits = Limits::from_to(0.0, LARGEST);
const POSITIVE: Limits = Limits::above_to(0.0, LARGEST);
const SIZE: Limits = Limits::above_to(0.0, LARGEST_SIZE);

/// What the word `MELEE` stands for as an attack range, in squares.
const MELEE_RANGE: f64 = 0.1;
const DEFAULT_SCAN_RANGE: f64 = 5.0;

impl UnitType {
    /// Reads a unit file's text. `name` becomes the type's name; `source` is what error messages call the
    /// file.
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
    /// let error = UnitType::from_json(text, "scout", "scout.json").unwrap_err(); let expected =
    /// r#"scout.json: `valid_targets[1]` is "ARI", but should be one of GROUND, AIR, COLOSSUS"#;
    /// assert_eq!(error.to_string(), format!("{expected}; did you mean `AIR`?"));
    ///
    /// let scout = UnitType::from_json(&text.replace("ARI", "AIR"), "scout", "scout.json").unwrap();
    /// assert_eq!((scout.name.as_str(), scout.attacks, scout.shield), ("scout", 1, 0.0));
    /// ```
    ///
    /// # Errors
    /// [`UnitError`] for the first thing that is wrong: no JSON, a key that is unknown or missing, a value of
    /// the wrong type or out of range, or values at odds with one another.
    pub fn from_json(text: &str, name: &str, source: &str) -> Result<UnitType, UnitError> {
        let json = Json::parse(text, source)?;
        let file = Node::root(source, &json).object(&KEYS)?;
        let energy = optional(&file, "energy", AMOUNT, 0.0)?;
        let combat_type = optional_word(&file, "combat_type", CombatType::Damage)?;
        Ok(UnitType {
            name: name.into(),
            hp: required(&file, "hp", POSITIVE)?,
            shield: optional(&file, "shield", AMOUNT, 0.0)?,
            hp_regen: optional(&file, "hp_regen", AMOUNT, 0.0)?,
            energy,
            initial_energy: initial_energy(&file, energy)?,
            armor: required(&file, "armor", AMOUNT)?,
            damage: required(&file, "damage", AMOUNT)?,
            attacks: file.get("attacks").map_or(Ok(1), |node| node.integer(1, MOST_ATTACKS))?,
            bonuses: bonuses(&file)?,
            cooldown: required(&file, "cooldown", AMOUNT)?,
            speed: required(&file, "speed", AMOUNT)?,
            attack_range: attack_range(&file)?,
            minimum_scan_range: optional(&file, "minimum_scan_range", AMOUNT, DEFAULT_SCAN_RANGE)?,
            size: required(&file, "size", SIZE)?,
            plane: optional_word(&file, "plane", Plane::Ground)?,
            combat_type,
            valid_targets: words::<Plane>(&file, "valid_targets")?.into_iter().collect(),
            attributes: words::<Attribute>(&file, "attributes")?.into_iter().collect(),
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

fn required(file: &Object, key: &str, limits: Limits) -> Result<f64, UnitError> {
    file.require(key, &limits.expected())?.number(limits)
}

fn optional(file: &Object, key: &str, limits: Limits, default: f64) -> Result<f64, UnitError> {
    file.get(key).map_or(Ok(default), |node| node.number(limits))
}

fn optional_word<T: Word>(file: &Object, key: &str, default: T) -> Result<T, UnitError> {
    file.get(key).map_or(Ok(default), |node| node.word())
}

/// A required list of words; it may be empty.
fn words<T: Word>(file: &Object, key: &str) -> Result<Vec<T>, UnitError> {
    let expected = T::WORDS.iter().map(|(word, _)| *word).collect::<Vec<_>>().join(", ");
    let list = file.require(key, &format!("a list of words out of {expected}"))?;
    list.items()?.iter().map(Node::word).collect()
}

/// The paper says `initial_energy`, files in circulation `starting_energy`.
fn initial_energy(file: &Object, energy: f64) -> Result<f64, UnitError> {
    let read = |node: &Node| match node.number(AMOUNT)? {
        value if value <= energy => Ok(value),
        _ => Err(node.invalid(format!("at most `energy`, which is {energy}"))),
    };
    match (file.get("initial_energy"), file.get("starting_energy")) {
        (None, None) => Ok(0.0),
        (Some(node), None) | (None, Some(node)) => read(&node),
        (Some(initial), Some(starting)) => {
            let value = read(&initial)?;
            if read(&starting)? != value {
                return Err(starting.invalid(format!("{value} like `initial_energy`, its other name")));
            }
            Ok(value)
        }
    }
}

fn bonuses(file: &Object) -> Result<Vec<(Attribute, f64)>, UnitError> {
    let Some(node) = file.get("bonuses") else { return Ok(Vec::new()) };
    let bonus = |(name, node): (&str, Node)| Ok((node.key_word(name)?, node.number(AMOUNT)?));
    node.entries()?.into_iter().map(bonus).collect()
}

fn attack_range(file: &Object) -> Result<f64, UnitError> {
    let expected = format!("{} or \"MELEE\"", AMOUNT.expected());
    let node = file.require("attack_range", &expected)?;
    match node.json() {
        Json::String(word) if word == "MELEE" => Ok(MELEE_RANGE),
        _ => node.number(AMOUNT).map_err(|_| node.invalid(expected)),
    }
}

/// The words of `targeter`; the figures that belong to each are in `targeter_kwargs`.
#[derive(Clone, Copy, PartialEq)]
enum TargeterWord {
    Standard,
    Kamikaze,
    LaserBeam,
    Heal,
}

impl Word for TargeterWord {
    const WORDS: &'static [(&'static str, TargeterWord)] = &[
        ("STANDARD", TargeterWord::Standard),
        ("KAMIKAZE", TargeterWord::Kamikaze),
        ("LASER_BEAM", TargeterWord::LaserBeam),
        ("HEAL", TargeterWord::Heal),
    ];
}

fn targeter(file: &Object, combat_type: CombatType) -> Result<Targeter, UnitError> {
    let word = optional_word(file, "targeter", TargeterWord::Standard)?;
    check_role(file, word, combat_type)?;
    let kwargs = |word: &str, keys: &[&str]| match file.get("targeter_kwargs") {
        Some(node) => node.object(keys),
        None => {
            let figures = keys.join("` and `");
            Err(file.missing("targeter_kwargs", &format!("an object with `{figures}` for targeter {word}")))
        }
    };
    match word {
        TargeterWord::Kamikaze => {
            let kwargs = kwargs("KAMIKAZE", &["radius"])?;
            Ok(Targeter::Kamikaze { radius: required(&kwargs, "radius", AMOUNT)? })
        }
        TargeterWord::LaserBeam => {
            let kwargs = kwargs("LASER_BEAM", &["width", "height"])?;
            let (width, height) = (required(&kwargs, "width", AMOUNT)?, required(&kwargs, "height", AMOUNT)?);
            Ok(Targeter::LaserBeam { width, height })
        }
        TargeterWord::Standard => no_kwargs(file, "STANDARD").map(|()| Targeter::Standard),
        TargeterWord::Heal => no_kwargs(file, "HEAL").map(|()| Targeter::Heal),
    }
}

/// A healer's targeter heals and nobody else's does.
fn check_role(file: &Object, word: TargeterWord, combat_type: CombatType) -> Result<(), UnitError> {
    match (word == TargeterWord::Heal, combat_type == CombatType::Healing, file.get("targeter")) {
        (false, true, None) => Err(file.missing("targeter", "HEAL, because `combat_type` is HEALING")),
        (false, true, Some(node)) => Err(node.invalid("HEAL, because `combat_type` is HEALING")),
        (true, false, _) => match file.get("combat_type") {
            Some(node) => Err(node.invalid("HEALING, because `targeter` is HEAL")),
            None => Err(file.missing("combat_type", "HEALING, because `targeter` is HEAL")),
        },
        _ => Ok(()),
    }
}

fn no_kwargs(file: &Object, word: &str) -> Result<(), UnitError> {
    match file.get("targeter_kwargs") {
        Some(node) if !node.entries()?.is_empty() => {
            Err(node.invalid(format!("left out: targeter {word} has no figures of its own")))
        }
        _ => Ok(()),
    }
}
