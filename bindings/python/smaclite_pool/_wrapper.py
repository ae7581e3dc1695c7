"""Base class for wrappers of environments."""

from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from . import Batch, Envs

Self = TypeVar("Self", bound="Wrapper")


class Wrapper:
    """Environments that behave as others, except for what a subclass changes.

    A subclass overrides `change_batch`, `change_actions`, or both; all methods that return batches or take
    actions use them. Everything else is that of `envs`, which can be a wrapper too.

        class Scaled(smaclite_pool.Wrapper):
            def change_batch(self, batch):
                return batch.replace(reward=batch.reward / 20)

        envs = Scaled(smaclite_pool.make("2s3z"))

    Args:
        envs: environments, or a wrapper.
    """

    def __init__(self, envs: Envs | Wrapper) -> None:
        self.envs = envs

    def change_batch(self, batch: Batch | ChangedBatch) -> Batch | ChangedBatch:
        """Return the batch that the learner gets; `Batch.replace` changes fields."""
        return batch

    def change_actions(self, actions: ArrayLike) -> ArrayLike:
        """Return the actions that the environments get."""
        return actions

    def reset(
        self,
        seed: int | None = None,
        mask: ArrayLike | None = None,
        env_id: ArrayLike | None = None,
        timeout: float | None = None,
    ) -> Batch | ChangedBatch:
        """As `Envs.reset`."""
        return self.change_batch(self.envs.reset(seed, mask, env_id, timeout))

    def step(
        self, actions: ArrayLike, env_id: ArrayLike | None = None, timeout: float | None = None
    ) -> Batch | ChangedBatch:
        """As `Envs.step`."""
        return self.change_batch(self.envs.step(self.change_actions(actions), env_id, timeout))

    def send(self, actions: ArrayLike, env_id: ArrayLike | None = None) -> None:
        """As `Envs.send`."""
        self.envs.send(self.change_actions(actions), env_id)

    def recv(self, timeout: float | None = None) -> Batch | ChangedBatch:
        """As `Envs.recv`."""
        return self.change_batch(self.envs.recv(timeout))

    def restore(
        self, snapshots: NDArray[np.uint8], env_id: ArrayLike | None = None, **options: Any
    ) -> Batch | ChangedBatch:
        """As `Envs.restore`."""
        return self.change_batch(self.envs.restore(snapshots, env_id, **options))

    def fork(self, env_id_from: ArrayLike, env_id_to: ArrayLike, **options: Any) -> Batch | ChangedBatch:
        """As `Envs.fork`."""
        return self.change_batch(self.envs.fork(env_id_from, env_id_to, **options))

    @property
    def unwrapped(self) -> Envs:
        """The environments below all wrappers."""
        return self.envs.unwrapped if isinstance(self.envs, Wrapper) else self.envs

    def __getattr__(self, name: str) -> Any:
        if name == "envs":  # not set yet: __init__ of the subclass has not called ours
            raise AttributeError("call super().__init__(envs) first")
        return getattr(self.envs, name)

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(
        self,
        exception_type: type[BaseException] | None = None,
        exception: BaseException | None = None,
        traceback: TracebackType | None = None,
    ) -> None:
        self.envs.close()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.envs!r}>"


class ChangedBatch:
    """A batch with other arrays in some fields, made by `Batch.replace`.

    Everything else is that of `batch`.
    """

    def __init__(self, batch: Batch | ChangedBatch, fields: dict[str, Any]) -> None:
        self.batch = batch
        self.__dict__.update(fields)

    def replace(self, **fields: Any) -> ChangedBatch:
        """As `Batch.replace`."""
        return ChangedBatch(self, fields)

    def keys(self) -> list[str]:
        """Names of all fields, those that were added too."""
        own = [name for name in self.__dict__ if name != "batch"]
        return list(dict.fromkeys([*self.batch.keys(), *own]))

    def copy(self) -> dict[str, Any]:
        """As `Batch.copy`."""
        return {name: getattr(self, name).copy() for name in self.keys()}

    def __getattr__(self, name: str) -> Any:
        if name == "batch":  # while it is copied or unpickled
            raise AttributeError(name)
        return getattr(self.batch, name)

    def __len__(self) -> int:
        return len(self.batch)

    def __repr__(self) -> str:
        changed = ", ".join(name for name in self.__dict__ if name != "batch")
        return f"<smaclite_pool.ChangedBatch with other {changed} of {self.batch!r}>"
