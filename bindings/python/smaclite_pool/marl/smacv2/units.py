"""Units as SMACv2 shows them to analysis scripts, and the numbers of their types."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from ..._units import Position
from ..smac.details import UNIT_TYPES

__all__ = ["LEARNER_IDS", "Unit", "all_units", "type_id"]

# StarCraft II's own numbers of the types of enemies.
_ENEMY_IDS = {
    "BANELING": 9, "COLOSSUS": 4, "HYDRALISK": 107, "MARAUDER": 51, "MARINE": 48, "MEDIVAC": 54,
    "SPINE_CRAWLER": 98, "STALKER": 74, "ZEALOT": 73, "ZERGLING": 105,
}  # fmt: skip

LEARNER_IDS = {name: 2000 + place for place, name in enumerate(UNIT_TYPES)}
"""The numbers of the types of agents, in SMACv2's order; none is one of StarCraft II's own."""


@dataclass(frozen=True)
class Unit:
    """A unit between two steps. A dead unit has health 0 and its last known position."""

    tag: int
    """Its number within its side."""
    owner: int
    """1 for units of the agents, 2 for enemies."""
    unit_type: int
    """`<type>_id` of the environment for agents, StarCraft II's number for enemies; 0 for other types."""
    name: str
    """Name of its type, such as MARINE."""
    pos: Position
    health: float
    """0 to `health_max`, in points."""
    health_max: float
    shield: float
    """0 to `shield_max`, in points."""
    shield_max: float
    energy: float
    """In points."""
    weapon_cooldown: float
    """Seconds until it can act again."""


def type_id(name: str, is_ally: bool) -> int:
    """The number of a unit type; 0 for one that SMACv2 does not have."""
    return (LEARNER_IDS if is_ally else _ENEMY_IDS).get(name, 0)


def all_units(columns: dict[str, NDArray[Any]], type_names: list[str], n_agents: int) -> list[Unit]:
    """The units of `CapabilityBattle.units()`, agents first."""
    rows = zip(*(columns[name].tolist() for name in _COLUMNS), strict=True)
    units = []
    for index, (kind, x, y, health, health_max, shield, shield_max, energy, cooldown) in enumerate(rows):
        is_ally, name = index < n_agents, type_names[kind]
        unit = Unit(
            tag=index if is_ally else index - n_agents,
            owner=1 if is_ally else 2,
            unit_type=type_id(name, is_ally),
            name=name,
            pos=Position(x, y),
            health=health,
            health_max=health_max,
            shield=shield,
            shield_max=shield_max,
            energy=energy,
            weapon_cooldown=cooldown,
        )
        units.append(unit)
    return units


_COLUMNS = ("type", "x", "y", "health", "health_max", "shield", "shield_max", "energy", "cooldown")
