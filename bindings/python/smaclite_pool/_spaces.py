"""Gymnasium's spaces of a lane; those of actions sample what is legal just now."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ._native import Envs
from ._sights import SIGHTS
from .errors import Closed, InvalidRequest


class LegalActions(spaces.Tuple):  # type: ignore[type-arg] # not generic at run time before gymnasium 1.4
    """One `Discrete` an agent; `sample()`, called without a mask, draws what is legal in the battle just now."""

    def __init__(self, envs: Envs, sizes: Sequence[int]) -> None:
        super().__init__([spaces.Discrete(size) for size in sizes])
        self._envs = envs

    def seed(self, seed: int | Sequence[int] | None = None) -> Any:  # Gymnasium's versions differ
        """Seed the space and the sampler of legal actions."""
        if isinstance(seed, int):
            self._envs.seed_sampler(seed)
        return super().seed(seed)

    def sample(
        self, mask: tuple[Any | None, ...] | None = None, probability: tuple[Any | None, ...] | None = None
    ) -> tuple[np.int64, ...]:
        """Random actions: under `mask`, int8 [n] an agent, or by `probability`; with neither, of the legal ones."""
        if mask is None and probability is None:
            try:
                return tuple(self._envs.sample_actions()[0].astype(np.int64))
            except (Closed, InvalidRequest):
                pass  # nothing is legal before the first reset and after the end; any action will do
        return super().sample(mask, probability)

    def __reduce__(self) -> tuple[type[spaces.Space[Any]], tuple[Any]]:
        return spaces.Tuple, (self.spaces,)  # a copy knows of no battle


class LegalActionsBatch(spaces.Box):
    """Joint actions of all environments, [num_envs, n_agents]; `sample()` draws legal ones."""

    def __init__(self, envs: Envs, every: spaces.Box) -> None:
        dtype: Any = every.dtype  # whose type differs with Gymnasium's versions
        super().__init__(every.low, every.high, dtype=dtype.type)
        self._envs = envs

    def seed(self, seed: int | None = None) -> int | Any:
        """Seed the space and the sampler of legal actions."""
        if seed is not None:
            self._envs.seed_sampler(seed)
        return super().seed(seed)

    def sample(self, mask: None = None, probability: None = None) -> NDArray[Any]:
        """Random actions that are legal by what the last step or reset returned."""
        try:
            return self._envs.sample_actions().astype(self.dtype)
        except (Closed, InvalidRequest):  # before the first reset, after the end
            return super().sample(mask, probability)

    def __reduce__(self) -> tuple[type[spaces.Box], tuple[Any, ...]]:
        return spaces.Box, (self.low, self.high, self.shape, self.dtype)  # a copy knows of no battle


def single_observation_space(envs: Envs) -> spaces.Dict:
    """`obs` float32 [n_agents, obs_size], `state` float32 [state_size], both in -1 to 1, and `action_mask` int8
    [n_agents, n_actions]: of these, the ones whose fields the lane has.
    """
    fields = envs.fields
    every: dict[str, spaces.Space[Any]] = {}
    for name, field in SIGHTS.items():
        if field in fields:
            dtype, shape = fields[field]
            is_mask = dtype == np.bool_
            every[name] = spaces.MultiBinary(shape[1:]) if is_mask else spaces.Box(-1.0, 1.0, shape[1:], np.float32)
    return spaces.Dict(every)


def batched_observation_space(envs: Envs) -> spaces.Dict:
    """The observations of all environments, by Gymnasium's `batch_space`."""
    every = batch_space(single_observation_space(envs), envs.num_envs)
    assert isinstance(every, spaces.Dict)
    return every


def single_action_space(envs: Envs) -> spaces.MultiDiscrete:
    """`MultiDiscrete([n_actions] * n_agents)`."""
    return spaces.MultiDiscrete([envs.n_actions] * envs.n_agents)


def batched_action_space(envs: Envs) -> LegalActionsBatch:
    """The actions of all environments; equal to Gymnasium's `batch_space` of the single space."""
    every = batch_space(single_action_space(envs), envs.num_envs)
    assert isinstance(every, spaces.Box)
    return LegalActionsBatch(envs, every)
