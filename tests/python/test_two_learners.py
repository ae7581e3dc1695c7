"""The learners of docs/how-to/self-play.md, which and whose pool are killed while they learn."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from conftest import REPOSITORY, Serve, posix

pytestmark = posix  # the page's learners meet at a Unix socket

PAGE = REPOSITORY / "docs/how-to/self-play.md"
POOL = ["3m:16", "--sides", "mirrored", "--name", "arena"]


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
            process.wait()


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
        killed = learners.start(side, 2000)
        learners.wait_for(side, before + 100)
    other.kill()
    lines = other.communicate()[0].splitlines()
    left = f"{other_side}: the other learner left"
    resumed = [int(line.rsplit(" ", 1)[1]) for line in lines if line != left]
    # One may be an update behind the other, and meet a process that ends once more.
    assert lines.count(left) >= 2 and resumed == sorted(resumed) and resumed[0] == 0, lines
    assert any(180 <= step < 600 for step in resumed) and resumed[-1] >= 580, lines


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
        left = {"allies": "allies: the pool died", "enemies": "enemies: the other learner left"}
        assert lines[1] == left[side] and lines[0] == f"{side}: from step 0"
        assert int(lines[2].removeprefix(f"{side}: from step ")) >= 180
    # One of them may have saved an update that the other one lost, and then ends first.
    saved = sorted(learners.steps(side) for side in two)
    assert saved in ([780, 800], [800, 800])


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
    lines, left = last.splitlines(), "enemies: the other learner left"
    assert (lines[0], lines[-1]) == ("enemies: from step 0", "enemies: the other learner did not come")
    # It may connect once more to the process that ends.
    assert left in lines and set(lines[1:-1]) <= {left, "enemies: from step 200"}, lines
    assert learners.steps("enemies") == 200 and (ahead.returncode, behind.returncode) == (0, 0)
