"""The maps that SMACv2 knows: three of generated scenarios, and the 23 of SMAC; all are scenarios here."""

from __future__ import annotations

from typing import Any

from ..._native import scenario
from ...errors import InvalidRequest

__all__ = ["SMACMap", "get_map_params", "get_smac_map_registry", "map_param_registry", "race_types"]

_RACES = {
    "terran": ("MARINE", "MARAUDER", "MEDIVAC"),
    "zerg": ("ZERGLING", "HYDRALISK", "BANELING"),
    "protoss": ("STALKER", "ZEALOT", "COLOSSUS"),
}
"""The unit types of each race's generated scenarios, in the order of the type one-hot."""

# SMAC's names for what the agents of its maps consist of, in the order of its table.
_MAP_TYPES = {
    "3m": "marines", "8m": "marines", "25m": "marines", "5m_vs_6m": "marines", "8m_vs_9m": "marines",
    "10m_vs_11m": "marines", "27m_vs_30m": "marines", "MMM": "MMM", "MMM2": "MMM",
    "2s3z": "stalkers_and_zealots", "3s5z": "stalkers_and_zealots", "3s5z_vs_3s6z": "stalkers_and_zealots",
    "3s_vs_3z": "stalkers", "3s_vs_4z": "stalkers", "3s_vs_5z": "stalkers",
    "1c3s5z": "colossi_stalkers_zealots", "2m_vs_1z": "marines", "corridor": "zealots",
    "6h_vs_8z": "hydralisks", "2s_vs_1sc": "stalkers", "so_many_baneling": "zealots", "bane_vs_bane": "bane",
    "2c_vs_64zg": "colossus",
}  # fmt: skip


class SMACMap:
    """In SMACv2, a map file of StarCraft II. Here maps are scenarios, so it has no content."""


def race_types(map_name: str) -> tuple[str, ...] | None:
    """The unit types of a generated map, in the order of the type one-hot; None for the maps of SMAC."""
    return _RACES.get(map_name.removeprefix("10gen_")) if map_name.startswith("10gen_") else None


def _generated(race: str) -> dict[str, Any]:
    return {
        # Counts come from `capability_config`; SMACv2's table has the number that the name once stood for.
        "n_agents": 10,
        "n_enemies": 10,
        "limit": 200,
        "a_race": race[0].upper(),
        "b_race": race[0].upper(),
        "unit_type_bits": len(_RACES[race]),
        "map_type": f"{race}_gen",
        "map_name": "32x32_flat",
    }


def _of_smac(name: str, map_type: str) -> dict[str, Any]:
    info = scenario(name)
    return {
        "n_agents": len(info["allies"]),
        "n_enemies": len(info["enemies"]),
        "limit": info["episode_limit"],
        "a_race": _race(info["allies"][0]["unit_type"]),
        "b_race": _race(info["enemies"][0]["unit_type"]),
        "unit_type_bits": info["num_unit_types"],
        "map_type": map_type,
        "map_name": name,
    }


def _race(unit_type: str) -> str:
    """The letter of a unit type's race; the spine crawler, which no generated scenario has, is zerg."""
    return next((race[0].upper() for race, types in _RACES.items() if unit_type in types), "Z")


map_param_registry: dict[str, dict[str, Any]] = {
    **{f"10gen_{race}": _generated(race) for race in _RACES},
    **{name: _of_smac(name, map_type) for name, map_type in _MAP_TYPES.items()},
}
"""By name of the map: `n_agents`, `n_enemies`, `limit`, `a_race`, `b_race`, `unit_type_bits`, `map_type`,
`map_name`."""


def get_smac_map_registry() -> dict[str, dict[str, Any]]:
    """SMACv2's function of that name: `map_param_registry`."""
    return map_param_registry


def get_map_params(map_name: str) -> dict[str, Any]:
    """SMACv2's function of that name: the entry of a map, as a copy.

    Raises InvalidRequest for a name that is not in the registry.
    """
    if map_name not in map_param_registry:
        raise InvalidRequest(f"map_name must be one of {', '.join(map_param_registry)}, got {map_name!r}")
    return dict(map_param_registry[map_name])
