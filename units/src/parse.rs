//! The reader of unit files: the values of the keys, and their dependencies. `keys` declares the keys.

use crate::file::{Document, Key, MAX_UNIT_BYTES, Node, Object, Problems, Range, Report, Reported};
use crate::file::{read_text, shown_path};
use crate::keys::{self, NON_NEGATIVE, TargeterKind};
use crate::{Attribute, CombatType, Conduct, Keyword, Targeter, UnitType};
use std::path::Path;

/// The attack range that `MELEE` stands for, in squares.
const MELEE_RANGE: f64 = 0.1;

impl UnitType {
    /// Reads a unit file's text. `name` becomes the type's name; problems call the file `source`.
    ///
    /// `hp`, `armor`, `damage`, `cooldown`, `speed`, `attack_range`, `size`, `valid_targets` and `attributes`
    /// are required; the other keys have defaults. `starting_energy` is another name for `initial_energy`,
    /// and `MELEE` an attack range of 0.1.
    ///
    /// ```
    /// use smaclite_units::UnitType;
    ///
    /// let text = r#"{"hp": 45, "armor": 0, "damage": 6, "cooldown": 3, "speed": 3.15, "attack_range": 3,
    ///                "size": 0, "attributes": ["LIGHT"], "valid_targets": ["GROUND", "ARI"]}"#;
    /// let problems = UnitType::from_json(text, "scout", "scout.json").unwrap_err();
    /// let messages: Vec<String> = problems.list().iter().map(|problem| problem.to_string()).collect();
    /// assert_eq!(messages, [
    ///     "scout.json:2:24: `size` is 0, but must be a number from 0.001 to 1024",
    ///     "scout.json:2:80: `valid_targets[1]` is \"ARI\", but must be one of GROUND, AIR, COLOSSUS; \
    ///      did you mean `AIR`?",
    /// ]);
    ///
    /// let valid = text.replace("ARI", "AIR").replace("\"size\": 0", "\"size\": 3");
    /// let scout = UnitType::from_json(&valid, "scout", "scout.json").unwrap();
    /// assert_eq!((scout.name.as_str(), scout.attacks, scout.shield), ("scout", 1, 0.0));
    /// ```
    ///
    /// # Errors
    /// [`Problems`]: invalid JSON, or every unknown or missing key, value of the wrong type or out of range,
    /// and values that contradict each other.
    pub fn from_json(text: &str, name: &str, source: &str) -> Result<UnitType, Problems> {
        let report = Report::default();
        let unit_type = UnitType::read(text, name, source, &report);
        report.finish(unit_type)
    }

    /// As [`from_json`](Self::from_json), as one of several files: the problems are added to `report`.
    ///
    /// # Errors
    /// [`Reported`] if a problem was added.
    pub fn read(text: &str, name: &str, source: &str, report: &Report) -> Result<UnitType, Reported> {
        let document = Document::parse(text, source, report)?;
        let file = document.root().object(&keys::KEYS)?;
        let schema = file.read_optional(&crate::file::SCHEMA_KEY);
        let number = |key: &Key<Range>| file.read(key);
        let (energy, combat_type) = (number(&keys::ENERGY), file.read(&keys::COMBAT_TYPE));
        let (hp, shield, hp_regen) = (number(&keys::HP), number(&keys::SHIELD), number(&keys::HP_REGEN));
        let (armor, damage) = (number(&keys::ARMOR), number(&keys::DAMAGE));
        let (cooldown, speed, size) = (cooldown(&file), number(&keys::SPEED), number(&keys::SIZE));
        let minimum_scan_range = number(&keys::MINIMUM_SCAN_RANGE);
        let (sight_range, targeting_range) = (number(&keys::SIGHT_RANGE), number(&keys::TARGETING_RANGE));
        let (attacks, plane) = (file.read(&keys::ATTACKS), file.read(&keys::PLANE));
        let valid_targets = file.read(&keys::VALID_TARGETS);
        let attributes = file.read(&keys::ATTRIBUTES);
        let initial_energy = initial_energy(&file, energy);
        let (bonuses, attack_range) = (bonuses(&file), attack_range(&file));
        let targeter = targeter(&file, combat_type);
        let conduct = conduct(&file, targeter);
        schema?;
        Ok(UnitType {
            name: name.into(),
            hp: hp?,
            shield: shield?,
            hp_regen: hp_regen?,
            energy: energy?,
            initial_energy: initial_energy?,
            armor: armor?,
            damage: damage?,
            attacks: attacks?,
            bonuses: bonuses?,
            cooldown: cooldown?,
            speed: speed?,
            attack_range: attack_range?,
            minimum_scan_range: minimum_scan_range?,
            sight_range: sight_range?,
            targeting_range: targeting_range?,
            size: size?,
            plane: plane?,
            combat_type: combat_type?,
            valid_targets: valid_targets?.into_iter().collect(),
            attributes: attributes?.into_iter().collect(),
            targeter: targeter?,
            conduct: conduct?,
        })
    }

    /// Reads a unit file; the type is named after the file's stem.
    ///
    /// # Errors
    /// As [`from_json`](Self::from_json), and for a file that cannot be read.
    pub fn load(path: &Path) -> Result<UnitType, Problems> {
        let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let report = Report::default();
        let text = read_text(path, MAX_UNIT_BYTES, &report);
        let unit_type = text.and_then(|text| UnitType::read(&text, &name, &shown_path(path), &report));
        report.finish(unit_type)
    }
}

/// Reads `initial_energy` and its alias; both are compared with `energy` if that is valid.
fn initial_energy(file: &Object, energy: Result<f64, Reported>) -> Result<f64, Reported> {
    let read = |key: &Key<Range>| {
        let Some(node) = file.get(key) else { return Ok(None) };
        match (node.number(NON_NEGATIVE)?, energy) {
            (value, Ok(energy)) if value > energy => {
                Err(node.invalid(&format!("at most `energy`, which is {energy}")))
            }
            (value, _) => Ok(Some((value, node))),
        }
    };
    match (read(&keys::INITIAL_ENERGY), read(&keys::STARTING_ENERGY)) {
        (Ok(Some((initial, _))), Ok(Some((starting, node)))) if initial != starting => {
            Err(node.invalid(&format!("{initial}, the value of its alias `initial_energy`")))
        }
        (initial, starting) => Ok(initial?.or(starting?).map_or(0.0, |(value, _)| value)),
    }
}

/// What rules `starcraft` read.
fn conduct(file: &Object, targeter: Result<Targeter, Reported>) -> Result<Conduct, Reported> {
    let number = |key: &Key<Range>| file.read(key);
    let (damage_point, backswing) = (number(&keys::DAMAGE_POINT), number(&keys::BACKSWING));
    let (range_slop, hit_interval) = (number(&keys::RANGE_SLOP), number(&keys::HIT_INTERVAL));
    let (projectile_speed, effect_delay) = (number(&keys::PROJECTILE_SPEED), number(&keys::EFFECT_DELAY));
    let (acceleration, least) = (number(&keys::ACCELERATION), number(&keys::MIN_RANDOM_DELAY));
    let turn_rate = number(&keys::TURN_RATE);
    let explodes_when_killed = match (file.read(&keys::EXPLODES_WHEN_KILLED), targeter) {
        (Ok(true), Ok(targeter)) if !matches!(targeter, Targeter::Kamikaze { .. }) => {
            let node = file.require(&keys::EXPLODES_WHEN_KILLED)?;
            Err(node.invalid("false, because only units with targeter KAMIKAZE explode"))
        }
        (explodes, _) => explodes,
    };
    let greatest = match (number(&keys::MAX_RANDOM_DELAY), least) {
        (Ok(greatest), Ok(least)) if greatest < least => {
            let expected = format!("at least `min_random_delay`, which is {least}");
            Err(match file.get(&keys::MAX_RANDOM_DELAY) {
                Some(node) => node.invalid(&expected),
                None => file.missing(keys::MAX_RANDOM_DELAY.name, &expected),
            })
        }
        (greatest, _) => greatest,
    };
    Ok(Conduct {
        damage_point: damage_point?,
        backswing: backswing?,
        min_random_delay: least?,
        max_random_delay: greatest?,
        range_slop: range_slop?,
        hit_interval: hit_interval?,
        projectile_speed: projectile_speed?,
        effect_delay: effect_delay?,
        acceleration: acceleration?,
        turn_rate: turn_rate?,
        explodes_when_killed: explodes_when_killed?,
    })
}

/// State features are divided by it, unless it is 0.
fn cooldown(file: &Object) -> Result<f64, Reported> {
    let (node, expected) = (file.require(&keys::COOLDOWN)?, keys::COOLDOWN.kind.expected);
    let cooldown = node.number_or(NON_NEGATIVE, expected)?;
    let is_useful = cooldown == 0.0 || cooldown >= keys::MIN_POSITIVE;
    if is_useful { Ok(cooldown) } else { Err(node.invalid(expected)) }
}

fn bonuses(file: &Object) -> Result<Vec<(Attribute, f64)>, Reported> {
    let Some(node) = file.get(&keys::BONUSES) else { return Ok(Vec::new()) };
    let bonus = |(name, node): (&str, Node)| {
        let (attribute, damage) = (node.key_as_keyword(name), node.number(NON_NEGATIVE));
        Ok((attribute?, damage?))
    };
    let bonuses: Vec<_> = node.entries()?.into_iter().map(bonus).collect();
    bonuses.into_iter().collect()
}

fn attack_range(file: &Object) -> Result<f64, Reported> {
    let node = file.require(&keys::ATTACK_RANGE)?;
    match node.as_str() {
        Some("MELEE") => Ok(MELEE_RANGE),
        _ => node.number_or(NON_NEGATIVE, keys::ATTACK_RANGE.kind.expected),
    }
}

fn targeter(file: &Object, combat_type: Result<CombatType, Reported>) -> Result<Targeter, Reported> {
    let kind = file.read(&keys::TARGETER)?;
    let checked = combat_type.and_then(|combat_type| check_combat_type(file, kind, combat_type));
    let targeter = targeter_of_kind(file, kind);
    checked.and(targeter)
}

fn targeter_of_kind(file: &Object, kind: TargeterKind) -> Result<Targeter, Reported> {
    let kwargs = || match file.get(&keys::TARGETER_KWARGS) {
        Some(node) => node.object(kind.parameters()),
        None => {
            let names: Vec<_> = kind.parameters().iter().map(|key| key.name()).collect();
            let (names, targeter) = (names.join("` and `"), kind.name());
            let expected = format!("an object with `{names}` for targeter {targeter}");
            Err(file.missing(keys::TARGETER_KWARGS.name, &expected))
        }
    };
    match kind {
        TargeterKind::Kamikaze => Ok(Targeter::Kamikaze { radius: kwargs()?.read(&keys::RADIUS)? }),
        TargeterKind::LaserBeam => {
            let kwargs = kwargs()?;
            let (width, height) = (kwargs.read(&keys::WIDTH), kwargs.read(&keys::HEIGHT));
            Ok(Targeter::LaserBeam { width: width?, height: height? })
        }
        TargeterKind::Standard => check_no_kwargs(file, kind).map(|()| Targeter::Standard),
        TargeterKind::Heal => check_no_kwargs(file, kind).map(|()| Targeter::Heal),
    }
}

/// Healers have the targeter HEAL, and no other units have it.
fn check_combat_type(file: &Object, kind: TargeterKind, combat_type: CombatType) -> Result<(), Reported> {
    match (kind == TargeterKind::Heal, combat_type == CombatType::Healing, file.get(&keys::TARGETER)) {
        (false, true, None) => Err(file.missing("targeter", "HEAL, because `combat_type` is HEALING")),
        (false, true, Some(node)) => Err(node.invalid("HEAL, because `combat_type` is HEALING")),
        (true, false, _) => match file.get(&keys::COMBAT_TYPE) {
            Some(node) => Err(node.invalid("HEALING, because `targeter` is HEAL")),
            None => Err(file.missing("combat_type", "HEALING, because `targeter` is HEAL")),
        },
        _ => Ok(()),
    }
}

fn check_no_kwargs(file: &Object, kind: TargeterKind) -> Result<(), Reported> {
    match file.get(&keys::TARGETER_KWARGS) {
        Some(node) if !node.entries()?.is_empty() => {
            Err(node.invalid(&format!("left out: targeter {} has no parameters", kind.name())))
        }
        _ => Ok(()),
    }
}
