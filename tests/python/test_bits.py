"""The same seed and actions give the same bits, for all numbers of threads, batch sizes and transports."""

from __future__ import annotations

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import Serve
from play import play, play_in_part_batches

STEPS = 150  # past the end of episodes


def difference(expected: list[bytes], found: list[bytes]) -> str | None:
    """The first step that differs."""
    assert len(expected) == len(found)
    steps = (step for step, (a, b) in enumerate(zip(expected, found, strict=True)) if a != b)
    return next((f"step {step} differs" for step in steps), None)


@pytest.mark.parametrize("scenario", ["2s3z", "MMM2"])
def test_embedded_and_attached_with_any_number_of_threads(scenario: str, serve: Serve) -> None:
    with sp.make(scenario, num_envs=8, threads=1) as envs:
        expected = play(envs, STEPS, seed=11)
    assert len(set(expected)) == len(expected), "batches change"
    for threads in (2, 4):
        with sp.make(scenario, num_envs=8, threads=threads) as envs:
            assert difference(expected, play(envs, STEPS, seed=11)) is None, f"{threads} threads"
    process = serve(f"{scenario}:8", "--name", "train", "--threads", "2")
    with sp.connect("train", timeout=10) as envs:
        assert envs.pid == process.pid
        assert difference(expected, play(envs, STEPS, seed=11)) is None, "attached"


def test_part_batches_give_each_environment_the_same_episode() -> None:
    with sp.make("2s3z", num_envs=6, threads=1) as envs:
        expected = play_in_part_batches(envs, 40, seed=3)
    for batch_size, threads in ((1, 1), (2, 2), (4, 3)):
        with sp.make("2s3z", num_envs=6, batch_size=batch_size, threads=threads) as envs:
            assert play_in_part_batches(envs, 40, seed=3) == expected, (
                f"batches of {batch_size}, {threads} threads"
            )


def test_environment_i_of_seed_s_is_environment_0_of_seed_s_plus_i() -> None:
    with sp.make("2s3z", num_envs=3) as three, sp.make("2s3z", num_envs=1, seed=12) as one:
        obs = three.reset(seed=10).obs
        assert np.array_equal(obs[2:], one.reset().obs), "the first reset uses the lane's seed"
        again = three.reset(seed=10).obs
        assert np.array_equal(obs, again)
