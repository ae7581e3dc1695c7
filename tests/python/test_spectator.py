"""Spectators: they see what the learner sees, and hold no more than the lane has memory for."""

from __future__ import annotations

import os
import weakref
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import Serve, posix


def test_a_spectator_sees_the_newest_batch(serve: Serve) -> None:
    serve("2s3z:3", "--name", "train")
    with sp.connect("train") as envs, sp.Spectator("train") as spectator:
        assert spectator.latest() is None
        assert spectator.spec == envs.spec
        for _ in range(20):
            batch = envs.reset(seed=1) if spectator.latest() is None else envs.step(envs.sample_actions())
            seen = spectator.latest()
            assert seen is not None and seen is spectator.latest()
            for name in envs.spec.fields:
                np.testing.assert_array_equal(getattr(seen, name), getattr(batch, name))
            del seen, batch
        kept = spectator.latest()
    assert kept is not None and kept.state.any(), "it stays valid"
    with pytest.raises(sp.errors.Closed):
        spectator.latest()


def test_the_callback_of_an_old_batch_may_use_the_spectator() -> None:
    """It ran while the spectator was locked, and waited for its own thread."""
    with sp.make("3m", 1, name="seen") as envs, sp.Spectator("seen") as spectator:
        envs.reset(seed=1)
        seen: list[Any] = []
        old = weakref.ref(spectator.latest(), lambda _: seen.append(spectator.latest()))
        envs.step(envs.sample_actions())
        new = spectator.latest()
        assert old() is None and seen == [new]


def test_a_spectator_of_an_embedded_pool_holds_at_most_two_batches() -> None:
    with sp.make("3m", 2) as envs, sp.Spectator(envs.spec.pool) as spectator:
        with pytest.raises(sp.errors.ConnectError, match="1 spectators"):
            sp.Spectator(envs.spec.pool)
        held = []
        envs.reset(seed=1)
        held.append(spectator.latest())
        envs.step(envs.sample_actions())
        held.append(spectator.latest())
        assert spectator.latest() is held[1], "there is nothing newer, so nothing that it could not hold"
        for _ in range(10):
            envs.step(envs.sample_actions())  # the learner does not notice
        with pytest.raises(sp.errors.TooManyBatchesHeld, match="all 2 batches"):
            spectator.latest()
        del held[0]
        envs.step(envs.sample_actions())
        assert spectator.latest() is not held[0]
    with sp.make("3m", 1, spectators=0) as envs, pytest.raises(sp.errors.ConnectError, match="0 spectators"):
        sp.Spectator(envs.spec.pool)


def test_a_late_spectator_gets_the_newest_batch_and_counts_what_it_misses(serve: Serve) -> None:
    serve("3m:2", "--name", "train")
    with sp.connect("train") as envs:
        envs.reset(seed=1)
        with sp.Spectator("train") as spectator:
            first = envs.step(envs.sample_actions()).sequence
            for _ in range(9):
                newest = envs.step(envs.sample_actions())
            seen = spectator.latest()
            assert seen is not None and seen.sequence == newest.sequence == first + 9
            np.testing.assert_array_equal(seen.obs, newest.obs)
            assert not seen.obs.flags.writeable


@posix
def test_a_forked_child_and_a_dead_pool_are_errors() -> None:
    envs = sp.make("3m", 1)
    spectator = sp.Spectator(envs.spec.pool)
    envs.reset()
    child = os.fork()
    if child == 0:
        try:
            spectator.latest()
        except sp.errors.Forked:
            os._exit(7)
        os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
    assert spectator.latest() is not None
    envs.close()
    with pytest.raises(sp.errors.PoolDied):
        for _ in range(3):
            spectator.latest()
    with pytest.raises(sp.errors.NoSuchPool):
        sp.Spectator("nothing")
