"""JAX over shared memory: in place, immutable, and kept alive by its arrays."""

from __future__ import annotations

import gc
import warnings

import numpy as np
import pytest
import smaclite_pool as sp

jax = pytest.importorskip("jax")

from smaclite_pool.integrations.jax import array, arrays


def test_every_field_is_read_in_place_and_without_a_warning() -> None:
    with sp.make("2s3z", 8, autoreset_mode="SameStep") as envs, warnings.catch_warnings():
        warnings.simplefilter("error")
        batch = envs.reset(seed=1)
        seen = arrays(batch)
        assert list(seen) == batch.keys()
        for name, there in seen.items():
            here = getattr(batch, name)
            assert (there.dtype, there.shape) == (here.dtype, here.shape), name
            assert there.unsafe_buffer_pointer() == here.ctypes.data, name
        assert list(arrays(batch, ["obs"])) == ["obs"]


def test_an_array_over_memory_that_can_change_is_a_copy() -> None:
    """A wrapper that used its own array again changed arrays of JAX."""
    with sp.make("2s3z", 8) as envs:
        own = np.zeros((8, 80), np.float32)
        seen = array(envs.reset(seed=1).replace(state=own).state)
        own[...] = 7
        assert not np.asarray(seen).any()


def test_donated_memory_is_not_written() -> None:
    with sp.make("2s3z", 8) as envs:
        batch = envs.reset(seed=1)
        before = batch.obs.copy()
        doubled = jax.jit(lambda obs: obs * 2 + 1, donate_argnums=0)(array(batch.obs))
        assert np.array_equal(doubled, before * 2 + 1) and np.array_equal(batch.obs, before)


def test_an_array_keeps_its_frame_and_no_longer() -> None:
    with sp.make("2s3z", 4, max_held_batches=3) as envs:
        batch = envs.reset(seed=1)
        before, kept = batch.obs.copy(), [array(batch.obs)]
        for _ in range(8):
            batch = envs.step(envs.sample_actions())
        assert np.array_equal(kept[0], before)
        kept.append(array(batch.obs))
        batch = envs.step(envs.sample_actions())
        kept.append(array(batch.obs))
        del batch
        with pytest.raises(sp.errors.TooManyBatchesHeld):
            envs.step(envs.sample_actions())
        kept.clear()
        gc.collect()
        envs.recv()


def test_a_string_is_no_list_of_names() -> None:
    """It was read letter by letter: "a batch has no `o`"."""
    with sp.make("3m", 1) as envs:
        batch = envs.reset(seed=1)
        with pytest.raises(TypeError, match=r'^names must be a list of strings, such as \["obs"\], got str'):
            arrays(batch, "obs")
        assert [*arrays(batch, ("obs", "reward"))] == ["obs", "reward"]
