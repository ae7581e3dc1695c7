"""Plays recorded battles by the public interface of the package: snapshots that are edited, restored and
stepped."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import smaclite_pool as sp
from numpy.typing import NDArray

from .cast import Cast, Moment, Role, cast
from .columns import Columns
from .recordings import STOP, Battle, species

EPISODE_LIMIT = 1000
"""Steps: longer than all recordings, as their ends are compared."""

HEALTH_OF_REVIVED = 0.5
"""Of the type's maximum: of a unit that died here, and lives in the recording, no more is known."""

SEED = 100


@dataclass(frozen=True)
class Setting:
    """What battles are played with."""

    rules: str
    scenario: str
    """Of the map: its name or a file."""
    threads: int | None = None

    def options(self) -> dict[str, Any]:
        return {"rules": self.rules, "threads": self.threads}


@contextmanager
def opened(battles: list[Battle], setting: Setting, copies: int) -> Iterator[PoolPlayer]:
    """Makes the environments, and puts all battles to their starts.

    Raises:
        ValueError: no battle has the units of the scenario.
    """
    about = sp.scenario(setting.scenario)
    agents, enemies = (
        [Role(species(unit["unit_type"]), unit["hp"], unit["healer"]) for unit in side]
        for side in (about["allies"], about["enemies"])
    )
    made = cast(battles, agents, enemies, copies)
    fields: Any = {"fields": ["avail_actions", "snapshot"], "episode_limit": EPISODE_LIMIT}
    count = len(made.course.battles) * copies
    with sp.make(setting.scenario, count, **fields, **setting.options()) as envs:
        yield PoolPlayer(made, envs)


class PoolPlayer:
    """A `Player`."""

    def __init__(self, of: Cast, envs: sp.Envs) -> None:
        self.cast, self.envs = of, envs
        snapshot = envs.reset(seed=SEED).snapshot[0].copy()
        self.columns = Columns(snapshot)
        begin = np.stack([self.started(snapshot, places) for places in of.course.starts])
        batch = envs.reset(seed=SEED, snapshots=of.repeat(begin))
        self.snapshots, self.avail = batch.snapshot.copy(), batch.avail_actions
        self.goes_on = np.ones(len(batch), bool)

    def started(self, snapshot: NDArray[np.uint8], places: NDArray[np.float64]) -> NDArray[np.uint8]:
        columns = sp.snapshot_columns(snapshot)
        columns["pos"][:] = places
        return sp.pack_snapshot(columns, self.envs)

    def now(self) -> Moment:
        names = ("pos", "alive", "target", "cooldown")
        return Moment(*(self.columns.read(self.snapshots, name) for name in names))

    def step(self, t: int) -> NDArray[np.int32]:
        actions = accepted(self.cast.orders(t), self.avail)
        batch = self.envs.step(actions)
        self.avail = batch.avail_actions
        self.snapshots[self.goes_on] = batch.snapshot[self.goes_on]
        self.goes_on = self.goes_on & ~(batch.terminated | batch.truncated)
        return actions

    def put(
        self,
        rows: NDArray[np.intp],
        places: NDArray[np.float64],
        alive: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.intp]:
        if alive is not None:
            n_agents = self.cast.course.n_agents
            both = alive[:, :n_agents].any(1) & alive[:, n_agents:].any(1)
            rows, places, alive = rows[both], places[both], alive[both]
        if not len(rows):
            return rows
        snapshots, columns = self.snapshots[rows], self.columns
        if alive is not None:
            for i in np.flatnonzero((columns.read(snapshots, "alive") != alive).any(1)):
                snapshots[i] = self.with_living(snapshots[i], alive[i])
        known = ~np.isnan(places) & columns.read(snapshots, "alive")[..., None]
        columns.write(snapshots, "pos", np.where(known, places, columns.read(snapshots, "pos")))
        batch = self.envs.reset(env_id=rows.astype(np.int32), snapshots=snapshots)
        self.snapshots[rows], self.avail = batch.snapshot[rows], batch.avail_actions
        self.goes_on[rows] = True
        return rows

    def with_living(self, snapshot: NDArray[np.uint8], alive: NDArray[np.bool_]) -> NDArray[np.uint8]:
        columns = sp.snapshot_columns(snapshot)
        revived, killed = alive & ~columns["alive"], ~alive & columns["alive"]
        health = np.array([role.health for role in self.cast.roles])
        columns["hp"][revived] = HEALTH_OF_REVIVED * health[revived]
        columns["hp"][killed] = 0
        columns["alive"][:] = alive
        return sp.pack_snapshot(columns, self.envs)


def accepted(wanted: NDArray[np.int32], avail: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Actions, with stop for those that the mask refuses; to the dead, no-op alone is available."""
    allowed = np.take_along_axis(avail, wanted[..., None], 2)[..., 0]
    instead = np.where(avail[..., STOP], STOP, avail.argmax(-1))
    return np.where(allowed, wanted, instead).astype(np.int32)
