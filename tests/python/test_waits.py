"""Timeouts, Ctrl-C and the supervisor's death end every wait. Other threads run meanwhile; forks are safe."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import Alarm, Serve, left_over, linux, posix, run_script, stop

Ring = Callable[[float], object]


@pytest.fixture
def slow() -> Iterator[sp.Envs]:
    """Environments with slow batches: thousands of large battles on one thread."""
    with sp.make("bane_vs_bane", num_envs=4000, threads=1, fields=[], max_held_batches=2) as envs:
        envs.reset()
        yield envs


def test_a_timeout_does_not_cancel_the_batch(slow: sp.Envs) -> None:
    with pytest.raises(sp.errors.Timeout, match="no batch arrived within 0.01 s") as caught:
        slow.step(np.ones((4000, slow.spec.n_agents), np.int32), timeout=0.01)
    assert isinstance(caught.value, TimeoutError)
    assert slow.recv(timeout=100).sequence == 2


@pytest.mark.parametrize("ids", [None, list(range(400))], ids=["all", "each"])
@posix
def test_a_reset_of_all_discards_a_batch_that_a_signal_kept(ids: list[int] | None, alarm: Ring) -> None:
    """In an asynchronous lane, `recv` returned it after `async_reset`, and one batch late all others."""
    with sp.make("bane_vs_bane", 400, batch_size=200, threads=1, max_held_batches=4) as envs:
        batch = envs.reset(seed=1)
        envs.recv()  # of the other half
        actions = np.ones((200, envs.spec.n_agents), np.int32)  # stop
        with pytest.raises(Alarm):
            alarm(0.001)
            envs.step(actions, batch.env_id)
        envs.async_reset(seed=5, env_id=ids)
        for _ in range(2):
            assert envs.recv(timeout=60).was_reset.all()


@pytest.mark.parametrize("wait", ["adaptive", "block", "spin"])
@posix
def test_a_signal_handlers_exception_ends_an_embedded_wait(wait: str, alarm: Ring) -> None:
    settings: dict[str, Any] = {"threads": 1, "fields": [], "max_held_batches": 2, "wait": wait}
    with sp.make("bane_vs_bane", 40_000, **settings) as envs:
        envs.reset()
        envs.send(np.ones((40_000, envs.spec.n_agents), np.int32))
        with pytest.raises(Alarm):
            alarm(0.01)
            envs.recv()
        assert envs.recv(timeout=100).sequence == 2, "it was still being computed"
        with pytest.raises(Alarm):
            alarm(0.01)
            envs.reset()
        assert envs.recv(timeout=100).was_reset.all(), "so was this one"


def test_other_threads_run_during_a_wait_and_their_calls_raise_busy(slow: sp.Envs) -> None:
    waiting = threading.Thread(target=slow.step, args=(np.ones((4000, slow.spec.n_agents), np.int32),))
    waiting.start()
    refused = 0
    while waiting.is_alive():
        try:
            slow.seed_sampler(1)
        except sp.errors.Busy:
            refused += 1
    waiting.join()
    assert refused > 0
    slow.seed_sampler(1)


# Prints `waiting` when the main thread is in the call after `say_when_waiting` and has released the
# interpreter's lock there: with so long an interval, no other thread gets the lock before.
SAY_WHEN_WAITING = """
import sys, threading
begin = threading.Event()
def say() -> None:
    begin.wait()
    print("waiting", flush=True)
def say_when_waiting() -> None:
    sys.setswitchinterval(1000)
    threading.Thread(target=say).start()
    begin.set()
"""

STOPPED = """
import os, signal, sys
from pathlib import Path
import smaclite_pool as sp
signal.signal(signal.SIGINT, signal.default_int_handler)  # SIGINT is ignored in background jobs of a script
envs = sp.connect("train", timeout=10, wait=sys.argv[1])
batch = envs.reset(seed=1)
os.kill(envs.spec.pid, signal.SIGSTOP)
threads = Path(f"/proc/{envs.spec.pid}/task")
while any(") T " not in (thread / "stat").read_text() for thread in threads.iterdir()):
    pass  # a thread may run on for a moment
envs.send(envs.sample_actions())
try:
    say_when_waiting()
    envs.recv()
except KeyboardInterrupt:
    print("interrupted", flush=True)
except sp.errors.PoolDied as error:
    assert isinstance(error, ConnectionError)
    print("died", batch.obs.shape, flush=True)
"""


@linux
@pytest.mark.parametrize("wait", ["adaptive", "block", "spin"])
@pytest.mark.parametrize("how", ["interrupted", "died"])
def test_an_attached_wait_ends(wait: str, how: str, serve: Serve) -> None:
    """By Ctrl-C and by the death of the supervisor."""
    server = serve("2s3z:4", "--name", "train")
    learner = subprocess.Popen(
        [sys.executable, "-c", SAY_WHEN_WAITING + STOPPED, wait], stdout=subprocess.PIPE, text=True
    )
    assert learner.stdout is not None and learner.stdout.readline() == "waiting\n"
    if how == "interrupted":
        learner.send_signal(signal.SIGINT)
    else:
        server.kill()
    said = learner.communicate(timeout=10)[0]
    assert said.startswith(how), said
    assert learner.returncode == 0
    if how == "died":
        server.wait()
        # The name is free at once, and the files of the old pool are removed.
        with sp.make("2s3z", num_envs=1, name="train") as again:
            again.reset()


def interrupts(alarm: Ring, call: Callable[[], Any], seconds: float) -> bool:
    """Whether a signal so long after its begin comes before the call returns."""
    returned = False
    try:
        alarm(seconds)
        call()
        returned = True
        alarm(0)
    except Alarm:
        pass
    return not returned


@posix
@pytest.mark.parametrize("batch_size", [512, 128])
def test_a_signal_takes_no_batch(batch_size: int, alarm: Ring) -> None:
    """Its exception is raised when the wait has ended, with a batch that the next call returns."""
    with sp.make("27m_vs_30m", 512, batch_size=batch_size, seed=1, threads=1) as envs:
        actions = np.ones((512, 27), np.int32)
        # On a machine that does much else, a batch may be there before this process runs again.
        for _ in range(20):
            envs.async_reset()
            for _ in range(512 // batch_size):
                envs.recv()
            envs.send(actions)
            is_interrupted = interrupts(alarm, envs.recv, 0.001)
            done: set[int] = set()
            for _ in range(512 // batch_size - (not is_interrupted)):
                done.update(envs.recv(timeout=10).env_id.tolist())
            if is_interrupted:
                break
        assert is_interrupted, "no signal came before a batch"
        assert done == set(range(512))
        if batch_size == 512:
            lengths: set[int] = set()
            for _ in range(20):
                envs.reset()
                if not interrupts(alarm, lambda: envs.step(actions), 0.005):
                    continue
                # A learner that goes on with a step gets the batch of that step.
                try:
                    batch = envs.step(envs.sample_actions())
                except sp.errors.InvalidRequest:  # the wait ended before the batch was there
                    envs.recv(timeout=10)
                    batch = envs.step(envs.sample_actions())
                lengths = set(batch.episode_length.tolist())
                # On such a machine the signal may also come before the first step was sent.
                if lengths != {1}:
                    break
            assert lengths == {2}


STOPPED_CALLS = """
import signal, sys
import smaclite_pool as sp
signal.signal(signal.SIGINT, signal.default_int_handler)
calls = {
    "status": lambda: sp.status("train", timeout=None),
    "connect": lambda: sp.connect("train", timeout=None),
    "list": lambda: print(sp.pools()),
    "make": lambda: sp.make("2s3z", 1, name="train"),
}
try:
    say_when_waiting()
    calls[sys.argv[1]]()
except KeyboardInterrupt:
    print("interrupted", flush=True)
except sp.errors.StartError as error:
    print(error, flush=True)
"""


@posix
@pytest.mark.parametrize("call", ["status", "connect", "list", "make"])
def test_calls_to_a_stopped_supervisor_can_be_interrupted(call: str, serve: Serve) -> None:
    """They once waited for ten seconds, regardless of timeout and Ctrl-C."""
    server = serve("2s3z:4", "--name", "train")
    stop(server)
    asking = subprocess.Popen(
        [sys.executable, "-c", SAY_WHEN_WAITING + STOPPED_CALLS, call], stdout=subprocess.PIPE, text=True
    )
    assert asking.stdout is not None
    if call in ("status", "connect"):
        assert asking.stdout.readline() == "waiting\n"
        asking.send_signal(signal.SIGINT)
    asking.wait(timeout=100)
    with asking.stdout:  # `communicate` would skip what `readline` has buffered
        said = asking.stdout.read().replace("waiting\n", "").strip()
    expected = {"list": "['train']", "make": f"a pool named `train` runs already (process {server.pid})"}
    assert said.startswith(expected.get(call, "interrupted")), said


@posix
def test_calls_to_a_stopped_supervisor_time_out(serve: Serve) -> None:
    server = serve("2s3z:4", "--name", "train")
    stop(server)
    for ask in (sp.connect, sp.status):
        expected = rf"`train` \(process {server.pid}\) did not answer within 0.3 s"
        with pytest.raises(sp.errors.ConnectError, match=expected):
            ask("train", timeout=0.3)


@posix
def test_an_interrupted_make_leaves_no_files(runtime_dir: Path) -> None:
    """What it had created is removed, at the interpreter's exit at the latest."""
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
    assert not left_over(runtime_dir)


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
        except sp.errors.Forked:
            continue
        os._exit(3)
    if not np.array_equal(batch.obs, before):
        os._exit(4)
    del batch
    envs.close()
    sys.exit(0)  # the usual exit, with all cleanup of the interpreter
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
assert np.array_equal(batch.obs, before)
for _ in range(20):
    envs.step(envs.sample_actions())
envs.reset()
print("fine")
"""


@posix
def test_a_forked_child_gets_errors_and_does_not_affect_its_parent() -> None:
    done = run_script(FORK)
    assert done.stdout == "fine\n", done.stderr


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
@posix
def test_an_embedded_pool_ends_while_a_forked_worker_waits_for_its_parent(how: str) -> None:
    """`close` once waited for a socket of which the worker had a copy: a deadlock that ignored Ctrl-C."""
    done = run_script(BESIDE_A_CHILD, how)
    assert done.stdout == "fine\n", done.stderr


@pytest.mark.parametrize("timeout", [float(sys.maxsize), 2.0**64, 1e300, float("inf"), None])
def test_a_timeout_beyond_any_clock_is_no_limit(timeout: float | None) -> None:
    """It once was a panic if the batch was late, and the environments were unusable afterwards."""
    with sp.make("MMM2", num_envs=256, threads=1, wait="block", fields=[]) as envs:
        envs.reset(timeout=timeout)
        assert envs.step(np.ones((256, envs.spec.n_agents), np.int32), timeout=timeout).sequence == 2


def test_other_threads_run_while_a_file_is_read(tmp_path: Path) -> None:
    """`make` once held the interpreter's lock while it read a scenario file, which took minutes."""
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
    # Long enough that the other thread runs only while this one has released the interpreter's lock.
    sys.setswitchinterval(20)
    try:
        for _ in range(20):
            before = n_runs
            with pytest.raises(sp.errors.ScenarioError, match="the whole file is a list of length 1500000"):
                sp.scenario(path)
            if n_runs > before:
                break
        assert n_runs > before
    finally:
        sys.setswitchinterval(interval)
        is_done.set()
        thread.join()
