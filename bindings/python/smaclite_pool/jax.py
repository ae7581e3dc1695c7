"""JAX over a batch's shared memory: nothing is copied on the CPU (extra `jax`).

    import jax
    import numpy as np
    import smaclite_pool as sp
    from smaclite_pool.jax import arrays

    @jax.jit
    def policy(key, obs, avail_actions):
        logits = jax.numpy.where(avail_actions, obs.sum(axis=2, keepdims=True), -jax.numpy.inf)
        return jax.random.categorical(key, logits)

    with sp.make("2s3z", num_envs=8) as envs:
        seen = arrays(envs.reset(seed=1))       # {"obs": float32 [8, 5, 80], "avail_actions": bool [8, 5, 11], ...}
        actions = policy(jax.random.key(1), seen["obs"], seen["avail_actions"])
        seen = arrays(envs.step(np.asarray(actions)))

JAX's arrays are immutable, so nothing can be spoilt; memory that is given to a jitted function with `donate_argnums` is
not reused either, since it is not JAX's own. An array keeps its frame, also for as long as a computation over it is
under way: a lane lets a learner hold `max_held_batches` batches at once, so `.copy()` what must stay longer.

For a GPU, put the batch's own arrays there: `jax.device_put(batch.obs, jax.devices("gpu")[0])`.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import jax
from numpy.typing import NDArray

from ._native import Batch

__all__ = ["array", "arrays"]


def array(field: NDArray[Any]) -> jax.Array:
    """A field of a batch on JAX's CPU device over the same memory, e.g. `array(batch.obs)`.

    In place needs memory on a cache line, as fields are; JAX copies a slice that is not.
    """
    # Not DLPack: JAX does not know its read-only memory yet.
    return jax.device_put(field, jax.devices("cpu")[0], may_alias=True)


def arrays(batch: Batch, names: Iterable[str] | None = None) -> dict[str, jax.Array]:
    """The fields of a batch (`names`, or all) as arrays over the same memory, by name."""
    return {name: array(getattr(batch, name)) for name in (batch.keys() if names is None else names)}
