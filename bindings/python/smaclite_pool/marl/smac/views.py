"""SMAC's options for observations and state, applied to the observations and state of the pool."""

from __future__ import annotations

from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from ..._layout import Bools, FeatureBlock, Floats, ScenarioLayout
from ..._native import Envs
from ..._units import UnitsView
from ...errors import InvalidRequest

__all__ = ["ViewOptions", "Views"]

# The squares of `obs_pathing_grid` and `obs_terrain_height`, relative to the unit and in SMAC's order: two
# moves to the north, south, east, west, then one move along each diagonal. Heights also include the unit's.
AROUND = np.array([(0, 4), (0, -4), (4, 0), (-4, 0), (2, 2), (-2, -2), (2, -2), (-2, 2), (0, 0)])
N_PATHING, N_HEIGHT = 8, 9


class ViewOptions(TypedDict):
    """SMAC's observation and state options, by SMAC's names."""

    obs_all_health: bool
    obs_own_health: bool
    obs_last_action: bool
    obs_pathing_grid: bool
    obs_terrain_height: bool
    obs_instead_of_state: bool
    obs_timestep_number: bool
    state_last_action: bool
    state_timestep_number: bool


class Views:
    """Observations and state of one battle with these options."""

    def __init__(self, envs: Envs, options: ViewOptions) -> None:
        self.layout = ScenarioLayout(envs)
        self.units = UnitsView(self.layout)
        self.options = options
        self._shows_own_health = options["obs_own_health"] or options["obs_all_health"]
        n_agents = self.layout.n_agents
        others = [[ally for ally in range(n_agents) if ally != agent] for agent in range(n_agents)]
        self._others = np.array(others, np.intp).reshape(n_agents, -1)
        self._limit = 0
        self._steps = 0
        self._obs: Floats
        self._state: Floats

    def set_limit(self, limit: int | None) -> None:
        """Set the episode limit, the denominator of timestep numbers; None if there is none.

        Raises InvalidRequest if the options need one.
        """
        if limit is None and (self.options["obs_timestep_number"] or self.options["state_timestep_number"]):
            raise InvalidRequest(
                "obs_timestep_number and state_timestep_number are fractions of the episode limit; set one"
            )
        self._limit = limit or 0

    def update(self, obs: Floats, state: Floats, steps: int) -> None:
        """Set the current observations [A, obs_size] and state [state_size]; both are kept."""
        self._obs, self._state, self._steps = obs, state, steps
        self.units.update(state)

    @property
    def last_action(self) -> Floats:
        """float32 [A, N]: the last action of each agent, one-hot; zeros after a reset."""
        return self.layout.state.last_action.view(self._state)

    # --- Sizes ---

    def enemy_features(self) -> tuple[int, int]:
        """Number of enemies in an observation, and number of features per enemy."""
        return self.layout.n_enemies, len(self._kept(self.layout.obs.enemies, self.options["obs_all_health"]))

    def ally_features(self, n_actions: int) -> tuple[int, int]:
        """Number of allies in an observation, and number of features per ally."""
        last_action = n_actions if self.options["obs_last_action"] else 0
        kept = self._kept(self.layout.obs.allies, self.options["obs_all_health"])
        return self.layout.n_agents - 1, len(kept) + last_action

    def own_features(self) -> int:
        """Number of features of the agent itself in an observation."""
        kept = self._kept(self.layout.obs.own, self._shows_own_health)
        return len(kept) + int(self.options["obs_timestep_number"])

    def move_features(self) -> int:
        """Number of features about moves and terrain in an observation."""
        options = self.options
        terrain = N_PATHING * options["obs_pathing_grid"] + N_HEIGHT * options["obs_terrain_height"]
        return len(self.layout.obs.moves.features) + int(terrain)

    def state_size(self, n_actions: int) -> int:
        """Number of features of the state, if it is not the observations."""
        allies, enemies = self.layout.state.allies, self.layout.state.enemies
        units = int(np.prod(allies.shape) + np.prod(enemies.shape))
        actions = self.layout.n_agents * n_actions if self.options["state_last_action"] else 0
        return units + actions + int(self.options["state_timestep_number"])

    @staticmethod
    def _kept(block: FeatureBlock, with_health: bool) -> list[int]:
        """Indices of the features of a block, with or without health and shield."""
        hidden = () if with_health else ("health", "shield")
        return [i for i, name in enumerate(block.features) if name not in hidden]

    def _select(self, block: FeatureBlock, with_health: bool) -> Floats:
        part = block.view(self._obs)
        return part if with_health else part[..., self._kept(block, with_health)]

    # --- Observations and state ---

    def observations(self) -> Floats:
        """float32 [A, O]: the observation of each agent."""
        layout, options, n_agents = self.layout.obs, self.options, self.layout.n_agents
        alive = self.units.health[:n_agents] > 0
        parts: list[NDArray[np.float32 | np.bool_]] = [layout.moves.view(self._obs)]
        if options["obs_pathing_grid"]:
            parts.append(self.walkable_around()[:, :N_PATHING] * alive[:, None])
        if options["obs_terrain_height"]:
            parts.append(self.heights_around() * alive[:, None])
        enemies = self._select(layout.enemies, options["obs_all_health"])
        allies = self._select(layout.allies, options["obs_all_health"])
        own = self._select(layout.own, self._shows_own_health)
        if options["obs_last_action"]:
            visible = layout.allies.column(self._obs, "visible")
            allies = np.concatenate((allies, self.last_action[self._others] * visible[..., None]), axis=2)
        parts += [enemies.reshape(n_agents, -1), allies.reshape(n_agents, -1), own]
        if options["obs_timestep_number"]:
            parts.append(np.full((n_agents, 1), self._timestep()))
        return np.concatenate(parts, axis=1, dtype=np.float32)

    def state(self) -> Floats:
        """float32 [S]: the state."""
        if self.options["obs_instead_of_state"]:
            return self.observations().reshape(-1)
        return np.concatenate([np.ravel(part) for part in self.state_dict().values()], dtype=np.float32)

    def state_dict(self) -> dict[str, Floats]:
        """The parts of the state by name, in order."""
        layout = self.layout.state
        units = {"allies": layout.allies, "enemies": layout.enemies}
        parts = {name: block.view(self._state).copy() for name, block in units.items()}
        if self.options["state_last_action"]:
            parts["last_action"] = self.last_action.copy()
        if self.options["state_timestep_number"]:
            parts["timestep"] = np.array(self._timestep(), np.float32)
        return parts

    def visibility(self) -> Bools:
        """bool [A, A + E]: which units each agent sees, without itself."""
        layout, n_agents = self.layout.obs, self.layout.n_agents
        visible = np.zeros((n_agents, n_agents + self.layout.n_enemies), np.bool_)
        allies = layout.allies.column(self._obs, "visible") > 0
        np.put_along_axis(visible, self._others, allies, axis=1)
        # Enemies out of sight have zeros only, and those in sight are alive.
        visible[:, n_agents:] = layout.enemies.column(self._obs, "health") > 0
        return visible

    # --- Terrain ---

    def points_around(self) -> NDArray[np.int64]:
        """int64 [A, 9, 2]: the squares around each agent, then its own."""
        own = np.floor(self.units.positions[: self.layout.n_agents]).astype(np.int64)
        points: NDArray[np.int64] = own[:, None, :] + AROUND
        return points

    def walkable_around(self) -> Bools:
        """bool [A, 9]: which of `points_around` are walkable, or off the map."""
        return self.layout.off_or_walkable(self.points_around())

    def heights_around(self) -> Floats:
        """float32 [A, 9]: the heights of `points_around`: 0, as maps are flat, and 1 off the map."""
        return (~self.layout.on_map(self.points_around())).astype(np.float32)

    def _timestep(self) -> float:
        return self._steps / self._limit
