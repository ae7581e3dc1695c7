"""JAX over shared memory: in place, immutable, and kept alive by its arrays."""

from __future__ import annotations

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
