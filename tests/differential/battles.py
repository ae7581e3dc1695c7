"""What both sides of a comparison are played through, and smaclite_pool's side of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
import smaclite_pool as sp
from numpy.typing import NDArray

from .scenarios import ScenarioFiles


class Frame(NamedTuple):
    """What a learner sees after a reset or a step."""

    obs: NDArray[np.float32]
    state: NDArray[np.float32]
    avail_actions: NDArray[np.bool_]
    reward: NDArray[np.float32]
    terminated: NDArray[np.bool_]
    battle_won: NDArray[np.bool_]


class Battle(Protocol):
    """One episode of one scenario."""

    def reset(self) -> Frame: ...
    def step(self, actions: list[int]) -> Frame: ...
    def close(self) -> None: ...


class OpenBattle(Protocol):
    """Opens a battle of the scenario whose file was written to `path`."""

    def __call__(self, files: ScenarioFiles, path: Path, seed: int) -> Battle: ...


class PublishedFailure(Exception):
    """The published environment stopped with a known error, which our engine leaves out on purpose."""


class PoolBattle:
    """A battle in a pool of one environment: standard scenarios by name, others by file."""

    def __init__(self, files: ScenarioFiles, path: Path, seed: int) -> None:
        scenario: Any = files.name if files.standard else path
        self.envs = sp.make(scenario, num_envs=1, threads=1, episode_limit=None)
        self.seed = seed

    def reset(self) -> Frame:
        return self.frame(self.envs.reset(seed=self.seed))

    def step(self, actions: list[int]) -> Frame:
        return self.frame(self.envs.step(np.array([actions], np.int32)))

    def close(self) -> None:
        self.envs.close()

    @staticmethod
    def frame(batch: sp.Batch) -> Frame:
        fields = (getattr(batch, name)[0] for name in Frame._fields)
        return Frame(*(np.array(field) for field in fields))  # copies: a lane lends few batches at a time


def difference(published: Frame, ours: Frame) -> str | None:
    """The first field that is not equal to the bit, and where in it."""
    for name, expected, found in zip(Frame._fields, published, ours, strict=True):
        if (expected.dtype, expected.shape) != (found.dtype, found.shape):
            return f"{name}: published {expected.dtype} {expected.shape}, ours {found.dtype} {found.shape}"
        bits = np.dtype(f"u{expected.itemsize}")
        unequal = np.argwhere(np.atleast_1d(expected).view(bits) != np.atleast_1d(found).view(bits))
        if len(unequal):
            index = tuple(int(i) for i in unequal[0])
            values = f"published {np.atleast_1d(expected)[index]!s}, ours {np.atleast_1d(found)[index]!s}"
            where = f"{name}{list(index)}" if expected.ndim else name
            more = f" ({len(unequal)} of {expected.size} values differ)" if len(unequal) > 1 else ""
            return f"{where}: {values}{more}"
    return None
