"""A scenario with the unit files that it names, in the form that the published environment reads too."""

from __future__ import annotations

import copy
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[2]
UNITS = REPOSITORY / "units" / "data"
STANDARD = REPOSITORY / "scenarios" / "data"
TERRAINS = REPOSITORY / "scenarios" / "terrains"

# What the published environment knows by itself. Everything else has to be written out for it.
PUBLISHED_UNITS = [
    "BANELING", "COLOSSUS", "MARAUDER", "MARINE", "MEDIVAC", "SPINE_CRAWLER", "STALKER", "ZEALOT", "ZERGLING",
]  # fmt: skip
PUBLISHED_TERRAINS = [
    "ALL_GREEN", "CHECKERBOARD", "CORRIDOR", "NARROW", "OCTAGON", "PENTAGON", "RAVINE", "SIMPLE",
]  # fmt: skip

Json = dict[str, Any]


@dataclass(frozen=True)
class ScenarioFiles:
    """A scenario file and its unit files, as parsed JSON."""

    name: str
    scenario: Json
    units: dict[str, Json] = field(default_factory=dict)
    """Unit files by name, without those of `PUBLISHED_UNITS`."""
    standard: bool = False
    """Whether smaclite_pool knows this very scenario by its name."""
    episode_limit: int | None = None
    """Its step limit, which the published environment lacks and refuses in a file."""

    def write(self, folder: Path) -> Path:
        """Writes all files below `folder` and returns the path of the scenario file."""
        for name, unit in self.units.items():
            path = folder / "units" / f"{name}.json"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(unit))
        path = folder / f"{self.name}.json"
        path.write_text(json.dumps({**self.scenario, "custom_unit_path": "units"}, indent=1))
        return path

    def heals(self, unit: str) -> bool:
        return unit == "MEDIVAC" or self.units.get(unit, {}).get("combat_type") == "HEALING"

    def roster(self, faction: str) -> list[str]:
        """The unit types of a side (`ALLY`, `ENEMY`), in the order of their ids."""
        groups = [group for group in self.scenario["groups"] if group["faction"] == faction]
        return [unit for group in groups for unit, count in group["units"].items() for _ in range(count)]


def standard_names() -> list[str]:
    """The names of the standard scenarios of this repository that the published environment can play."""
    texts = {path.stem: path.read_text() for path in STANDARD.glob("*.json")}
    return sorted(name for name, text in texts.items() if "groups" in json.loads(text))


def standard(name: str) -> ScenarioFiles:
    """The standard scenario of that name."""
    return read(STANDARD / f"{name}.json", standard=True)


def read(path: Path, standard: bool = False) -> ScenarioFiles:
    """Reads a scenario file and the unit files that it names.

    Raises:
        OSError: a file is missing or cannot be read.
        ValueError: a file is not JSON.
    """
    scenario: Json = json.loads(path.read_text())
    folder = scenario.pop("custom_unit_path", ".")
    limit = scenario.pop("episode_limit", None)
    preset = scenario.get("terrain_preset")
    if preset is not None and preset not in PUBLISHED_TERRAINS:
        scenario["terrain"] = preset_rows(scenario.pop("terrain_preset"))
    names = {unit for group in scenario["groups"] for unit in group["units"]}
    custom = sorted(names.union(scenario.get("unit_type_ids", {})).difference(PUBLISHED_UNITS))
    units = {unit: read_unit(unit, path.parent, folder) for unit in custom}
    return ScenarioFiles(path.stem, scenario, units, standard, limit)


def preset_rows(preset: str) -> list[str]:
    """The rows of a preset terrain, in the order of a scenario file: the southern one first."""
    return (TERRAINS / f"{preset}.txt").read_text().split()[::-1]


def read_unit(name: str, base: Path, folder: str) -> Json:
    """Reads the unit file that `name` means in a scenario file in `base` with that `custom_unit_path`."""
    file = f"{name}.json"
    candidates = [UNITS / file, base / folder / file, Path(folder) / file, base / file, Path(file)]
    found = next((path for path in candidates if path.is_file()), None)
    if found is None:
        raise FileNotFoundError(f"unit type {name}: none of {', '.join(map(str, candidates))} exists")
    unit: Json = json.loads(found.read_text())
    if "initial_energy" in unit:  # the published environment knows the other name only
        unit["starting_energy"] = unit.pop("initial_energy")
    return unit


def count_units(scenario: Json) -> Json:
    """Sets the numbers of units to what the groups have."""
    for key, faction in (("num_allied_units", "ALLY"), ("num_enemy_units", "ENEMY")):
        groups = [group for group in scenario["groups"] if group["faction"] == faction]
        scenario[key] = sum(sum(group["units"].values()) for group in groups)
    return scenario


def with_groups(files: ScenarioFiles, groups: list[Json], name: str) -> ScenarioFiles:
    """The same scenario with other groups, as a scenario file of that name."""
    scenario = count_units({**copy.deepcopy(files.scenario), "groups": groups, "name": name})
    return ScenarioFiles(name, scenario, files.units, False, files.episode_limit)
