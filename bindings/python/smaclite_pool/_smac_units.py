"""The units of a battle as SMAC's users look at them, and SMAC's non-learning player."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._layout import Floats, ScenarioLayout, State

NO_OP, STOP, NORTH, SOUTH, EAST, WEST, FIRST_TARGET = range(7)


class Position(NamedTuple):
    """A place on the map in squares; x grows east, y grows north."""

    x: float
    y: float


@dataclass(frozen=True)
class Unit:
    """A unit between two steps. Health 0 is dead: then the position is where it was last seen alive."""

    tag: int
    """Its id within its side."""
    owner: int
    """1: an agent's. 2: an enemy."""
    unit_type: int
    """Its place in the type one-hot; 0 where there is none."""
    name: str
    """Its type's name, such as MARINE."""
    pos: Position
    health: float
    health_max: float
    shield: float
    """0 where the scenario hides shields."""
    shield_max: float
    energy: float
    """0 for enemies, whose energy nobody sees."""
    energy_max: float
    weapon_cooldown: float
    """Seconds until it may act again; 0 for enemies, whose cooldown nobody sees."""
    weapon_cooldown_max: float
    radius: float
    """In squares."""
    is_healer: bool


class Field:
    """Where everyone stands and how they are: the state in points and squares."""

    def __init__(self, layout: ScenarioLayout) -> None:
        self._layout = layout
        self._figures = layout.ally_figures + layout.enemy_figures
        self.health_max = np.array([unit["hp"] for unit in self._figures], np.float32)
        self.shield_max = np.array([unit["shield"] for unit in self._figures], np.float32)
        n_units = len(self._figures)
        self.positions: Floats = np.zeros((n_units, 2), np.float32)
        self.health: Floats = np.zeros(n_units, np.float32)
        self.shield: Floats = np.zeros(n_units, np.float32)
        self._ally_state: Floats = np.zeros((layout.n_agents, 4 + layout.ally_tail), np.float32)

    def see(self, state: State) -> None:
        """Take in a state."""
        layout, allies, enemies = self._layout, state.allies, state.enemies
        self._ally_state = allies
        self.health = np.concatenate((allies[:, 0], enemies[:, 0])) * self.health_max
        alive = self.health > 0
        places = layout.squares(np.concatenate((allies[:, 2:4], enemies[:, 1:3])))
        self.positions[alive] = places[alive]
        no_shield = np.float32(0)
        ally_shield = allies[:, 4] if layout.shield_bits_ally else np.broadcast_to(no_shield, layout.n_agents)
        enemy_shield = enemies[:, 3] if layout.shield_bits_enemy else np.broadcast_to(no_shield, layout.n_enemies)
        self.shield = np.concatenate((ally_shield, enemy_shield)) * self.shield_max

    def unit(self, index: int) -> Unit:
        """The unit of that battle-wide place: allies first, then enemies."""
        figures: dict[str, Any] = self._figures[index]
        is_ally = index < self._layout.n_agents
        second = float(self._ally_state[index, 1]) if is_ally else 0.0  # energy of healers, cooldown of others
        return Unit(
            tag=index if is_ally else index - self._layout.n_agents,
            owner=1 if is_ally else 2,
            unit_type=figures["type_id"],
            name=figures["unit_type"],
            pos=Position(*self.positions[index].tolist()),
            health=float(self.health[index]),
            health_max=figures["hp"],
            shield=float(self.shield[index]),
            shield_max=figures["shield"],
            energy=second * figures["energy"] if figures["healer"] else 0.0,
            energy_max=figures["energy"],
            weapon_cooldown=0.0 if figures["healer"] else second * figures["cooldown"],
            weapon_cooldown_max=figures["cooldown"],
            radius=figures["radius"],
            is_healer=figures["healer"],
        )


class Heuristic:
    """SMAC's non-learning player: attack the nearest enemy, heal the nearest hurt ally, walk there if it is too far.

    A target is kept until it is dead, or healed.
    """

    def __init__(self, layout: ScenarioLayout) -> None:
        self._n_agents = layout.n_agents
        self._healers = np.array([unit["healer"] for unit in layout.ally_figures])
        planes = [[enemy["plane"] in ally["targets"] for enemy in layout.enemy_figures] for ally in layout.ally_figures]
        self._can_hit = np.array(planes)
        self._targets: list[int | None] = [None] * layout.n_agents

    def forget(self) -> None:
        """A new episode begins."""
        self._targets = [None] * self._n_agents

    def actions(self, field: Field, available: NDArray[np.bool_]) -> list[int]:
        """An available action for each agent, by `available` [A, N]."""
        return [self._action(agent, field, row) for agent, row in enumerate(available)]

    def _action(self, agent: int, field: Field, available: NDArray[np.bool_]) -> int:
        if available[NO_OP]:
            return NO_OP
        heals = bool(self._healers[agent])
        side = slice(0, self._n_agents) if heals else slice(self._n_agents, None)
        hurt = field.health[side] < field.health_max[side]
        wanted = (field.health[side] > 0) & (hurt & ~self._healers if heals else self._can_hit[agent])
        target = self._targets[agent]
        away = field.positions[side] - field.positions[agent]
        if target is None or not wanted[target]:
            distance = np.where(wanted, np.hypot(away[:, 0], away[:, 1]), np.inf)
            target = int(distance.argmin()) if wanted.any() else None
            self._targets[agent] = target
        if target is None:
            return STOP
        if available[FIRST_TARGET + target]:
            return FIRST_TARGET + target
        east, north = away[target].tolist()
        along_x = EAST if east > 0 else WEST
        along_y = NORTH if north > 0 else SOUTH
        move = along_x if abs(east) > abs(north) else along_y
        return move if available[move] else STOP
