"""Plays recorded battles that are put back to what is recorded every so often, and compares how units walk.

What is not recorded (health, cooldowns, units that are not seen at that loop) stays as it is in the
environment. Positions do not drift far from the recorded ones, so errors are those of a few steps."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .cast import Cast, Player
from .recordings import LOOPS

HORIZONS = (1, 4, 16)
"""Steps after which positions are compared."""

PHASES = 4
"""Copies of each battle, which are put back at different steps."""


class Pairs(NamedTuple):
    """Units that were seen twice."""

    battle: NDArray[np.intp]
    error: NDArray[np.float64]
    """Between the second place and ours, in squares."""
    real: NDArray[np.float64]
    """Distance of the two places."""
    ours: NDArray[np.float64]

    def far(self) -> NDArray[np.bool_]:
        """Those that walk about as far as units of the type can: without obstacles."""
        return np.asarray(self.real > 0.9 * np.quantile(self.real, 0.9))


Walks = dict[tuple[str, str, int], Pairs]
"""By side, type and steps between the two places."""


def walk(player: Player) -> Walks:
    """One step of agents that walk, put to where they are recorded before every step. There is one copy."""
    recorded, seen = player.cast.course, Seen(player.cast)
    n_agents = recorded.n_agents
    for t in range(recorded.actions.shape[1]):
        if t:
            places = recorded.places[:, t].copy()
            places[:, n_agents:] = np.nan
            rows = np.flatnonzero(player.goes_on)
            player.put(rows, places[rows])
        before, on = player.now(), player.goes_on
        player.step(t)
        now = player.now()
        walking = now.alive & on[:, None]
        walking[:, n_agents:] = False
        walking[:, :n_agents] &= recorded.moves[:, t]
        seen.add(t, 1, walking, before.places, now.places)
    return seen.walks()


def drift(player: Player) -> Walks:
    """All units 1, 4 and 16 steps after places and deaths were put back. There are `PHASES` copies."""
    cast, recorded, seen = player.cast, player.cast.course, Seen(player.cast)
    length, period = cast.repeat(recorded.length), max(HORIZONS)
    phase = np.arange(len(length)) % cast.copies * (period // cast.copies)
    since = np.full(len(length), -1)  # the step before which it was put back
    begin = player.now().places
    for t in range(recorded.actions.shape[1]):
        rows = np.flatnonzero((t % period == phase) & (t < length))
        rows = player.put(rows, cast.repeat(recorded.stood[:, t])[rows], lives(cast, t)[rows])
        since[rows] = t
        begin[rows] = player.now().places[rows]
        on = player.goes_on
        player.step(t)
        now = player.now()
        for steps in HORIZONS:
            at = t + 1 - steps
            if at >= 0:
                seen.add(at, steps, (on & (since == at))[:, None] & now.alive, begin, now.places)
    return seen.walks()


def lives(cast: Cast, t: int) -> NDArray[np.bool_]:
    """Which units live before a step in the recordings, [B * copies, U]."""
    died = cast.course.died
    return cast.repeat(np.isnan(died) | (died > LOOPS * t))


class Seen:
    """Collects pairs of places."""

    def __init__(self, cast: Cast) -> None:
        self.cast = cast
        self.parts: list[tuple[NDArray[Any], ...]] = []

    def add(
        self,
        t: int,
        steps: int,
        chosen: NDArray[np.bool_],
        before: NDArray[np.float32],
        after: NDArray[np.float32],
    ) -> None:
        """Of the chosen units, [B * copies, U], those that are recorded before step t and so many steps
        later."""
        begin = self.cast.repeat(self.cast.course.places[:, t])
        end = self.cast.repeat(self.cast.course.places[:, t + steps])
        row, unit = np.nonzero(chosen & ~np.isnan(begin[..., 0]) & ~np.isnan(end[..., 0]))
        real = (end - begin)[row, unit]
        ours = (after.astype(float) - before)[row, unit]
        lengths = (np.hypot(*each.T) for each in (real - ours, real, ours))
        self.parts.append((row // self.cast.copies, unit, np.full(len(row), steps), *lengths))

    def walks(self) -> Walks:
        battle, unit, steps, *distances = (np.concatenate(part) for part in zip(*self.parts, strict=True))
        found = {}
        for side, name in sorted(set(self.cast.kinds)):
            of_kind = np.array([kind == (side, name) for kind in self.cast.kinds])[unit.astype(int)]
            for number in HORIZONS:
                here = of_kind & (steps == number)
                if here.any():
                    found[side, name, number] = Pairs(battle[here], *(each[here] for each in distances))
        return found
