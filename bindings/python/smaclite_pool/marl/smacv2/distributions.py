"""The distributions of `capability_config`, and what they become in a scenario file.

SMACv2's distributions draw in Python. Here the battle draws, from its seed, so that a seed reproduces an
episode; a distribution of SMACv2 only says from what.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Any

from ...errors import InvalidRequest
from ..smac.unavailable import Unavailable

__all__ = ["DRAWN_BY_THE_BATTLE", "Distribution", "get_distribution", "register_distribution", "translated"]

_log = logging.getLogger(__name__)

DRAWN_BY_THE_BATTLE = "drawn by the battle"
"""What stands in an episode's configuration for a value that the battle draws."""

_COUNTS = ("n_units", "n_enemies")
# SMACv2 writes these into the tables of its callers, or reads them where the map has no choice.
_WITHOUT_EFFECT = {"dist_type", "env_key", "observe", *_COUNTS}

Table = Mapping[str, Any]


class Distribution:
    """A distribution of SMACv2, made from its table in `capability_config`."""

    def __init__(self, config: Table) -> None:
        self.config = config
        self.env_key = config.get("env_key")

    def generate(self) -> dict[str, Any]:
        """A configuration for `StarCraft2Env.reset`, which leaves the draw to the battle."""
        return {str(self.env_key): DRAWN_BY_THE_BATTLE}

    @property
    def n_tasks(self) -> float:
        """The number of different values: infinite."""
        return float("inf")


def _weighted_teams(table: Table) -> dict[str, Any]:
    return {"weights": [float(weight) for weight in _required(table, "weights")], **_all_teams(table)}


def _all_teams(table: Table) -> dict[str, Any]:
    types = {"unit_types": _names(_required(table, "unit_types"))}
    # SMACv2's files name exceptions that their teams do not have, which changes nothing.
    exceptions = [
        name for name in _names(table.get("exception_unit_types", ())) if name in types["unit_types"]
    ]
    return {**types, "exception_unit_types": exceptions} if exceptions else types


def _fixed(table: Table) -> dict[str, Any]:
    if table.get("test_mode"):
        raise Unavailable("team_gen: test_mode must be False: the teams of `fixed` are drawn")
    return {"teams": [_names(team) for team in _required(table, "items")]}


def _anywhere(table: Table) -> dict[str, Any]:
    for side in ("map_x", "map_y"):
        if table.get(side, 32) != 32:
            raise Unavailable(f"start_positions: {side} must be 32, the size of the map, got {table[side]!r}")
    return {}


def _with_p(table: Table) -> dict[str, Any]:
    return {"p": float(_required(table, "p")), **_anywhere(table)}


def _uniform(table: Table) -> dict[str, Any]:
    bounds = {name: _one_number(name, _required(table, name)) for name in ("lower_bound", "upper_bound")}
    return {**bounds, "observe": bool(table.get("observe", False))}


def _mask(table: Table) -> dict[str, Any]:
    return {"mask_probability": float(_required(table, "mask_probability"))}


_Translation = Callable[[Table], dict[str, Any]]

# By capability and distribution: the keys that have an effect, and the translation.
_TRANSLATIONS: dict[str, dict[str, tuple[tuple[str, ...], _Translation]]] = {
    "team_gen": {
        "weighted_teams": (("unit_types", "weights", "exception_unit_types"), _weighted_teams),
        "all_teams": (("unit_types", "exception_unit_types"), _all_teams),
        "fixed": (("items", "test_mode"), _fixed),
    },
    "start_positions": {
        "reflect_position": (("map_x", "map_y"), _anywhere),
        "surrounded": (("map_x", "map_y"), _anywhere),
        "surrounded_and_reflect": (("p", "map_x", "map_y"), _with_p),
    },
    "enemy_mask": {"mask": (("mask_probability",), _mask)},
    "attack": {"per_agent_uniform": (("lower_bound", "upper_bound"), _uniform)},
    "health": {"per_agent_uniform": (("lower_bound", "upper_bound"), _uniform)},
}

_REGISTERED: dict[str, type[Any]] = {
    name: type(name, (Distribution,), {"__doc__": f"SMACv2's distribution `{name}`."})
    for of_capability in _TRANSLATIONS.values()
    for name in of_capability
}


def get_distribution(key: str) -> type[Any]:
    """SMACv2's function of that name: the class of a distribution. Raises InvalidRequest for another name."""
    if key not in _REGISTERED:
        raise InvalidRequest(f"dist_type must be one of {', '.join(_REGISTERED)}, got {key!r}")
    return _REGISTERED[key]


def register_distribution(key: str, cls: type[Any]) -> None:
    """SMACv2's function of that name: `get_distribution` returns the class from now on.

    An environment cannot use it: its battle draws, and knows only the distributions of SMACv2.
    """
    _REGISTERED[key] = cls


def translated(capability: str, table: Table) -> dict[str, Any]:
    """A table of `capability_config` as in a scenario file, with its name as `distribution`.

    Raises InvalidRequest for an invalid table, and Unavailable for what a battle cannot draw.
    """
    name, known = table.get("dist_type"), _TRANSLATIONS[capability]
    if name not in known:
        error = Unavailable if name in _REGISTERED else InvalidRequest
        raise error(f"{capability}: dist_type must be one of {', '.join(known)}, got {name!r}")
    keys, translation = known[str(name)]
    for unknown in sorted(set(table) - _WITHOUT_EFFECT - set(keys)):
        # As in SMACv2, so that its files work; a typing error would otherwise stay unseen.
        _log.warning("%s: key %r of %s has no effect", capability, unknown, name)
    try:
        return {"distribution": name, **translation(table)}
    except (InvalidRequest, Unavailable) as error:
        raise type(error)(f"{capability}: {str(error).removeprefix(f'{capability}: ')}") from None


def _required(table: Table, key: str) -> Any:
    if key not in table:
        raise InvalidRequest(f"{table['dist_type']} needs {key!r}, got only {', '.join(map(repr, table))}")
    return table[key]


def _names(names: Any) -> list[str]:
    """Unit types as scenario files have them. SMACv2 writes them in lower case."""
    if isinstance(names, str) or not all(isinstance(name, str) for name in names):
        raise InvalidRequest(f"unit types must be a list of names, got {names!r}")
    return [name.upper() for name in names]


def _one_number(name: str, bound: Any) -> float:
    """A bound, which SMACv2 has as a list: of one number, as each agent has one."""
    values = list(bound) if hasattr(bound, "__len__") else [bound]
    if len(values) != 1:
        raise InvalidRequest(f"{name} must be one number, or a list of one, got {bound!r}")
    return float(values[0])
