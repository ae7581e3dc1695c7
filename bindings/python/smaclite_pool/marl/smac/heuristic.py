"""The scripted policy of SMAC's option `heuristic_ai`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..._native import EAST, FIRST_TARGET, NO_OP, NORTH, SOUTH, STOP, WEST
from ..._units import UnitsView

__all__ = ["Heuristic"]


class Heuristic:
    """Attacks the nearest enemy, or heals the nearest injured ally; moves there if it is out of range.

    An agent keeps its target until that is dead or healed.
    """

    def __init__(self, n_agents: int) -> None:
        self._n_agents = n_agents
        self._targets: list[int | None] = [None] * n_agents

    def reset(self) -> None:
        """Forget all targets; a new episode begins."""
        self._targets = [None] * self._n_agents

    def actions(self, units: UnitsView, avail_actions: NDArray[np.bool_]) -> list[int]:
        """An available action per agent; `avail_actions` is bool [A, N]."""
        return [self._action(agent, units, row) for agent, row in enumerate(avail_actions)]

    def _action(self, agent: int, units: UnitsView, available: NDArray[np.bool_]) -> int:
        if available[NO_OP]:
            return NO_OP
        stats = units.stats[agent]
        heals = stats["healer"]
        side = slice(0, self._n_agents) if heals else slice(self._n_agents, None)
        if heals:
            is_healer = np.array([unit["healer"] for unit in units.stats[side]])
            suitable = (units.health[side] < units.health_max[side]) & ~is_healer
        else:
            suitable = np.array([enemy["plane"] in stats["targets"] for enemy in units.stats[side]])
        candidates = (units.health[side] > 0) & suitable
        target = self._targets[agent]
        offsets = units.positions[side] - units.positions[agent]
        if target is None or not candidates[target]:
            distances = np.where(candidates, np.hypot(offsets[:, 0], offsets[:, 1]), np.inf)
            target = int(distances.argmin()) if candidates.any() else None
            self._targets[agent] = target
        if target is None:
            return STOP
        if available[FIRST_TARGET + target]:
            return FIRST_TARGET + target
        east, north = offsets[target].tolist()
        along_x = EAST if east > 0 else WEST
        along_y = NORTH if north > 0 else SOUTH
        move = along_x if abs(east) > abs(north) else along_y
        return move if available[move] else STOP
