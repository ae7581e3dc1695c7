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

from conftest import Serve, left_over, run_script


@pytest.fixture
def slow() -> Iterator[sp.Envs]:
    """Environments whose batch takes long: thousands of large battles on one thread."""
    with sp.make("bane_vs_bane", num_envs=4000, threads=1, fields=[], max_held_batches=2) as envs:
        envs.reset()
        yield envs


def test_a_timeout_leaves_the_batch_under_way(slow: sp.Envs) -> None:
    with pytest.raises(sp.Timeout, match="no batch arrived within 0.01 s") as caught:
        slow.step(np.ones((4000, slow.n_agents), np.int32), timeout=0.01)
    assert isinstance(caught.value, TimeoutError)
    assert slow.recv(timeout=100).sequence == 2


class Alarm(Exception):
    """Raised by a signal handler."""


@pytest.mark.parametrize("wait", ["adaptive", "block", "spin"])
def test_a_signal_handlers_exception_ends_an_embedded_wait(wait: str) -> None:
    def ring(number: int, frame: FrameType | None) -> None:
        raise Alarm

    with sp.make("bane_vs_bane", 40_000, threads=1, fields=[], max_held_batches=2, wait=wait) as envs:  # type: ignore[arg-type]
        envs.reset()
        before = signal.signal(signal.SIGALRM, ring)
        try:
            envs.send(np.ones((40_000, envs.n_agents), np.int32))
            with pytest.raises(Alarm):
                signal.setitimer(signal.ITIMER_REAL, 0.01)
                envs.recv()
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


def stop(server: subprocess.Popen[str]) -> None:
    """SIGSTOP, and waits until every thread has stopped: one may go on, and answer, for a moment."""
    server.send_signal(signal.SIGSTOP)
    threads = Path(f"/proc/{server.pid}/task")
    while any(") T " not in (thread / "stat").read_text() for thread in threads.iterdir()):
        time.sleep(0.001)


STOPPED_CALLS = """
import signal, sys, time
import smaclite_pool as sp
signal.signal(signal.SIGINT, signal.default_int_handler)
calls = {
    "status": lambda: sp.status("train", timeout=None),
    "connect": lambda: sp.connect("train", timeout=None),
    "list": lambda: print(sp.pools()),
    "make": lambda: sp.make("2s3z", 1, name="train"),
}
print("waiting", flush=True)
try:
    calls[sys.argv[1]]()
except KeyboardInterrupt:
    print("interrupted", flush=True)
except sp.StartError as error:
    print(error, flush=True)
"""


@pytest.mark.parametrize("call", ["status", "connect", "list", "make"])
def test_no_call_waits_for_a_stopped_supervisor_against_its_callers_will(call: str, serve: Serve) -> None:
    """They once waited for ten seconds, whatever timeout and Ctrl-C said."""
    server = serve("2s3z:4", "--name", "train")
    stop(server)
    asking = subprocess.Popen([sys.executable, "-c", STOPPED_CALLS, call], stdout=subprocess.PIPE, text=True)
    assert asking.stdout is not None and asking.stdout.readline() == "waiting\n"
    if call in ("status", "connect"):
        time.sleep(0.5)  # to be in the call, most likely
        asking.send_signal(signal.SIGINT)
    asking.wait(timeout=8)
    with asking.stdout:  # `communicate` would pass over what `readline` has in its buffer
        said = asking.stdout.read().strip()
    expected = {"list": "['train']", "make": f"a pool named `train` runs already (process {server.pid})"}
    assert said.startswith(expected.get(call, "interrupted")), said


def test_a_stopped_supervisor_is_given_up_in_time(serve: Serve) -> None:
    server = serve("2s3z:4", "--name", "train")
    stop(server)
    for ask in (sp.connect, sp.status):
        begin = time.monotonic()
        with pytest.raises(sp.ConnectError, match=rf"`train` \(process {server.pid}\) did not answer within 0.3 s"):
            ask("train", timeout=0.3)
        assert time.monotonic() - begin < 8
    assert sp.pools() == ["train"]
    server.send_signal(signal.SIGCONT)
    with sp.connect("train", timeout=60) as envs:
        envs.reset()


def test_an_interrupted_make_leaves_nothing_behind(place: Path) -> None:
    """What was being made is taken back, at the interpreter's exit at the latest."""
    script = """
import signal, sys
import smaclite_pool as sp
class Alarm(Exception): ...
def ring(number, frame): raise Alarm
signal.signal(signal.SIGALRM, ring)
for delay in (0.001, 0.01, 0.03, 0.06, 0.1, 0.2):
    signal.setitimer(signal.ITIMER_REAL, delay)
    try:
        sp.make("27m_vs_30m", 512).close()
    except Alarm:
        pass
    signal.setitimer(signal.ITIMER_REAL, 0)
print("fine")
"""
    done = run_script(script)
    assert done.stdout == "fine\n", done.stderr
    assert not left_over(place)


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


BESIDE_A_CHILD = """
import multiprocessing, sys
import smaclite_pool as sp

def work(queue):
    queue.get()

envs = sp.make("2s3z", num_envs=2)
envs.reset()
context = multiprocessing.get_context("fork")
queue = context.Queue()
worker = context.Process(target=work, args=(queue,))
worker.start()
if sys.argv[1] == "close":
    envs.close()
else:
    del envs
assert sp.pools() == [] and worker.is_alive()
queue.put(None)
worker.join()
print("fine")
"""


@pytest.mark.parametrize("how", ["close", "del"])
def test_an_embedded_pool_ends_while_a_forked_worker_waits_for_its_parent(how: str) -> None:
    """The end waited for a socket that the worker had a copy of: a deadlock, and Ctrl-C did not help."""
    done = run_script(BESIDE_A_CHILD, how)
    assert done.stdout == "fine\n", done.stderr


@pytest.mark.parametrize("timeout", [float(sys.maxsize), 2.0**64, 1e300, float("inf"), None])
def test_a_timeout_beyond_any_clock_is_no_limit(timeout: float | None) -> None:
    """It was a panic where the batch came late, and the environments could not be used any more."""
    with sp.make("MMM2", num_envs=256, threads=1, wait="block", fields=[]) as envs:
        envs.reset(timeout=timeout)
        assert envs.step(np.ones((256, envs.n_agents), np.int32), timeout=timeout).sequence == 2


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
