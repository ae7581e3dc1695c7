"""The scenario file that an environment of SMACv2 is: its map, its `capability_config` and its options."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..._native import scenario
from ...errors import InvalidRequest
from ..smac.unavailable import Unavailable
from .distributions import translated
from .maps import get_map_params, race_types

__all__ = ["scenario_of"]

_CAPABILITIES = ("team_gen", "start_positions", "enemy_mask", "attack", "health")

_TINY = 1e-6
_AT_ONE_POINT = {
    "distribution": "uniform",
    # All units of a side on one point, as in SMACv2 without `start_positions`; the battle spreads them.
    "allies": [8, 16, 8 + _TINY, 16 + _TINY],
    "enemies": [24, 16, 24 + _TINY, 16 + _TINY],
}

Config = Mapping[str, Any]


def scenario_of(map_name: str, config: Config, options: Mapping[str, Any]) -> dict[str, Any]:
    """The contents of a scenario file; of those of a map of SMAC, a part.

    Args:
        map_name: one of SMACv2's maps.
        config: SMACv2's `capability_config`; it is not changed.
        options: the other options of `smacv2` in scenario files.

    Raises InvalidRequest for an unknown map or an invalid `config`, and Unavailable for what a battle cannot
    draw.
    """
    params = get_map_params(map_name)
    _check_keys(config)
    types = race_types(map_name)
    made = _of_map(map_name, config) if types is None else _generated(map_name, types, config, params)
    capabilities = {
        name: {key: value for key, value in translated(name, config[name]).items() if key != "distribution"}
        for name in ("enemy_mask", "attack", "health")
        if name in config
    }
    observe = bool(config.get("team_gen", {}).get("observe", True))
    return {**made, "smacv2": {**options, "observe_team": observe, **capabilities}}


def _check_keys(config: Config) -> None:
    for name, table in config.items():
        if name in _CAPABILITIES and not isinstance(table, Mapping):
            raise InvalidRequest(f"capability_config: {name} must be a table, got {table!r}")
        if name not in (*_CAPABILITIES, "n_units", "n_enemies"):
            allowed = ", ".join(_CAPABILITIES)
            raise InvalidRequest(
                f"capability_config: keys must be n_units, n_enemies, {allowed}, got {name!r}"
            )


def _generated(map_name: str, types: tuple[str, ...], config: Config, params: Config) -> dict[str, Any]:
    n_agents, n_enemies = _count(config, "n_units"), _count(config, "n_enemies")
    if "team_gen" not in config:
        raise InvalidRequest(f"capability_config: {map_name} needs team_gen, the distribution of teams")
    teams = translated("team_gen", config["team_gen"])
    named = [*teams.get("unit_types", ()), *(name for team in teams.get("teams", ()) for name in team)]
    for name in named:
        if name not in types:
            allowed = ", ".join(types).lower()
            raise InvalidRequest(
                f"team_gen: unit types of {map_name} must be {allowed}, got {name.lower()!r}"
            )
    starts = config.get("start_positions")
    race = map_name.removeprefix("10gen_")
    shields = race == "protoss"
    return {
        "name": f"{race}_{n_agents}_vs_{n_enemies}",
        "num_allied_units": n_agents,
        "num_enemy_units": n_enemies,
        "teams": teams,
        "start_positions": translated("start_positions", starts) if starts is not None else _AT_ONE_POINT,
        "opponent": "attack_nearest",
        "terrain_preset": "FLAT",
        "num_unit_types": len(types),
        "unit_type_ids": {name: bit for bit, name in enumerate(types)},
        "ally_has_shields": shields,
        "enemy_has_shields": shields,
        "episode_limit": params["limit"],
    }


def _count(config: Config, name: str) -> int:
    count = config.get(name)
    if not isinstance(count, int) or count < 1:
        raise InvalidRequest(f"capability_config: {name} must be an integer above 0, got {count!r}")
    return count


def _of_map(map_name: str, config: Config) -> dict[str, Any]:
    """What the keys of a map of SMAC say; the battle reads the map itself."""
    info = scenario(map_name)
    sides = {"ALLY": info["allies"], "ENEMY": info["enemies"]}
    for name in ("team_gen", "start_positions"):
        if name in config:
            raise Unavailable(f"capability_config: {name} needs a generated map (10gen_*), got {map_name!r}")
    for name, units in zip(("n_units", "n_enemies"), sides.values(), strict=True):
        if config.get(name, len(units)) != len(units):
            raise InvalidRequest(
                f"capability_config: {name} of {map_name} must be {len(units)}, got {config[name]!r}"
            )
    return {
        "num_allied_units": len(info["allies"]),
        "num_enemy_units": len(info["enemies"]),
        "width": info["width"],
        "height": info["height"],
        "num_unit_types": info["num_unit_types"],
        "ally_has_shields": info["ally_has_shields"],
        "enemy_has_shields": info["enemy_has_shields"],
    }
