"""What `save_replay` writes: one episode, step by step."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._native import Batch
from .errors import InvalidRequest


class Recording:
    """The episode so far."""

    def __init__(self, scenario: str, rules: str) -> None:
        self._about = {"scenario": scenario, "rules": rules}
        self._seed = 0
        self._actions: list[list[int]] = []
        self._rewards: list[float] = []
        self._states: list[NDArray[np.float32]] = []

    def begin(self, seed: int, first: Batch) -> None:
        """Forget the last episode."""
        self._seed = seed
        self._actions, self._rewards, self._states = [], [], [first.state[0].copy()]

    def add(self, actions: list[int], batch: Batch) -> None:
        """A step."""
        self._actions.append(actions)
        self._rewards.append(float(batch.reward[0]))
        self._states.append(batch.state[0].copy())

    def save(self, folder: Path, prefix: str) -> Path:
        """Write a file with a name of its own, `<prefix>_<time>.npz`, and return its path."""
        if not self._states:
            raise InvalidRequest("there is no episode to save; reset first")
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{prefix}_{time.time_ns()}.npz"
        arrays: dict[str, Any] = {
            "seed": self._seed,
            "actions": np.array(self._actions, np.int32),
            "rewards": np.array(self._rewards, np.float32),
            "states": np.array(self._states),
        }
        np.savez_compressed(path, **arrays, **self._about)  # type: ignore[arg-type]
        return path
