"""Every wait ends: with a timeout, Ctrl-C, the supervisor's death; other threads run meanwhile; a fork is noticed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import Serve, run_script


@pytest.fixture
def slow() -> Iterator[sp.Envs]:
    """Environments whose batch takes long: thousands of large battles on one thread."""
    with sp.make("bane_vs_bane", num_envs=4000, threads=1, fields=[], frames_held=2) as envs:
        envs.reset()
        yield envs


def test_a_timeout_leaves_the_batch_under_way(slow: sp.Envs) -> None:
    with pytest.raises(sp.Timeout, match="nothing came within") as caught:
        slow.step(np.ones((4000, slow.n_agents), np.int32), timeout=0.01)
    assert isinstance(caught.value, TimeoutError)
    assert slow.recv(timeout=100).sequence == 2


class Alarm(Exception):
    """Raised by a signal handler."""


@pytest.mark.parametrize("wait", ["adaptive", "block", "spin"])
def test_a_signal_handlers_exception_ends_an_embedded_wait(wait: str) -> None:
    def ring(number: int, frame: FrameType | None) -> None:
        raise Alarm

    with sp.make("bane_vs_bane", 40_000, threads=1, fields=[], frames_held=2, wait=wait) as envs:  # type: ignore[arg-type]
        envs.reset()
        before = signal.signal(signal.SIGALRM, ring)
        try:
            with pytest.raises(Alarm):
                signal.setitimer(signal.ITIMER_REAL, 0.01)
                envs.step(np.ones((40_000, envs.n_agents), np.int32))
        finally:
            signal.signal(signal.SIGALRM, before)
        assert envs.recv(timeout=100).sequence == 2, "it was still under way"


def test_other_threads_run_during_a_wait_and_may_not_join_it(slow: sp.Envs) -> None:
    waiting = threading.Thread(target=slow.step, args=(np.ones((4000, slow.n_agents), np.int32),))
    waiting.start()
    refused = 0
    while waiting.is_alive():
        try:
            slow.seed_sampler(1)
        except sp.Busy:
            refused += 1
    waiting.join()
    assert refused > 0
    slow.seed_sampler(1)


STOPPED = """
import os, signal, sys
from pathlib import Path
import smaclite_pool as sp
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where tests run in the background of a script
envs = sp.connect("train", timeout=10, wait=sys.argv[1])
batch = envs.reset(seed=1)
os.kill(envs.pid, signal.SIGSTOP)
threads = Path(f"/proc/{envs.pid}/task")
while any(") T " not in (thread / "stat").read_text() for thread in threads.iterdir()):
    pass  # a thread may go on for a moment
envs.send(envs.sample_actions())
try:
    print("waiting", flush=True)
    envs.recv()
except KeyboardInterrupt:
    print("interrupted", flush=True)
except sp.PoolDied as error:
    assert isinstance(error, ConnectionError)
    print("died", batch.obs.shape, flush=True)
"""


@pytest.mark.parametrize("wait", ["adaptive", "block", "spin"])
@pytest.mark.parametrize("how", ["interrupted", "died"])
def test_an_attached_wait_ends(wait: str, how: str, serve: Serve) -> None:
    """With Ctrl-C, and with the death of the supervisor."""
    server = serve("2s3z:4", "--name", "train")
    learner = subprocess.Popen([sys.executable, "-c", STOPPED, wait], stdout=subprocess.PIPE, text=True)
    assert learner.stdout is not None and learner.stdout.readline() == "waiting\n"
    time.sleep(0.3)  # to be in `recv`, most likely
    if how == "interrupted":
        learner.send_signal(signal.SIGINT)
    else:
        server.kill()
    said = learner.communicate(timeout=10)[0]
    assert said.startswith(how), said
    assert learner.returncode == 0
    if how == "died":
        server.wait()
        with sp.make("2s3z", num_envs=1, name="train") as again:  # the name is free at once, and cleaned up
            again.reset()


def test_a_killed_learner_frees_its_lane(serve: Serve) -> None:
    serve("2s3z:4", "--name", "train")
    script = 'import smaclite_pool as sp, time; e = sp.connect("train"); b = e.reset(); print(1, flush=True); time.sleep(100)'
    learner = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert learner.stdout is not None and learner.stdout.readline() == "1\n"
    with pytest.raises(sp.LaneTaken) as caught:
        sp.connect("train")
    assert caught.value.holder == learner.pid
    learner.kill()
    learner.communicate()
    while sp.status("train")["lanes"][0]["holder"] is not None:
        pass
    with sp.connect("train") as envs:
        with pytest.raises(sp.InvalidRequest, match="call reset first"):
            envs.step(np.ones((4, 5), int))
        envs.reset()


FORK = """
import os, sys
import numpy as np
import smaclite_pool as sp

envs = sp.make("2s3z", num_envs=2)
batch = envs.reset(seed=1)
before = batch.obs.copy()
child = os.fork()
if child == 0:
    for call in (envs.recv, envs.reset, envs.sample_actions, lambda: envs.step([[1] * 5] * 2)):
        try:
            call()
        except sp.Forked:
            continue
        os._exit(3)
    if not np.array_equal(batch.obs, before):
        os._exit(4)
    del batch
    envs.close()
    sys.exit(0)  # the usual way out, with everything the interpreter does at its end
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
assert np.array_equal(batch.obs, before)
for _ in range(20):
    envs.step(envs.sample_actions())
envs.reset()
print("fine")
"""


def test_a_forked_child_is_told_and_disturbs_nobody() -> None:
    done = run_script(FORK)
    assert done.stdout == "fine\n", done.stderr


def test_the_supervisor_of_a_process_is_not_ended_by_its_child() -> None:
    with sp.make("2s3z", num_envs=1) as envs:
        envs.reset()
        child = os.fork()
        if child == 0:
            envs.close()
            os._exit(0)
        os.waitpid(child, 0)
        assert envs.step(envs.sample_actions(), timeout=60).sequence == 2


def test_other_threads_run_while_a_file_is_read(tmp_path: Path) -> None:
    """`make` held the interpreter's lock for as long as it read a scenario file: minutes, once."""
    path = tmp_path / "large.json"
    path.write_text("[" + ",".join(["[1]"] * 1_500_000) + "]")
    is_done, n_runs = threading.Event(), 0

    def run() -> None:
        nonlocal n_runs
        while not is_done.is_set():
            time.sleep(0.001)
            n_runs += 1

    interval = sys.getswitchinterval()
    thread = threading.Thread(target=run)
    thread.start()
    # So long that the other thread runs only while this one has let go of the lock.
    sys.setswitchinterval(20)
    try:
        for _ in range(20):
            before = n_runs
            with pytest.raises(sp.ScenarioError, match="the whole file is a list of length 1500000"):
                sp.scenario(path)
            if n_runs > before:
                break
        assert n_runs > before
    finally:
        sys.setswitchinterval(interval)
        is_done.set()
        thread.join()
