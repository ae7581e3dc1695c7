"""Which unit of a recording is which unit of an environment, and what all environments that play have in
common."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from .recordings import FIRST_TARGET, STOP, Battle, Course, course, species


class Role(NamedTuple):
    """A unit of the environment."""

    species: str
    health: float
    """Its maximum."""
    is_healer: bool


@dataclass(frozen=True)
class Cast:
    """Battles of a map and the units that play them: `copies` of each battle, one after the other."""

    course: Course
    copies: int
    roles: list[Role]
    """[U]: in the order of a snapshot's columns."""
    skipped: list[Battle]
    """Battles with other units."""

    def repeat(self, values: NDArray[Any]) -> NDArray[Any]:
        """What is said of battles, for all copies."""
        return np.repeat(values, self.copies, 0)

    def orders(self, t: int) -> NDArray[np.int32]:
        """The actions that a step has in the recordings, [B * copies, A]; after the last, agents stop."""
        actions = self.course.actions
        if t < actions.shape[1]:
            return self.repeat(actions[:, t])
        return np.full((len(actions) * self.copies, self.course.n_agents), STOP, np.int32)

    def attacks(self, actions: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Which of these actions are attacks."""
        healers = np.array([role.is_healer for role in self.roles[: self.course.n_agents]])
        return np.asarray((actions >= FIRST_TARGET) & ~healers)

    @property
    def kinds(self) -> list[tuple[str, str]]:
        """Side and type of each unit."""
        n_agents = self.course.n_agents
        return [("agents" if u < n_agents else "enemies", role.species) for u, role in enumerate(self.roles)]


class Moment(NamedTuple):
    """What is looked at of all environments between two steps."""

    places: NDArray[np.float32]
    alive: NDArray[np.bool_]
    target: NDArray[np.int32]
    cooldown: NDArray[np.float64]


class Player(Protocol):
    """Environments that play the battles of a cast, from the recorded starts."""

    cast: Cast
    goes_on: NDArray[np.bool_]
    """[B * copies]: those whose battles are not over. What is told of the others is the end of their
    battle."""

    def now(self) -> Moment: ...

    def step(self, t: int) -> NDArray[np.int32]:
        """Makes a step with the recorded orders; returns the actions."""

    def put(
        self,
        rows: NDArray[np.intp],
        places: NDArray[np.float64],
        alive: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.intp]:
        """Puts units of these environments to places, where these are known, and kills and revives; returns
        the environments whose battles go on now."""


def cast(battles: list[Battle], agents: list[Role], enemies: list[Role], copies: int) -> Cast:
    """The cast of those battles that have these units.

    Raises:
        ValueError: none has.
    """
    roles = [*agents, *enemies]
    assigned = [(each, columns_of(each, roles, len(agents))) for each in battles]
    fitting = [(each, columns) for each, columns in assigned if columns is not None]
    if not fitting:
        names = ", ".join(sorted({role.species for role in roles}))
        raise ValueError(f"no recorded battle has the units of the scenario ({len(roles)}: {names})")
    made = course([each for each, _ in fitting], [columns for _, columns in fitting], len(agents))
    return Cast(made, copies, roles, [each for each, columns in assigned if columns is None])


def columns_of(battle: Battle, roles: list[Role], n_agents: int) -> dict[int, int] | None:
    """The column of each unit: those of one type in the order of the recording. None if the types differ."""
    free: dict[tuple[bool, str], list[int]] = defaultdict(list)
    for column, role in enumerate(roles):
        free[column < n_agents, species(role.species)].append(column)
    found = {}
    for unit_id, each in enumerate(battle.units):
        left = free[each.is_agent, each.species]
        if not left:
            return None
        found[unit_id] = left.pop(0)
    return None if any(free.values()) else found
