"""SMAC's observation and state options: what the pool encodes, cut and added to."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from ._layout import Bools, Floats, Observation, ScenarioLayout, State
from ._smac_units import Field
from .errors import InvalidRequest

# Which squares `obs_pathing_grid` and `obs_terrain_height` look at, from the unit's own, in SMAC's order: two moves to
# the north, south, east, west, then one move along each diagonal; heights also look at one's own.
AROUND = np.array([(0, 4), (0, -4), (4, 0), (-4, 0), (2, 2), (-2, -2), (2, -2), (-2, 2), (0, 0)])
N_PATHING, N_HEIGHT = 8, 9


@dataclass(frozen=True)
class ViewOptions:
    """SMAC's observation and state options."""

    all_health: bool = True
    own_health: bool = True
    last_action: bool = False
    pathing_grid: bool = False
    terrain_height: bool = False
    timestep_number: bool = False
    instead_of_state: bool = False
    state_last_action: bool = True
    state_timestep_number: bool = False


class Views:
    """One battle as these options show it."""

    def __init__(self, scenario: str | PathLike[str], options: ViewOptions) -> None:
        self.layout = ScenarioLayout(scenario)
        self.field = Field(self.layout)
        self.options = options
        others = [
            [ally for ally in range(self.layout.n_agents) if ally != agent] for agent in range(self.layout.n_agents)
        ]
        self._others = np.array(others, np.intp).reshape(self.layout.n_agents, -1)
        self._limit = 0
        self._steps = 0
        self._obs: Observation
        self._state: State

    def count_steps_to(self, limit: int | None) -> None:
        """What timestep numbers are fractions of."""
        if limit is None and (self.options.timestep_number or self.options.state_timestep_number):
            raise InvalidRequest(
                "obs_timestep_number and state_timestep_number are fractions of the episode limit; set one"
            )
        self._limit = limit or 0

    def see(self, obs: Floats, state: Floats, steps: int) -> None:
        """Take in an observation [A, obs_size] and a state [state_size], which are then this object's."""
        self._obs, self._state, self._steps = self.layout.observation(obs), self.layout.state(state), steps
        self.field.see(self._state)

    @property
    def last_action(self) -> Floats:
        """[A, N]: the last action of each agent, one-hot; zeros after a reset."""
        return self._state.last_action

    def enemy_features(self) -> tuple[int, int]:
        """How many enemies an observation shows, and figures of each."""
        health = 1 + self.layout.shield_bits_enemy if self.options.all_health else 0
        return self.layout.n_enemies, 4 + health + self.layout.type_bits

    def ally_features(self, n_actions: int) -> tuple[int, int]:
        """How many allies an observation shows, and figures of each."""
        health = 1 + self.layout.shield_bits_ally if self.options.all_health else 0
        action = n_actions if self.options.last_action else 0
        return self.layout.n_agents - 1, 4 + health + self.layout.type_bits + action

    def own_features(self) -> int:
        """Figures of oneself in an observation."""
        health = 1 + self.layout.shield_bits_ally if self.options.own_health else 0
        return health + self.layout.type_bits + int(self.options.timestep_number)

    def move_features(self) -> int:
        """Figures of the ground around in an observation."""
        return 4 + N_PATHING * self.options.pathing_grid + N_HEIGHT * self.options.terrain_height

    def state_size(self, n_actions: int) -> int:
        """Figures of the state, unless it is the observations."""
        layout = self.layout
        units = layout.n_agents * (4 + layout.ally_tail) + layout.n_enemies * (3 + layout.enemy_tail)
        actions = layout.n_agents * n_actions if self.options.state_last_action else 0
        return units + actions + int(self.options.state_timestep_number)

    def observations(self) -> Floats:
        """[A, O]: what each agent sees."""
        obs, options, n_agents = self._obs, self.options, self.layout.n_agents
        alive = self.field.health[:n_agents] > 0
        parts: list[NDArray[np.float32 | np.bool_]] = [obs.moves]
        if options.pathing_grid:
            parts.append(self.walkable_around()[:, :N_PATHING] * alive[:, None])
        if options.terrain_height:
            parts.append(self.heights_around() * alive[:, None])
        enemies, allies, own = obs.enemies, obs.allies, obs.own
        if not options.all_health:
            enemies = np.delete(enemies, slice(4, 5 + self.layout.shield_bits_enemy), axis=2)
            allies = np.delete(allies, slice(4, 5 + self.layout.shield_bits_ally), axis=2)
        if options.last_action:
            theirs = self.last_action[self._others] * allies[:, :, :1]
            allies = np.concatenate((allies, theirs), axis=2)
        if not options.own_health:
            own = own[:, 1 + self.layout.shield_bits_ally :]
        parts += [enemies.reshape(n_agents, -1), allies.reshape(n_agents, -1), own]
        if options.timestep_number:
            parts.append(np.full((n_agents, 1), self._timestep()))
        return np.concatenate(parts, axis=1, dtype=np.float32)

    def state(self) -> Floats:
        """[S]: the state."""
        if self.options.instead_of_state:
            return self.observations().reshape(-1)
        return np.concatenate([np.ravel(part) for part in self.state_dict().values()], dtype=np.float32)

    def state_dict(self) -> dict[str, Floats]:
        """The state by what it speaks of, in the order of its figures."""
        parts = {"allies": self._state.allies.copy(), "enemies": self._state.enemies.copy()}
        if self.options.state_last_action:
            parts["last_action"] = self.last_action.copy()
        if self.options.state_timestep_number:
            parts["timestep"] = np.array(self._timestep(), np.float32)
        return parts

    def visibility(self) -> Bools:
        """[A, A + E]: which units each agent sees; not itself."""
        n_agents = self.layout.n_agents
        seen = np.zeros((n_agents, n_agents + self.layout.n_enemies), np.bool_)
        np.put_along_axis(seen, self._others, self._obs.allies[:, :, 0] > 0, axis=1)
        seen[:, n_agents:] = self._obs.enemies[:, :, 4] > 0  # who is seen lives
        return seen

    def points_around(self) -> NDArray[np.int64]:
        """[A, 9, 2]: the squares around each agent, and its own."""
        own = np.floor(self.field.positions[: self.layout.n_agents]).astype(np.int64)
        points: NDArray[np.int64] = own[:, None, :] + AROUND
        return points

    def walkable_around(self) -> Bools:
        """[A, 9]: which of `points_around` are walkable, or off the map."""
        return self.layout.off_or_walkable(self.points_around())

    def heights_around(self) -> Floats:
        """[A, 9]: the heights of `points_around`: the maps are flat, and what is off them counts as 1."""
        return (~self.layout.on_map(self.points_around())).astype(np.float32)

    def _timestep(self) -> float:
        return self._steps / self._limit
