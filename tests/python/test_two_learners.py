"""The learner of docs/how-to/two-learners.md, whose processes and pool are killed while they learn.

A learner of one side lost its run with the process of the other one: nothing said what it must catch, that
the place of a killed process can still be taken, and that both sides can resume from different steps.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from conftest import Serve

PAGE = Path(__file__).resolve().parents[2] / "docs/how-to/two-learners.md"
POOL = ["3m:16", "--sides", "both", "--mirror", "--name", "arena"]


class Learners:
    """Starts `learner.py` of the page in a folder, with less patience."""

    def __init__(self, folder: Path, patience: int) -> None:
        [code] = re.findall(r"`learner\.py`:\n\n```python\n(.*?)^```", PAGE.read_text(), re.M | re.S)
        assert "PATIENCE = 60 " in code
        (folder / "learner.py").write_text(code.replace("PATIENCE = 60 ", f"PATIENCE = {patience} "))
        self.folder = folder
        self.started: list[subprocess.Popen[str]] = []

    def start(self, side: str, total: int) -> subprocess.Popen[str]:
        command = [sys.executable, "learner.py", side, str(total)]
        process = subprocess.Popen(command, cwd=self.folder, stdout=subprocess.PIPE, text=True)
        self.started.append(process)
        return process

    def steps(self, side: str) -> int:
        """The steps of the newest checkpoint."""
        file = self.folder / f"{side}.npz"
        if not file.exists():
            return 0
        with np.load(file) as saved:
            return int(saved["steps"])

    def wait_for(self, side: str, steps: int) -> None:
        while self.steps(side) < steps:
            assert all(process.poll() in (None, -9) for process in self.started), "a learner ended"
            time.sleep(0.02)

    def end(self) -> None:
        for process in self.started:
            process.kill()
            process.communicate()


@pytest.fixture
def learners(tmp_path: Path) -> Iterator[Learners]:
    started = Learners(tmp_path, patience=60)
    yield started
    started.end()


@pytest.mark.parametrize("side", ["allies", "enemies"])
def test_both_resume_when_one_is_killed(serve: Serve, learners: Learners, side: str) -> None:
    other_side = {"allies": "enemies", "enemies": "allies"}[side]
    serve(*POOL)
    other, killed = learners.start(other_side, 2000), learners.start(side, 2000)
    for steps in (200, 600):
        learners.wait_for(side, steps)
        killed.kill()
        killed.wait()
        before = learners.steps(side)
        # At once: its place may still be taken, as the other learner has not left the session yet.
        killed = learners.start(side, 2000)
        learners.wait_for(side, before + 100)
    killed.kill()
    killed.wait()
    printed = other.stdout
    assert printed is not None
    seen = [printed.readline() for _ in range(6)]
    assert seen[1::2] == [f"{other_side}: the other learner left\n"] * 3, seen
    resumed = [int(line.rsplit(" ", 1)[1]) for line in seen[::2]]
    assert 0 == resumed[0] < 200 <= resumed[1] < 600 <= resumed[2], resumed


def test_both_resume_when_the_pool_is_killed(serve: Serve, learners: Learners) -> None:
    pool = serve(*POOL)
    two = {side: learners.start(side, 800) for side in ("allies", "enemies")}
    learners.wait_for("allies", 200)
    pool.kill()
    pool.wait()
    serve(*POOL)
    for side, process in two.items():
        output, _ = process.communicate(timeout=100)
        assert process.returncode == 0
        lines = output.splitlines()
        assert lines[1] == f"{side}: the pool died" and lines[0] == f"{side}: from step 0"
        assert int(lines[2].removeprefix(f"{side}: from step ")) >= 180
        assert learners.steps(side) == 800


def test_who_is_ahead_ends_first(serve: Serve, tmp_path: Path) -> None:
    """Checkpoints of different steps: each learner counts its own, and the last one ends too."""
    learners = Learners(tmp_path, patience=3)
    serve(*POOL)
    try:
        ahead, behind = learners.start("allies", 200), learners.start("enemies", 400)
        first, _ = ahead.communicate(timeout=100)
        last, _ = behind.communicate(timeout=100)
    finally:
        learners.end()
    assert first == "allies: from step 0\n" and learners.steps("allies") == 200
    steps = learners.steps("enemies")
    assert last.splitlines() == [
        "enemies: from step 0",
        "enemies: the other learner left",
        f"enemies: from step {steps}",
        "enemies: the other learner did not come",
    ]
    assert steps in (180, 200) and (ahead.returncode, behind.returncode) == (0, 0)
