"""What SMAC's environment shows beside its methods for learners: options, terrain, last actions, deaths."""

from __future__ import annotations

import enum
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._layout import Bools, Floats
from ..._native import NORTH
from ..._units import Unit
from ...integrations._common import SingleBattle
from .views import AROUND, N_PATHING, Views

__all__ = ["UNIT_TYPES", "Details", "Direction"]

_OF_STARCRAFT = "it belongs to StarCraft II, which is not used"

# Names of SMAC that programs can meet, and why they do not exist here.
_UNAVAILABLE = {
    "get_agent_action": f"{_OF_STARCRAFT}; `step` takes numbers of actions",
    "get_agent_action_heuristic": f"{_OF_STARCRAFT}; use heuristic_ai=True and heuristic_rest=True",
    "heuristic_targets": f"{_OF_STARCRAFT}; use heuristic_ai=True and heuristic_rest=True",
    "init_units": f"{_OF_STARCRAFT}; `reset` creates the units",
    "update_units": f"{_OF_STARCRAFT}; `agents` and `enemies` are always those of the last step",
    "previous_ally_units": "keep `agents` of the step before",
    "previous_enemy_units": "keep `enemies` of the step before",
    "reward_battle": "the pool computes the reward; `step` returns it",
    "only_medivac_left": "`info` and `agents` tell who is alive",
    "renderer": "`render` draws the battle",
    "last_stats": "`get_stats` has what was counted",
}

UNIT_TYPES = (
    "BANELING", "COLOSSUS", "HYDRALISK", "MARAUDER", "MARINE", "MEDIVAC", "STALKER", "ZEALOT", "ZERGLING",
)  # fmt: skip


class Direction(enum.IntEnum):
    """A direction of a move, numbered as in SMAC."""

    NORTH = 0
    SOUTH = 1
    EAST = 2
    WEST = 3


class Details:
    """A part of `MultiAgentEnv`. Arrays are copies that you can keep and change."""

    n_agents: int
    n_enemies: int
    _views: Views
    _avail: Bools
    _battle: SingleBattle
    _options: dict[str, Any]

    def __getattr__(self, name: str) -> Any:
        """The options of SMAC, such as `obs_last_action`, and ids of types of units, such as `medivac_id`.

        An id is what `unit_type` of such a unit is, or -1 if the scenario has none.
        """
        if not name.startswith("_") and name in self._options:
            return self._options[name]
        unit_type = name.removesuffix("_id").upper()
        if name.endswith("_id") and unit_type in UNIT_TYPES:
            types = self._views.layout.info["unit_types"]
            ids = {unit["unit_type"]: unit["type_id"] for unit in types}
            return ids.get(unit_type, -1)
        reason = f": {_UNAVAILABLE[name]}" if name in _UNAVAILABLE else ""
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}{reason}")

    # --- Terrain ---

    @property
    def pathing_grid(self) -> Bools:
        """bool [map_x, map_y]: which squares are walkable, by x and y."""
        return self._views.layout.walkable.T.copy()

    @property
    def terrain_height(self) -> Floats:
        """float32 [map_x, map_y]: zeros, as all maps are flat."""
        return np.zeros(self.pathing_grid.shape, np.float32)

    @property
    def max_distance_x(self) -> int:
        """Width of the map in squares: here positions in the state are shares of the whole map."""
        return int(self._views.layout.map_size[0])

    @property
    def max_distance_y(self) -> int:
        """Height of the map in squares."""
        return int(self._views.layout.map_size[1])

    def check_bounds(self, x: float, y: float) -> bool:
        """Whether a point lies on the map."""
        return 0 <= x < self.max_distance_x and 0 <= y < self.max_distance_y

    def can_move(self, unit: Unit, direction: int) -> bool:
        """Whether the square that is one to the north (0), south (1), east (2) or west (3) is walkable.

        For a living unit of an agent: whether that move is available.
        """
        if unit.owner == 1 and unit.health > 0:
            return bool(self._avail[unit.tag, NORTH + Direction(direction)])
        dx, dy = ((0, 1), (0, -1), (1, 0), (-1, 0))[Direction(direction)]
        x, y = math.floor(unit.pos.x + dx), math.floor(unit.pos.y + dy)
        return self.check_bounds(x, y) and bool(self._views.layout.walkable[y, x])

    def get_surrounding_points(self, unit: Unit, include_self: bool = False) -> list[tuple[int, int]]:
        """The squares of `obs_pathing_grid` around a unit, in their order, and its own."""
        own = np.floor(unit.pos).astype(int)
        points = (own + AROUND[: None if include_self else N_PATHING]).tolist()
        return [(x, y) for x, y in points]

    # --- Units ---

    @property
    def death_tracker_ally(self) -> NDArray[np.float64]:
        """float64 [A]: 1 for agents that died in this episode, else 0."""
        return self._dead()[: self.n_agents]

    @property
    def death_tracker_enemy(self) -> NDArray[np.float64]:
        """float64 [E]: 1 for enemies that died in this episode, else 0."""
        return self._dead()[self.n_agents :]

    def _dead(self) -> NDArray[np.float64]:
        dead = (self._views.units.health <= 0) & self._battle.has_begun
        return dead.astype(np.float64)

    @property
    def last_action(self) -> NDArray[np.float64]:
        """float64 [A, N]: the last action of each agent, one-hot; zeros after a reset."""
        return self._views.last_action.astype(np.float64)

    def get_unit_type_id(self, unit: Unit, ally: bool) -> int:
        """The index of a unit's type in the type one-hot; 0 if the scenario has none."""
        return unit.unit_type

    @property
    def map_type(self) -> str:
        """The types of the agents' units, such as "STALKER_ZEALOT"; SMAC names groups of its maps."""
        return "_".join(sorted({unit["unit_type"] for unit in self._views.units.stats[: self.n_agents]}))
