"""Base class for wrappers of environments."""

from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from . import Batch, Envs
    from ._spec import LaneSpec

Self = TypeVar("Self", bound="Wrapper")


class Wrapper:
    """Environments that behave as others, except for what a subclass changes.

    A subclass overrides `change_batch`, `change_actions`, or both; all methods that return batches or take
    actions use them. If batches or actions have other sizes then, it overrides `change_spec`, too. Everything
    else is that of `envs`, which can be a wrapper too. So `sample_actions` draws what `change_actions`
    returns; override it where the learner passes other numbers or shapes.

        class Scaled(smaclite_pool.extras.Wrapper):
            def change_batch(self, batch):
                return batch.replace(reward=batch.reward / 20)

        envs = Scaled(smaclite_pool.make("2s3z"))

    Args:
        envs: environments, or a wrapper.
    """

    def __init__(self, envs: Envs | Wrapper) -> None:
        self.envs = envs

    def change_batch(self, batch: Batch) -> Batch:
        """Return the batch that the learner gets; `Batch.replace` changes fields."""
        return batch

    def change_actions(self, actions: ArrayLike) -> ArrayLike:
        """Return the actions that the environments get."""
        return actions

    def change_spec(self, spec: LaneSpec) -> LaneSpec:
        """Return the spec that the learner gets; `dataclasses.replace` changes attributes."""
        return spec

    def reset(
        self,
        seed: int | Sequence[int | None] | NDArray[np.integer[Any]] | None = None,
        env_id: ArrayLike | None = None,
        timeout: float | None = None,
        *,
        levels: ArrayLike | None = None,
        snapshots: NDArray[np.uint8] | None = None,
    ) -> Batch:
        """As `Envs.reset`."""
        batch = self.envs.reset(seed, env_id, timeout, levels=levels, snapshots=snapshots)
        return self.change_batch(batch)

    def step(
        self, actions: ArrayLike, env_id: ArrayLike | None = None, timeout: float | None = None
    ) -> Batch:
        """As `Envs.step`."""
        return self.change_batch(self.envs.step(self.change_actions(actions), env_id, timeout))

    def send(self, actions: ArrayLike, env_id: ArrayLike | None = None) -> None:
        """As `Envs.send`."""
        self.envs.send(self.change_actions(actions), env_id)

    def recv(self, timeout: float | None = None) -> Batch:
        """As `Envs.recv`."""
        return self.change_batch(self.envs.recv(timeout))

    def fork(
        self,
        env_id_from: ArrayLike,
        env_id_to: ArrayLike,
        *,
        seed: int | Sequence[int | None] | NDArray[np.integer[Any]] | None = None,
        timeout: float | None = None,
    ) -> Batch:
        """As `Envs.fork`."""
        forked = self.envs.fork(env_id_from, env_id_to, seed=seed, timeout=timeout)
        return self.change_batch(forked)

    @property
    def spec(self) -> LaneSpec:
        """As `Envs.spec`."""
        return self.change_spec(self.envs.spec)

    @property
    def unwrapped(self) -> Envs:
        """The environments below all wrappers."""
        return self.envs.unwrapped if isinstance(self.envs, Wrapper) else self.envs

    def __getattr__(self, name: str) -> Any:
        if name == "envs":  # not set yet: __init__ of the subclass has not called ours
            raise AttributeError("call super().__init__(envs) first")
        if name == "spec":  # `change_spec` raised AttributeError: it does so again, with its own message
            return self.change_spec(self.envs.spec)
        return getattr(self.envs, name)

    def __len__(self) -> int:
        return len(self.envs)

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
