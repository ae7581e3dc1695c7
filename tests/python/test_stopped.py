"""A supervisor that is stopped (SIGSTOP) delays no interrupt and no exit; a forked child exits at once; a
learner that is stopped goes on afterwards."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import smaclite_pool as sp

from conftest import PROGRAM, Alarm, Serve, handles, linux, posix, run_script, stop

pytestmark = posix  # signals stop processes, and forks are learners


def test_an_interrupted_recorder_goes_on(serve: Serve, alarm: Callable[[float], object]) -> None:
    """`n_complete` hid that nothing was received."""
    server = serve("3m:1", "--name", "train")
    with sp.connect("train") as envs, sp.Recorder("train") as recorder:
        envs.reset(seed=1)
        stop(server)
        alarm(0.3)
        with pytest.raises(Alarm):
            _ = recorder.n_complete
        server.send_signal(signal.SIGCONT)
        for _ in range(100):
            envs.step(envs.sample_actions())
        assert recorder.n_complete > 0


def test_an_interrupted_connect_does_not_take_the_lane(
    serve: Serve, alarm: Callable[[float], object]
) -> None:
    """The pool granted it when it went on, and the next call said that this process had the lane."""
    server = serve("3m:1", "--name", "train")
    for _ in range(5):
        stop(server)
        alarm(0.2)
        with pytest.raises(Alarm):
            sp.connect("train", timeout=30)
        server.send_signal(signal.SIGCONT)
        with sp.connect("train", timeout=5) as envs:
            envs.reset()


@pytest.mark.parametrize("call", ["Recorder", "Spectator"])
def test_an_interrupted_call_does_not_delay_the_exit(serve: Serve, call: str) -> None:
    """The exit waited 5 s for the thread of the interrupted call, and gave up before that ended."""
    server = serve("3m:1", "--name", "train", "--spectators", "2")
    stop(server)
    script = f"""
import atexit, os, signal, time

def threads():
    for task in os.listdir("/proc/self/task"):
        try:
            with open(f"/proc/self/task/{{task}}/comm") as name:
                yield name.read().strip()
        except OSError:  # it has just ended
            pass

def say_if_one_is_left():
    for _ in range(50):  # one that the exit does not wait for any more may be about to end
        if "smaclite-wait" not in threads():
            print("none is left")
            break
        time.sleep(0.01)

atexit.register(say_if_one_is_left)  # runs after what the package registers
import smaclite_pool as sp
signal.signal(signal.SIGALRM, signal.default_int_handler)
signal.setitimer(signal.ITIMER_REAL, 0.3)
try:
    sp.{call}("train")
except KeyboardInterrupt:
    print("interrupted")
"""
    result = run_script(script)
    expected = "interrupted\nnone is left\n"
    assert (result.returncode, result.stdout) == (0, expected), result.stdout + result.stderr


@linux
def test_a_learner_with_a_pool_of_its_own_goes_on_after_a_stop() -> None:
    """A training that was suspended (Ctrl-Z) for two minutes ended with "no batch arrived within 120 s"."""
    script = """
import smaclite_pool as sp
with sp.make("27m_vs_30m", 64) as envs:
    envs.reset(seed=1)
    print("steps", flush=True)
    for _ in range(300):
        envs.step(envs.sample_actions(), timeout=1.0)
print("done")
"""
    command = [sys.executable, "-c", script]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "steps\n"
        stop(process)
        time.sleep(2)  # longer than the timeout
        process.send_signal(signal.SIGCONT)
        out, err = process.communicate(timeout=100)
    assert (process.returncode, out) == (0, "done\n"), err


@linux
@pytest.mark.parametrize("command", ["record", "train"])
def test_a_signal_ends_a_command_that_waits_for_a_stopped_pool(
    serve: Serve, command: str, tmp_path: Path
) -> None:
    """They ended 9 s later, with the answer that did not come."""
    server = serve("3m:2", "--name", "train")
    stop(server)
    options = {
        "record": ["--pool", "train", "--out", str(tmp_path / "a.smreplay")],
        "train": ["--pool", "train", "--out", str(tmp_path / "run")],
    }[command]
    process = subprocess.Popen(
        [*PROGRAM, command, *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while not handles(process.pid, signal.SIGTERM) and process.poll() is None:
        time.sleep(0.01)
    time.sleep(0.5)  # in which it begins to wait
    process.send_signal(signal.SIGTERM)
    printed = "".join(process.communicate(timeout=60))
    assert process.returncode == 128 + signal.SIGTERM
    assert "interrupted" in printed and "did not answer" not in printed, printed


def test_a_forked_child_exits_at_once_while_its_parent_steps() -> None:
    """It waited 5 s for environments that were busy in its copy of the memory, looking every millisecond."""
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
    waits = []
    for _ in range(3):
        child = os.fork()
        if child == 0:
            sys.exit(0)
        waits.append(os.wait4(child, 0)[2].ru_nvcsw)
    stop.set()
    thread.join()
print(max(waits))
"""
    result = run_script(script)
    assert int(result.stdout) < 200, result.stdout + result.stderr


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


@pytest.mark.parametrize("kind", ["snapshots", "seeds"])
def test_a_reset_that_ended_early_is_received_whole(serve: Serve, kind: str) -> None:
    """`recv` returned the first of its requests, a plain reset without snapshots, or the seeds of some."""
    server = serve("3m:4", "--name", "train", "--fields", "obs,avail_actions,snapshot")
    with sp.connect("train") as envs:
        arguments: dict[str, Any] = {"seed": [5, 100, 7, 3]}
        if kind == "snapshots":
            envs.reset(seed=1)
            arguments = {"snapshots": envs.step(envs.sample_actions()).snapshot.copy()}
        whole = envs.reset(**arguments).obs.copy()
    with sp.connect("train") as envs:
        stop(server)
        with pytest.raises(sp.errors.Timeout):
            envs.reset(**arguments, timeout=0.2)
        server.send_signal(signal.SIGCONT)
        assert (envs.recv().obs == whole).all()
        assert (envs.reset(**arguments).obs == whole).all()


def test_a_recorder_is_used_by_one_thread_of_one_process(serve: Serve) -> None:
    """A call waited for that of another thread, without Ctrl-C, and in a forked child without end."""
    server = serve("3m:1", "--name", "train")
    with sp.Recorder("train") as recorder:
        stop(server)
        thread = threading.Thread(target=lambda: recorder.n_complete)
        thread.start()
        busy = 0
        while not busy:
            try:
                _ = recorder.n_lost
            except sp.errors.Busy:
                busy += 1
        child = os.fork()
        if child == 0:
            try:
                _ = recorder.n_lost
            except sp.errors.Forked:
                os._exit(0)
            finally:
                os._exit(1)
        assert os.waitpid(child, 0)[1] == 0
        server.send_signal(signal.SIGCONT)
        thread.join()
