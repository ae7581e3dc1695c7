"""The file that `save_replay` writes: one episode, step by step."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InvalidRequest
from ...integrations._common import TimeStep


class Recording:
    """The current episode up to the last step."""

    def __init__(self, scenario: str, rules: str) -> None:
        self._about = {"scenario": scenario, "rules": rules}
        self._seed = 0
        self._actions: list[list[int]] = []
        self._rewards: list[float] = []
        self._states: list[NDArray[np.float32]] = []

    def begin(self, seed: int, first: TimeStep) -> None:
        """Forget the last episode and begin one with this state."""
        self._seed = seed
        self._actions, self._rewards, self._states = [], [], [first.state]

    def add(self, actions: list[int], now: TimeStep) -> None:
        """Add a step."""
        self._actions.append(actions)
        self._rewards.append(now.reward)
        self._states.append(now.state)

    def save(self, folder: Path, prefix: str) -> Path:
        """Write `<prefix>_<time>.npz`, where time is in ns, and return its path.

        Raises InvalidRequest before the first reset.
        """
        if not self._states:
            raise InvalidRequest("no episode to save; call reset first")
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
