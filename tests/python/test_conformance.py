"""However a lane is stepped from Python, its environments produce the same bits.

In this process by any number of threads, all at once or in batches of those that are ready; in another one.

The tests of the crates compare every way of stepping with the engine (tests/src/conformance.rs), and these
compare the ways that Python has with each other.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import Serve

NUM_ENVS = 6
STEPS = 60
SETTINGS: dict[str, Any] = {"episode_limit": 25, "obs_last_actions": 1}
FIELDS = ("obs", "state", "avail_actions", "reward", "terminated", "truncated", "was_reset", "episode_return")


def histories(envs: sp.Envs) -> list[str]:
    """A digest of what each environment produced in its first steps. Its actions follow from its rows and its
    own random numbers."""
    digests = [hashlib.sha256() for _ in range(NUM_ENVS)]
    rngs = [np.random.default_rng(env) for env in range(NUM_ENVS)]
    counts = [0] * NUM_ENVS
    envs.async_reset(seed=3)
    while min(counts) < STEPS:
        batch = envs.recv(timeout=60)
        ids = batch.env_id.copy()
        actions = []
        for slot, env in enumerate(ids):
            if counts[env] < STEPS:
                for field in FIELDS:
                    digests[env].update(batch[field][slot].tobytes())
            counts[env] += 1
            masks = batch.avail_actions[slot]
            actions.append([rngs[env].choice(np.flatnonzero(mask)) for mask in masks])
        envs.send(np.array(actions, np.int32), None if len(ids) == NUM_ENVS else ids)
    return [digest.hexdigest() for digest in digests]


@contextmanager
def made(**options: Any) -> Iterator[sp.Envs]:
    with sp.make("2s3z", num_envs=NUM_ENVS, **SETTINGS, **options) as envs:
        yield envs


@pytest.mark.parametrize("autoreset", ["NextStep", "SameStep"])
def test_every_way_of_stepping_in_this_process_shows_the_same_bits(autoreset: Any) -> None:
    with made(autoreset_mode=autoreset, threads=1) as envs:
        expected = histories(envs)
    assert len(set(expected)) == NUM_ENVS
    for threads, batch_size in [(2, NUM_ENVS), (3, 2), (1, 1), (2, 4)]:
        with made(autoreset_mode=autoreset, threads=threads, batch_size=batch_size) as envs:
            assert histories(envs) == expected, (threads, batch_size)


@pytest.mark.parametrize("autoreset", ["NextStep", "SameStep"])
def test_a_pool_in_another_process_shows_the_same_bits(serve: Serve, autoreset: Any) -> None:
    with made(autoreset_mode=autoreset, threads=1) as envs:
        expected = histories(envs)
    for batch_size in (NUM_ENVS, 2):
        options = ["--episode-limit", "25", "--obs-last-actions", "1", "--batch-size", str(batch_size)]
        name = f"conformance-{batch_size}"
        serve(f"2s3z:{NUM_ENVS}", "--name", name, "--autoreset-mode", autoreset, "--threads", "2", *options)
        with sp.connect(name, timeout=30) as envs:
            assert histories(envs) == expected, f"batches of {batch_size}"
