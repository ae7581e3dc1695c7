"""Where each figure lies in the observations and the state of a scenario, and what stands on its map."""

from __future__ import annotations

from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._native import scenario

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]

MOVES = 4  # is a move north, south, east, west possible
SIGHT = 9.0  # how far agents see, in squares
REACH = 6.0  # how far agents may choose targets, in squares


class Observation(NamedTuple):
    """Views into observations [..., A, obs_size], by what they speak of."""

    moves: Floats
    """[..., A, 4]: is a move north, south, east, west possible."""
    enemies: Floats
    """[..., A, E, 4 + health, shield, type]: targetable, distance/9, dx/9, dy/9, ..."""
    allies: Floats
    """[..., A, A - 1, 4 + health, shield, type]: seen, distance/9, dx/9, dy/9, ..., oneself left out."""
    own: Floats
    """[..., A, health, shield, type]."""


class State(NamedTuple):
    """Views into states [..., state_size], by what they speak of."""

    allies: Floats
    """[..., A, 4 + shield, type]: health, energy or cooldown, x, y, ..."""
    enemies: Floats
    """[..., E, 3 + shield, type]: health, x, y, ..."""
    last_action: Floats
    """[..., A, N]: the last action of each agent, one-hot."""


class ScenarioLayout:
    """The figures of a scenario that observations and state are made of.

    `name` is a standard scenario or a path, as `smaclite_pool.make` takes it.
    """

    def __init__(self, name: str | PathLike[str]) -> None:
        self.info: dict[str, Any] = scenario(name)
        self.ally_figures: list[dict[str, Any]] = self.info["allies"]
        self.enemy_figures: list[dict[str, Any]] = self.info["enemies"]
        self.n_agents = len(self.ally_figures)
        self.n_enemies = len(self.enemy_figures)
        self.type_bits: int = self.info["num_unit_types"]
        self.shield_bits_ally = int(self.info["ally_has_shields"])
        self.shield_bits_enemy = int(self.info["enemy_has_shields"])
        self.map_size = np.array([self.info["width"], self.info["height"]], np.float32)
        self.walkable: Bools = np.array(self.info["walkable"], np.bool_)
        """[height, width]: `walkable[y, x]`, the southern row first."""

    @property
    def ally_tail(self) -> int:
        """Figures of an ally's shield and type."""
        return self.shield_bits_ally + self.type_bits

    @property
    def enemy_tail(self) -> int:
        """Figures of an enemy's shield and type."""
        return self.shield_bits_enemy + self.type_bits

    def observation(self, obs: Floats) -> Observation:
        """The parts of observations [..., A, obs_size], in place."""
        ally, enemy = 5 + self.ally_tail, 5 + self.enemy_tail
        enemies_end = MOVES + self.n_enemies * enemy
        allies_end = enemies_end + (self.n_agents - 1) * ally
        return Observation(
            obs[..., :MOVES],
            obs[..., MOVES:enemies_end].reshape(*obs.shape[:-1], self.n_enemies, enemy),
            obs[..., enemies_end:allies_end].reshape(*obs.shape[:-1], self.n_agents - 1, ally),
            obs[..., allies_end:],
        )

    def state(self, state: Floats) -> State:
        """The parts of states [..., state_size], in place."""
        ally, enemy = 4 + self.ally_tail, 3 + self.enemy_tail
        allies_end = self.n_agents * ally
        enemies_end = allies_end + self.n_enemies * enemy
        return State(
            state[..., :allies_end].reshape(*state.shape[:-1], self.n_agents, ally),
            state[..., allies_end:enemies_end].reshape(*state.shape[:-1], self.n_enemies, enemy),
            state[..., enemies_end:].reshape(*state.shape[:-1], self.n_agents, -1),
        )

    def squares(self, position: Floats) -> Floats:
        """Positions [..., 2] as the state has them, in squares.

        The state's figures are rounded, so a position may be off by a millionth of a square.
        """
        squares: Floats = position * self.map_size + self.map_size / np.float32(2)
        return squares

    def tail_names(self, shield_bits: int) -> list[str]:
        """Names of the figures of a shield and a type."""
        return ["shield"] * shield_bits + [f"type_{bit}" for bit in range(self.type_bits)]

    def on_map(self, points: NDArray[np.int64]) -> Bools:
        """[...]: do points [..., 2] lie on the map."""
        inside: Bools = np.all((points >= 0) & (points < self.map_size), axis=-1)
        return inside

    def off_or_walkable(self, points: NDArray[np.int64]) -> Bools:
        """[...]: are points [..., 2] walkable squares, or off the map."""
        inside = self.on_map(points)
        x, y = np.where(inside, points[..., 0], 0), np.where(inside, points[..., 1], 0)
        walkable: Bools = ~inside | self.walkable[y, x]
        return walkable
