"""The units of a battle, decoded from the state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ._layout import Floats, ScenarioLayout
from .types import UnitType


class Position(NamedTuple):
    """A position on the map in squares; x grows east, y grows north."""

    x: float
    y: float


@dataclass(frozen=True)
class Unit:
    """A unit between two steps. A dead unit has health 0 and its last known position."""

    tag: int
    """Its id within its side."""
    owner: int
    """1 for units of the agents, 2 for enemies."""
    unit_type: int
    """Its index in the type one-hot; 0 if the scenario has none."""
    name: str
    """Name of its type, such as MARINE."""
    pos: Position
    health: float
    """0 to `health_max`, in points."""
    health_max: float
    shield: float
    """0 to `shield_max`, in points; 0 if the scenario hides shields."""
    shield_max: float
    energy: float
    """0 to `energy_max`, in points; 0 for enemies, as the state does not contain their energy."""
    energy_max: float
    weapon_cooldown: float
    """Seconds until it can act again; 0 for enemies, as the state does not contain their cooldown."""
    weapon_cooldown_max: float
    radius: float
    """In squares."""
    is_healer: bool


class UnitsView:
    """All units of a battle by id, allies first: positions in squares, health and shields in points."""

    def __init__(self, layout: ScenarioLayout) -> None:
        self._layout = layout
        n_units = layout.n_agents + layout.n_enemies
        self.stats: list[UnitType] = [*layout.allies, *layout.enemies]
        """Those of each unit. Where types are drawn, of a sample before the first state of an episode."""
        self.health_max: Floats
        self.shield_max: Floats
        self._measure()
        self._drawn: list[UnitType] = []
        """The types that can be drawn, by `type_id`."""
        if layout.info["teams_are_drawn"]:
            self._drawn = sorted(layout.info["unit_types"], key=lambda unit_type: unit_type["type_id"])
        self.positions: Floats = np.zeros((n_units, 2), np.float32)
        """float32 [A + E, 2]; the dead keep their last known position."""
        self.health: Floats = np.zeros(n_units, np.float32)
        """float32 [A + E]; 0 for the dead."""
        self.shield: Floats = np.zeros(n_units, np.float32)
        """float32 [A + E]; 0 for the dead and for sides whose shields the scenario hides."""
        self._energy_or_cooldown: Floats = np.zeros(layout.n_agents, np.float32)

    def _measure(self) -> None:
        self.health_max = np.array([unit["hp"] for unit in self.stats], np.float32)
        self.shield_max = np.array([unit["shield"] for unit in self.stats], np.float32)

    def update(self, state: Floats) -> None:
        """Decode a state, float32 [state_size]."""
        allies, enemies = self._layout.state.allies, self._layout.state.enemies

        def of_all(feature: str) -> Floats:
            return np.concatenate((allies.column(state, feature), enemies.column(state, feature)))

        if len(self._drawn) > 1:
            shown = np.stack([of_all(f"type_{index}") for index in range(len(self._drawn))], axis=-1)
            # The rows of the dead are zeros: they keep their types.
            for unit in np.flatnonzero(shown.any(axis=-1)).tolist():
                self.stats[unit] = self._drawn[int(shown[unit].argmax())]
            self._measure()
        self.health = of_all("health") * self.health_max
        self.shield = of_all("shield") * self.shield_max
        alive = self.health > 0
        self.positions[alive] = self._layout.squares(of_all("rel_x"), of_all("rel_y"))[alive]
        self._energy_or_cooldown = allies.column(state, "energy/cooldown")

    def unit(self, index: int) -> Unit:
        """The unit with that index: allies first, then enemies."""
        stats = self.stats[index]
        is_ally = index < self._layout.n_agents
        energy_or_cooldown = float(self._energy_or_cooldown[index]) if is_ally else 0.0
        return Unit(
            tag=index if is_ally else index - self._layout.n_agents,
            owner=1 if is_ally else 2,
            unit_type=stats["type_id"],
            name=stats["unit_type"],
            pos=Position(*self.positions[index].tolist()),
            health=float(self.health[index]),
            health_max=stats["hp"],
            shield=float(self.shield[index]),
            shield_max=stats["shield"],
            energy=energy_or_cooldown * stats["energy"] if stats["healer"] else 0.0,
            energy_max=stats["energy"],
            weapon_cooldown=0.0 if stats["healer"] else energy_or_cooldown * stats["max_cooldown"],
            weapon_cooldown_max=stats["max_cooldown"],
            radius=stats["radius"],
            is_healer=stats["healer"],
        )
