"""A supervisor that is stopped (SIGSTOP) delays no interrupt and no exit; a forked child exits at once."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import smaclite_pool as sp

from conftest import Serve, run_script, stop


class AlarmError(Exception):
    """Raised by a signal handler."""


def raise_alarm(*_: object) -> None:
    raise AlarmError


def test_a_late_answer_to_a_recorder_is_not_taken_for_the_next_one(serve: Serve) -> None:
    """`n_complete` hid that nothing was received, and each later call got the answer of the one before."""
    server = serve("3m:1", "--name", "train")
    with sp.connect("train") as envs, sp.Recorder("train") as recorder:
        envs.reset(seed=1)
        for _ in range(100):
            envs.step(envs.sample_actions())
        before = recorder.n_complete
        stop(server)
        previous = signal.signal(signal.SIGALRM, raise_alarm)
        for _ in range(2):
            signal.setitimer(signal.ITIMER_REAL, 0.3)
            with pytest.raises(AlarmError):
                _ = recorder.n_complete
        signal.signal(signal.SIGALRM, previous)
        server.send_signal(signal.SIGCONT)
        for _ in range(400):
            envs.step(envs.sample_actions())
        after = recorder.n_complete
        assert after > before
        assert [recorder.n_complete, recorder.n_complete] == [after, after]


@pytest.mark.parametrize("call", ["Recorder", "Spectator"])
def test_an_interrupted_call_does_not_delay_the_exit(serve: Serve, call: str) -> None:
    """The exit waited 5 s for the thread of the interrupted call."""
    server = serve("3m:1", "--name", "train", "--spectators", "2")
    stop(server)
    script = f"""
import signal, smaclite_pool as sp
signal.signal(signal.SIGALRM, signal.default_int_handler)
signal.setitimer(signal.ITIMER_REAL, 0.3)
try:
    sp.{call}("train")
except KeyboardInterrupt:
    print("interrupted")
"""
    begin = time.monotonic()
    result = run_script(script)
    assert (result.returncode, result.stdout) == (0, "interrupted\n"), result.stderr
    assert time.monotonic() - begin < 4.5


@pytest.mark.parametrize("command", ["record", "train", "doctor"])
def test_a_signal_ends_a_command_that_waits_for_a_stopped_pool(
    serve: Serve, command: str, tmp_path: Path
) -> None:
    """They ended 9 s later, with the answer that did not come."""
    server = serve("3m:2", "--name", "train")
    stop(server)
    options = {
        "record": ["--pool", "train", "--out", str(tmp_path / "a.smreplay")],
        "train": ["--pool", "train", "--out", str(tmp_path / "run")],
        "doctor": [],
    }[command]
    process = subprocess.Popen(
        [sys.executable, "-m", "smaclite_pool", command, *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    time.sleep(1.5)
    process.send_signal(signal.SIGTERM)
    begin = time.monotonic()
    process.communicate(timeout=60)
    assert process.returncode == 1
    assert time.monotonic() - begin < 5


def test_a_forked_child_exits_at_once_while_its_parent_steps() -> None:
    """It waited 5 s for environments that were busy for ever in its copy of the memory."""
    script = """
import os, sys, threading, time
import smaclite_pool as sp

with sp.make("2s3z", 64, threads=1) as envs:
    envs.reset(seed=1)
    stop = threading.Event()

    def play():
        while not stop.is_set():
            envs.step(envs.sample_actions())

    thread = threading.Thread(target=play)
    thread.start()
    time.sleep(0.2)
    longest = 0.0
    for _ in range(3):
        begin = time.monotonic()
        child = os.fork()
        if child == 0:
            sys.exit(0)
        os.waitpid(child, 0)
        longest = max(longest, time.monotonic() - begin)
    stop.set()
    thread.join()
print("slow" if longest > 4 else "fast", longest)
"""
    result = run_script(script)
    assert result.stdout.startswith("fast"), result.stdout + result.stderr


def test_a_forked_child_closes_its_own_pool_at_exit() -> None:
    """It forgets its parent's environments, and closes its own."""
    script = """
import os, sys
import smaclite_pool as sp

child = os.fork()
envs = sp.make("3m", 2)
if child == 0:
    sys.exit(0)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
    assert run_script(script).stdout == "0\n"  # the fixture finds files that are left
