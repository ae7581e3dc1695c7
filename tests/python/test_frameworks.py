"""Fields of batches in PyTorch and JAX: what both integrations promise."""

from __future__ import annotations

import gc
import importlib
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

NAMES = {"torch": ("tensor", "tensors"), "jax": ("array", "arrays")}
"""The functions for a field and for a batch."""


@pytest.fixture(params=NAMES)
def framework(request: pytest.FixtureRequest) -> str:
    pytest.importorskip(request.param)
    return str(request.param)


def functions(framework: str) -> tuple[Any, Any]:
    module = importlib.import_module(f"smaclite_pool.integrations.{framework}")
    of_field, of_batch = (getattr(module, name) for name in NAMES[framework])
    return of_field, of_batch


def test_an_array_keeps_its_frame_and_no_longer(framework: str) -> None:
    of_field, _ = functions(framework)
    with sp.make("2s3z", 4, max_held_batches=3) as envs:
        batch = envs.reset(seed=1)
        made = of_field(batch.obs)
        # JAX copies what is sliced.
        kept = [made[1:] if framework == "torch" else made]
        before = np.asarray(kept[0]).copy()
        del made
        for _ in range(8):
            batch = envs.step(envs.sample_actions())
        assert np.array_equal(np.asarray(kept[0]), before)
        kept.append(of_field(batch.obs))
        batch = envs.step(envs.sample_actions())
        kept.append(of_field(batch.obs))
        del batch
        with pytest.raises(sp.errors.TooManyBatchesHeld):
            envs.step(envs.sample_actions())
        kept.clear()
        if framework == "jax":
            gc.collect()
        envs.recv()


def test_a_string_is_no_list_of_names(framework: str) -> None:
    """It was read letter by letter: "a batch has no `o`"."""
    _, of_batch = functions(framework)
    with sp.make("3m", 1) as envs:
        batch = envs.reset(seed=1)
        with pytest.raises(TypeError, match=r'^names must be a list of strings, such as \["obs"\], got str'):
            of_batch(batch, "obs")
        assert [*of_batch(batch, ("obs", "reward"))] == ["obs", "reward"]
