"""The `save_replay` of SMAC and EPyMARL."""

from __future__ import annotations

import time
from pathlib import Path

from .._native import Recorder


def save_replay(recorder: Recorder, folder: str, prefix: str) -> Path:
    """Write `<prefix>_<time>.smreplay` with the last episodes, where time is in ns, and return its path.

    Raises InvalidRequest before the first step.
    """
    path = Path(folder) / f"{prefix}_{time.time_ns()}.smreplay"
    path.parent.mkdir(parents=True, exist_ok=True)
    recorder.save(path)
    return path
