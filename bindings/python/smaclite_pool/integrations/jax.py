"""JAX: the fields of a batch as arrays over the same memory (extra `jax`).

    import jax
    import numpy as np
    import smaclite_pool as sp
    from smaclite_pool.integrations.jax import arrays

    @jax.jit
    def policy(key, obs, avail_actions):
        logits = jax.numpy.where(avail_actions, obs.sum(axis=2, keepdims=True), -jax.numpy.inf)
        return jax.random.categorical(key, logits)

    with sp.make("2s3z", num_envs=8) as envs:
        fields = arrays(envs.reset(seed=1))     # {"obs": float32 [8, 5, 80], ...}
        actions = policy(jax.random.key(1), fields["obs"], fields["avail_actions"])
        fields = arrays(envs.step(np.asarray(actions)))

Nothing is copied on the CPU. JAX's arrays are immutable, so the shared memory cannot be overwritten; a jitted
function with `donate_argnums` does not reuse it either, as JAX does not own it. An array keeps its batch
alive, also while a computation over it is running, and JAX releases it a step later than NumPy. A lane
limits the batches held at once to `max_held_batches` (at least 3 for such a loop), so `.copy()` what you keep
longer.

On a GPU, copy the fields of the batch directly: `jax.device_put(batch.obs, jax.devices("gpu")[0])`.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from numpy.typing import NDArray

from .._extra import extra
from .._native import Batch
from .._requirements import require_names

with extra("jax"):
    import jax

__all__ = ["array", "arrays"]


def array(field: NDArray[Any]) -> jax.Array:
    """A field of a batch on JAX's CPU device, over the same memory, e.g. `array(batch.obs)`.

    JAX copies arrays that do not begin on a cache line; fields do, slices of them may not. A writable array,
    such as one of `Batch.replace`, is copied: JAX relies on values that do not change. What a read-only view
    shows must not change either.
    """
    if field.flags.writeable:
        field = field.copy()  # JAX would copy later, when values may have changed
    # Not DLPack: JAX does not support its read-only memory yet.
    return jax.device_put(field, jax.devices("cpu")[0], may_alias=True)


def arrays(batch: Batch, names: Iterable[str] | None = None) -> dict[str, jax.Array]:
    """The fields of a batch by name, as arrays over the same memory; all of them unless `names` are given."""
    return {
        name: array(getattr(batch, name))
        for name in (batch.keys() if names is None else require_names("names", names))
    }
