"""Storage of consecutive batches, as learners on policy need it."""

from __future__ import annotations

from collections.abc import Iterable
from operator import index
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._requirements import require_integer, require_names, require_synchronous
from .errors import InvalidRequest

if TYPE_CHECKING:
    from . import Batch, Envs
    from ._wrapper import Wrapper


class Rollout:
    """Copies of `steps + 1` consecutive batches, one contiguous array per field.

        rollout = smaclite_pool.extras.Rollout(envs, 128)
        rollout[0] = batch = envs.reset(seed=1)
        for t in range(128):
            rollout[t + 1] = batch = envs.step(policy(batch))

    Row t holds what the agents saw at time t, and row t + 1 what their actions led to: its `reward`,
    `terminated` and `truncated`. The last row is there for its values (bootstrapping), and is the first row
    of the next rollout.

    With next-step autoreset, the step after the end of an episode only resets its environment. Where
    `was_reset[t + 1]` is true, the actions of time t were ignored, or the battle went on elsewhere after a
    `reset(snapshots=)` or `fork`; leave them out of learning.

    Args:
        envs: environments in synchronous mode, or a wrapper of them.
        steps: the number of steps, at least 1.
        fields: names of the fields to store; None for all fields of the lane. `was_reset` is always
            stored.

    Attributes:
        arrays: a dict from the name of each field to its array, `[steps + 1, num_envs, ...]` of the field's
            dtype. Each array is an attribute too: `rollout.obs`.

    Raises:
        InvalidRequest: the environments are asynchronous, `steps` is below 1, or the lane omits a field.
        TypeError: an argument has the wrong type.
    """

    def __init__(self, envs: Envs | Wrapper, steps: int, fields: Iterable[str] | None = None) -> None:
        require_synchronous(envs, "a rollout")
        self.steps = require_integer("steps", steps, 1)
        known = {**envs.spec.fields}
        chosen = [*known] if fields is None else require_names("fields", fields)
        for name in chosen:
            if name not in known:
                raise InvalidRequest(f"fields must be among {', '.join(known)}, got {name!r}")
        self.arrays: dict[str, NDArray[Any]] = {
            name: np.zeros((self.steps + 1, *known[name][1]), known[name][0])
            for name in dict.fromkeys([*chosen, "was_reset"])
        }

    def __getattr__(self, name: str) -> NDArray[Any]:
        arrays: dict[str, NDArray[Any]] = self.__dict__.get("arrays", {})
        if name in arrays:
            return arrays[name]
        raise AttributeError(f"this rollout has no field {name!r}; it has {', '.join(arrays)}")

    def __setitem__(self, t: int, batch: Batch) -> None:
        """Copies a batch to row t, 0 to `steps`. Raises InvalidRequest if it has other shapes."""
        t = int(index(t))  # `True` would be a mask of all rows
        if not 0 <= t <= self.steps:
            raise IndexError(f"row {t} of a rollout with rows 0 to {self.steps}")
        rows = {name: getattr(batch, name) for name in self.arrays}
        for name, array in self.arrays.items():
            if rows[name].shape != array.shape[1:]:
                raise InvalidRequest(
                    f"the batch must be of the environments of the rollout, with {name} of shape "
                    f"{array.shape[1:]}, got {rows[name].shape}"
                )
        for name, array in self.arrays.items():
            array[t] = rows[name]
