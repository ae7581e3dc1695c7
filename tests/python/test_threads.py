"""Several Python threads at a time, which on a free-threaded Python run in parallel.

A pool is used by one thread at a time, which others are told; its batches are read by any number.
"""

from __future__ import annotations

import sysconfig
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from typing import TypeVar

import numpy as np
import smaclite_pool as sp

from conftest import Serve, posix, run_script

THREADS = 4
T = TypeVar("T")


def run_in_threads(work: Callable[[int], T]) -> list[T]:
    """Calls `work` with the numbers of threads, all of which begin at the same time; returns the results."""
    together = threading.Barrier(THREADS)

    def run(number: int) -> T:
        together.wait()
        return work(number)

    with ThreadPoolExecutor(THREADS) as threads:
        return list(threads.map(run, range(THREADS)))


def test_the_package_leaves_the_interpreter_lock_off() -> None:
    """In a process of its own, as other packages of the tests may turn it on."""
    done = run_script("import smaclite_pool, sys; print(getattr(sys, '_is_gil_enabled', lambda: True)())")
    is_free_threaded = bool(sysconfig.get_config_var("Py_GIL_DISABLED"))
    assert (done.stdout, done.stderr) == (f"{not is_free_threaded}\n", "")


def test_every_thread_has_a_pool_of_its_own() -> None:
    """Also made, stepped and closed at the same time, pools play what they play alone."""

    def play(number: int) -> bytes:
        with sp.make("2s3z", 4, threads=1, seed=number) as envs:
            envs.seed_sampler(number)
            batch = envs.reset()
            for _ in range(50):
                batch = envs.step(envs.sample_actions())
            return bytes(batch.state.tobytes())

    alone = [play(number) for number in range(THREADS)]
    for _ in range(5):
        assert run_in_threads(play) == alone


def test_one_thread_at_a_time_uses_a_pool() -> None:
    """The others get Busy, and change nothing: every step that returned was one of the pool's."""
    with sp.make("3m", 8, threads=1, opponent="hold") as envs:
        envs.reset(seed=1)
        actions = np.ones((8, envs.spec.n_agents), np.int32)

        def step(_: int) -> list[int]:
            sequences: list[int] = []
            while len(sequences) < 200:
                with suppress(sp.errors.Busy):
                    sequences.append(envs.step(actions).sequence)
            return sequences

        sequences = sorted(number for numbers in run_in_threads(step) for number in numbers)
        assert sequences == list(range(2, 2 + 200 * THREADS))


def test_threads_share_a_batch() -> None:
    """The arrays of a batch are made when they are first asked for: once, by whichever thread."""

    def values(batch: sp.Batch, _: int) -> list[np.ndarray]:
        return list(batch.values())

    with sp.make("3m", 4, threads=1) as envs:
        batch = envs.reset(seed=1)
        for _ in range(100):
            first, *others = run_in_threads(partial(values, batch))
            for other in others:
                assert all(a is b for a, b in zip(first, other, strict=True))
            del first, others, other  # they hold the batch
            batch = envs.step(envs.sample_actions())


def test_threads_share_a_policy() -> None:
    with sp.make("2s3z", 16, threads=1) as envs:
        policy = sp.ScriptedPolicy("nearest", envs)
        batch = envs.reset(seed=1)
        expected = policy(batch)
        for _ in range(50):
            for actions in run_in_threads(lambda _: policy(batch)):
                np.testing.assert_array_equal(actions, expected)


@posix
def test_a_forked_child_does_not_wait_for_a_policy_of_its_parent() -> None:
    """A thread of the parent held a lock while it computed, which no thread of the child released."""
    done = run_script(
        """
import os, threading, numpy as np, smaclite_pool as sp
with sp.make("bane_vs_bane", 64, threads=1, spectators=0) as envs:
    policy, batch = sp.ScriptedPolicy("spread", envs), envs.reset(seed=1)
    ends = threading.Event()
    def play():
        while not ends.is_set():
            policy(batch)
    thread = threading.Thread(target=play)
    thread.start()
    for _ in range(20):
        child = os.fork()
        if child == 0:
            try:
                policy(batch)
            except sp.errors.Forked as error:
                assert "make another one" in str(error)
            os._exit(0)
        assert os.waitpid(child, 0)[1] == 0
    ends.set()
    thread.join()
"""
    )
    assert done.returncode == 0, done.stderr


def test_threads_share_a_spectator(serve: Serve) -> None:
    serve("2s3z:4", "--name", "train", "--threads", "1")
    spectator = sp.Spectator("train")
    newest = [0] * THREADS  # of what each has seen; the first thread is the learner

    def step() -> None:
        try:
            with sp.connect("train", timeout=10) as envs:
                envs.reset(seed=1)
                while not all(newest[1:]) and newest[0] < 100_000:
                    newest[0] = envs.step(envs.sample_actions()).sequence
        finally:
            newest[0] = -1

    def look(number: int) -> None:
        while newest[0] >= 0:
            try:
                batch = spectator.latest()
            except sp.errors.TooManyBatchesHeld:
                continue  # two others hold one each
            if batch is not None:
                assert batch.sequence >= newest[number]
                newest[number] = batch.sequence
                del batch

    run_in_threads(lambda number: step() if number == 0 else look(number))
    assert all(newest)
    spectator.close()
