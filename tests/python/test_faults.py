"""A sample of the faults that `just faults` injects: every system call of a command fails once."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

import faults
from faults import Fault

pytestmark = [
    pytest.mark.skipif(not shutil.which("strace"), reason="strace is not installed"),
    pytest.mark.skipif(not faults.PROGRAM.exists(), reason="the program is not built"),
]


@pytest.fixture
def folder() -> Iterator[Path]:
    """With a path that is short enough for sockets."""
    with tempfile.TemporaryDirectory(prefix="faults") as name:
        yield Path(name) / "f"


@pytest.mark.parametrize("scenario", ["check", "record", "bench", "train"])
def test_commands_survive_faults(scenario: str, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    problems = faults.test(scenario, 12, folder)
    assert problems == 0, capfd.readouterr().out


def test_a_pool_whose_thread_is_refused_does_not_start(folder: Path) -> None:
    """It waited for itself without end."""
    for number in (1, 2):
        status, stderr = faults.run("bench", folder, Fault("clone3", "EAGAIN", number).options())
        assert status == 1 and "cannot start a worker thread: Resource temporarily" in stderr, stderr


def test_a_training_goes_on_with_the_threads_that_it_has(folder: Path) -> None:
    """The learner panicked."""
    status, stderr = faults.run("train", folder, Fault("clone3", "EAGAIN", 60).options())
    assert status == 0, stderr


def test_a_full_standard_error_ends_no_command() -> None:
    command = [str(faults.PROGRAM), "bench", "3m", "--seconds", "0.01"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=full, check=False)
    assert done.returncode == 0 and b"3m" in done.stdout
