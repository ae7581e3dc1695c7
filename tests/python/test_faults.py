"""A sample of the faults that `just faults` injects: every system call of a command fails once."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from conftest import linux
from faults import scenarios
from faults.injection import PROGRAM, Fault
from faults.neighbour import Neighbour

pytestmark = [
    linux,
    pytest.mark.skipif(not shutil.which("strace"), reason="strace is not installed"),
    pytest.mark.skipif(not PROGRAM.exists(), reason="the program is not built"),
]


@pytest.fixture
def folder() -> Iterator[Path]:
    """With a path that is short enough for sockets."""
    with tempfile.TemporaryDirectory(prefix="faults") as name:
        yield Path(name)


@pytest.mark.parametrize(
    "scenario", ["check", "record", "bench", "train", "serve", "edit", "learner", "watch"]
)
def test_commands_survive_faults(scenario: str, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    problems = scenarios.test(scenario, 10, folder)
    assert problems == 0, capfd.readouterr().out


def test_a_replay_that_is_not_whole_is_noticed(folder: Path) -> None:
    (folder / "a.smreplay").write_bytes(b"SMREPLAY")
    assert "replay" in str(scenarios.check_replay(folder))


def test_a_neighbour_that_is_disturbed_is_noticed(folder: Path) -> None:
    """So that the tests above can fail."""
    neighbour = Neighbour(folder / "pools")
    try:
        assert neighbour.wrong() is None
        neighbour.pool.kill()
        assert neighbour.wrong()
    finally:
        assert "exit status -9" in str(neighbour.close())
        # What a killed pool leaves in /dev/shm would have no owner any more without this folder.
        environment = {**os.environ, "SMACLITE_POOL_ROOT": str(folder / "pools")}
        subprocess.run([str(PROGRAM), "clean"], env=environment, check=True)


def test_a_pool_whose_thread_is_refused_does_not_start(folder: Path) -> None:
    """It waited for itself without end."""
    for number in (1, 2):
        with scenarios.stage("bench", folder) as stage:
            end = stage.run(Fault("clone3", "EAGAIN", number).options())
        assert end.status == 1 and "cannot start a worker thread: Resource temporarily" in end.stderr


def test_a_training_goes_on_with_the_threads_that_it_has(folder: Path) -> None:
    """The learner panicked."""
    with scenarios.stage("train", folder) as stage:
        end = stage.run(Fault("clone3", "EAGAIN", 60).options())
    assert end.status == 0, end.stderr


def test_a_full_standard_output_is_named() -> None:
    """The message was of a device, and did not say which file is on it."""
    with open("/dev/full", "w") as full:
        done = subprocess.run([str(PROGRAM), "scenarios"], stdout=full, stderr=subprocess.PIPE, check=False)
    assert done.returncode == 1
    assert done.stderr == b"smaclite-pool: standard output: No space left on device\n"


def test_a_full_standard_error_ends_no_command() -> None:
    command = [str(PROGRAM), "bench", "3m", "--seconds", "0.01"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=full, check=False)
    assert done.returncode == 0 and b"3m" in done.stdout
