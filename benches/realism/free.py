"""Plays recorded battles from their starts to their ends, with the recorded orders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cast import Cast, Moment, Player
from .recordings import LOOPS

STEPS_AFTER = 8
"""Steps that are played after the end of the longest battle of the map."""

SECONDS_PER_STEP = 0.5


@dataclass(frozen=True)
class Played:
    """What came of it: B battles, S copies of each, T steps, U units."""

    died: NDArray[np.float64]
    """[B, S, U]: loop after the step in which it died; NaN if it lives."""
    killers: NDArray[np.float32]
    """[B, S, U, U]: by victim, the share of each unit in its death, as far as it is known; they sum to 1 or
    0."""
    ended: NDArray[np.float64]
    """[B, S]: loop after the step in which a side was dead; that of the last step if none was."""
    places: NDArray[np.float32]
    """[B, S, T + 1, U, 2]: positions before each step, and after the last."""
    alive: NDArray[np.bool_]
    """[B, S, T + 1, U]."""
    fired: NDArray[np.bool_]
    """[B, S, T]: whether an agent had the order to attack, and could follow it."""


def play(player: Player) -> Played:
    """Plays all battles to their ends."""
    now = player.now()
    record = Record(player.cast, now)
    for t in range(record.steps):
        on, before = player.goes_on, now
        if not on.any():
            break
        actions = player.step(t)
        now = player.now()
        record.add(t, on, before, now, player.cast.attacks(actions).any(axis=1))
        record.ended[on & ~player.goes_on] = LOOPS * (t + 1)
    return record.played()


class Record:
    """What is kept of the battles while they are played."""

    def __init__(self, cast: Cast, now: Moment) -> None:
        self.cast = cast
        self.steps = cast.course.actions.shape[1] + STEPS_AFTER
        count, n_units = now.alive.shape
        self.died = np.full((count, n_units), np.nan)
        self.killers = np.zeros((count, n_units, n_units), np.float32)
        self.ended = np.full(count, float(LOOPS * self.steps))
        self.places = np.full((count, self.steps + 1, n_units, 2), np.nan, np.float32)
        self.alive = np.zeros((count, self.steps + 1, n_units), bool)
        self.fired = np.zeros((count, self.steps), bool)
        self.places[:, 0], self.alive[:, 0] = now.places, now.alive

    def add(self, t: int, on: NDArray[np.bool_], before: Moment, now: Moment, fired: Any) -> None:
        """A step of the battles that are on."""
        dead = on[:, None] & before.alive & ~now.alive
        self.died[dead] = LOOPS * (t + 1)
        rows = np.flatnonzero(dead.any(1))
        self.killers[rows] += blame(before, now, rows, self.cast.course.n_agents) * dead[rows, :, None]
        self.places[on, t + 1], self.alive[on, t + 1] = now.places[on], now.alive[on]
        self.fired[on, t] = fired[on]

    def played(self) -> Played:
        def by_battle(values: NDArray[Any]) -> NDArray[Any]:
            return values.reshape(-1, self.cast.copies, *values.shape[1:])

        columns = self.died, self.killers, self.ended, self.places, self.alive, self.fired
        return Played(*map(by_battle, columns))


def blame(before: Moment, now: Moment, rows: NDArray[np.intp], n_agents: int) -> NDArray[np.float32]:
    """Who may have killed each unit in a step, [rows, victim, killer]: equal shares of those of the other
    side that had it for a target and fired; or, if none fired, that had it for a target."""
    n_units = now.alive.shape[1]
    is_enemy = np.arange(n_units) >= n_agents
    units = np.arange(n_units)[None, :, None]
    aimed = (before.target[rows][:, None, :] == units) | (now.target[rows][:, None, :] == units)
    aimed &= before.alive[rows][:, None, :] & (is_enemy[:, None] != is_enemy)
    after = now.cooldown[rows]
    fired = (after > 0) & (after > before.cooldown[rows] - SECONDS_PER_STEP + 1e-3)
    sure = aimed & fired[:, None, :]
    shares = np.where(sure.any(2, keepdims=True), sure, aimed).astype(np.float32)
    return np.asarray(shares / np.maximum(shares.sum(2, keepdims=True), 1), np.float32)
