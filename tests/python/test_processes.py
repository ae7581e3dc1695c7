"""What happens between processes where a pool or a learner ends, is replaced, or forks."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading

import pytest
import smaclite_pool as sp

from conftest import Serve, linux, program

pytestmark = linux


def test_the_scenario_is_not_that_of_another_pool_of_the_name(serve: Serve) -> None:
    """Environments of an ended pool gave the scenario, and the pictures, of the next one of its name."""
    first = serve("x=3m:2", "--name", "train")
    with sp.connect("train") as envs:
        assert sp.scenario(envs)["episode_limit"] == 60
        first.terminate()
        first.wait()
        with pytest.raises(sp.errors.PoolDied):
            sp.scenario(envs)
        serve("x=3m:2", "--name", "train", "--set", "episode_limit=7")
        with pytest.raises(sp.errors.PoolDied):
            sp.scenario(envs)


def test_closing_after_the_end_of_the_pool_is_no_error(serve: Serve) -> None:
    """`except PoolDied: envs.close()` raised PoolDied again."""
    server = serve("3m:1", "--name", "train")
    envs = sp.connect("train")
    envs.reset(seed=1)
    server.kill()
    server.wait()
    with pytest.raises(sp.errors.PoolDied):
        while True:
            envs.step(envs.sample_actions())
    # Its environments are busy with a request that has no result: that is no reason for another error.
    with pytest.raises(sp.errors.PoolDied):
        envs.step(envs.sample_actions())
    envs.close()
    envs.close()
    program("clean")  # what the killed pool left


def test_a_forked_child_of_a_busy_learner_is_told_that_it_is_one() -> None:
    """It was always told that another thread is busy, and could not leave its `with` block."""
    with sp.make("3m", 4, threads=1) as envs:
        envs.reset(seed=1)
        ended = threading.Event()

        def work() -> None:
            while not ended.is_set():
                envs.reset(seed=1)

        thread = threading.Thread(target=work)
        thread.start()
        for _ in range(5):
            child = os.fork()
            if child == 0:
                try:
                    envs.recv()
                except sp.errors.Forked:
                    envs.close()
                    os._exit(0)
                finally:
                    os._exit(1)
            assert os.waitpid(child, 0)[1] == 0
        ended.set()
        thread.join()


HELD = """
import os, signal, sys, time
import smaclite_pool as sp

envs = sp.make("3m", 1, name="train", threads=1)
ready, told = os.pipe()
child = os.fork()
if child == 0:
    os.write(told, b".")
    time.sleep(1000)
os.read(ready, 1)  # the child has closed what it inherited, which a busy computer lets it do late
print(child, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_pool_has_ended_although_a_child_of_its_process_lives() -> None:
    """The child kept its lock and its socket: the pool was listed, could not be reached and kept its name."""
    killed = subprocess.Popen([sys.executable, "-c", HELD], stdout=subprocess.PIPE, text=True)
    assert killed.stdout is not None
    child = int(killed.stdout.readline())
    try:
        killed.wait()
        os.kill(child, 0)  # it lives
        with pytest.raises(sp.errors.NoSuchPool):
            sp.connect("train")
        with sp.make("3m", 1, name="train") as envs:
            envs.reset(seed=1)
    finally:
        os.kill(child, signal.SIGKILL)
        killed.stdout.close()
    program("clean")  # what the killed pool left
