"""Gymnasium spaces of a lane. The action spaces sample actions that are available at that moment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, TypeAlias

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from .._layout import Bounds, field_bounds
from .._native import Envs
from ..errors import Closed, InvalidRequest
from ._common import ENEMY_OBSERVATION_KEYS, OBSERVATION_KEYS

Copy: TypeAlias = "tuple[Any, tuple[type[spaces.Space[Any]]], dict[str, Any]]"


def _copied_as(plain: type[spaces.Space[Any]], space: spaces.Space[Any]) -> Copy:
    """For `__reduce__`: a copy is a plain space with the same random state, as no environment updates it."""
    state = {name: value for name, value in vars(space).items() if name not in ("mask", "_envs")}
    return object.__new__, (plain,), state


class AvailableDiscrete(spaces.Discrete):
    """Actions of one agent: `Discrete(n_actions)` whose `sample()` without arguments draws available ones."""

    def __init__(self, n_actions: int) -> None:
        super().__init__(n_actions)
        self.mask = np.ones(n_actions, np.int8)
        """int8 [n_actions]: the actions to sample; updated at every step."""

    def sample(self, mask: Any = None, probability: Any = None) -> np.int64:
        """A random action, by `mask`, int8 [n_actions], or by `probability`, float64 [n_actions]."""
        if mask is None and probability is None:
            mask = self.mask
        return super().sample(mask, probability)

    def __reduce__(self) -> Copy:
        return _copied_as(spaces.Discrete, self)


def update_masks(
    each: Mapping[str, AvailableDiscrete], avail_actions: Sequence[NDArray[np.bool_]] | NDArray[np.bool_]
) -> None:
    """Set the masks of the agents' spaces, each from bool [n_actions]."""
    for space, mask in zip(each.values(), avail_actions, strict=True):
        space.mask = mask.view(np.int8)


class _SamplesAvailable:
    """Mixed into the action spaces of environments: actions are drawn by the environments' own sampler."""

    _envs: Envs

    def _available_actions(self) -> NDArray[np.int32] | None:
        """A random available action per agent, or None before the first reset and after the end.

        Then there is no mask, so any action will do.
        """
        try:
            return self._envs.sample_actions()
        except (Closed, InvalidRequest):
            return None

    def seed(self, seed: Any = None) -> Any:  # Gymnasium's versions differ
        """Seed the space and the sampler of available actions; without a seed, both by the one returned."""
        used = super().seed(seed)  # type: ignore[misc] # of the space that follows in the order of bases
        of_sampler = used if seed is None else seed
        if not isinstance(of_sampler, int) or of_sampler >= 1 << 64:  # a seed per agent, or a random one
            of_sampler = int(np.random.SeedSequence(of_sampler).generate_state(1, np.uint64)[0])
        with suppress(Closed):  # then any action will do
            self._envs.seed_sampler(of_sampler)
        return used


# Not generic at run time before gymnasium 1.4.
class AvailableTuple(_SamplesAvailable, spaces.Tuple):  # type: ignore[type-arg]
    """Joint actions of the published environment, a `Discrete` per agent; `sample()` draws available ones."""

    def __init__(self, envs: Envs, sizes: Sequence[int]) -> None:
        super().__init__([spaces.Discrete(size) for size in sizes])
        self._envs = envs

    def sample(
        self, mask: tuple[Any | None, ...] | None = None, probability: tuple[Any | None, ...] | None = None
    ) -> tuple[np.int64, ...]:
        """Random actions, by `mask`, int8 [n] per agent, or by `probability`, float64 [n] per agent."""
        if mask is None and probability is None:
            actions = self._available_actions()
            if actions is not None:
                return tuple(self._known(actions[0]).astype(np.int64))
        return super().sample(mask, probability)

    def _known(self, actions: NDArray[np.int32]) -> NDArray[np.int32]:
        """Available actions that the spaces of the agents contain.

        That of a healer has an action for each other ally, but the numbers of its actions count the healer
        too: the published space lacks the last one.
        """
        sizes = [space.n for space in self.spaces if isinstance(space, spaces.Discrete)]
        while (unknown := actions >= sizes).any():
            actions = np.where(unknown, self._envs.sample_actions()[0], actions)
        return actions

    def __reduce__(self) -> Copy:
        return _copied_as(spaces.Tuple, self)


class AvailableMultiDiscrete(_SamplesAvailable, spaces.MultiDiscrete):
    """Joint actions of one battle, [n_agents]; `sample()` by default draws available ones."""

    def __init__(self, envs: Envs) -> None:
        super().__init__([envs.spec.n_actions] * envs.spec.n_agents)
        self._envs = envs

    def sample(self, mask: Any = None, probability: Any = None) -> NDArray[Any]:
        """Random actions, by `mask` or by `probability` as in `MultiDiscrete`."""
        if mask is None and probability is None:
            actions = self._available_actions()
            if actions is not None:
                return actions[0].astype(self.dtype)
        return super().sample(mask, probability)

    def __reduce__(self) -> Copy:
        return _copied_as(spaces.MultiDiscrete, self)


class AvailableBox(_SamplesAvailable, spaces.Box):
    """Joint actions of all environments, [num_envs, n_agents]; `sample()` draws available ones."""

    def __init__(self, envs: Envs, batched: spaces.Box) -> None:
        dtype: Any = batched.dtype  # whose type differs with Gymnasium's versions
        super().__init__(batched.low, batched.high, dtype=dtype.type)
        self._envs = envs

    def sample(self, mask: None = None, probability: None = None) -> NDArray[Any]:
        """Random actions that are available after the last step or reset."""
        actions = self._available_actions()
        return super().sample(mask, probability) if actions is None else actions.astype(self.dtype)

    def __reduce__(self) -> Copy:
        return _copied_as(spaces.Box, self)


def single_observation_space(envs: Envs) -> spaces.Dict:
    """The observation of one environment, with the keys whose fields the lane has.

    `obs` float32 [n_agents, obs_size] and `state` float32 [state_size], whose features are between -1 and 1
    but for those that can be beyond, and `action_mask` int8 [n_agents, n_actions]; if actions play both
    sides, then `enemy_obs`, `enemy_state` and `enemy_action_mask` too.
    """
    fields = {name: (dtype, shape[1:]) for name, (dtype, shape) in envs.spec.fields.items()}
    return observation_space(fields, field_bounds(envs))


def observation_space(
    fields: Mapping[str, tuple[Any, Sequence[int]]], bounds: Mapping[str, Bounds]
) -> spaces.Dict:
    """The same of fields with these dtypes and shapes, without the axis of environments.

    Fields without bounds can have any number.
    """
    present: dict[str, spaces.Space[Any]] = {}
    for key, field in (OBSERVATION_KEYS | ENEMY_OBSERVATION_KEYS).items():
        if field in fields:
            dtype, shape = fields[field]
            if dtype == np.bool_:  # not MultiBinary, as TorchRL knows that with one axis only
                present[key] = spaces.Box(0, 1, tuple(shape), np.int8)
            else:
                present[key] = bounded_box(bounds.get(field), tuple(shape))
    return spaces.Dict(present)


def bounded_box(bounds: Bounds | None, shape: tuple[int, ...]) -> spaces.Box:
    """Floats of a shape whose last axis has these bounds."""
    low, high = bounds or (np.float32(-np.inf), np.float32(np.inf))
    return spaces.Box(
        np.broadcast_to(low, shape).copy(), np.broadcast_to(high, shape).copy(), dtype=np.float32
    )


def batched_observation_space(envs: Envs) -> spaces.Dict:
    """The observations of all environments: Gymnasium's `batch_space` of the single space."""
    batched = batch_space(single_observation_space(envs), envs.spec.num_envs)
    assert isinstance(batched, spaces.Dict)
    return batched


def single_action_space(envs: Envs) -> spaces.MultiDiscrete:
    """`MultiDiscrete([n_actions] * n_agents)`, and the same of the enemies if actions play both sides."""
    spec = envs.spec
    return action_space(spec.n_agents, spec.n_actions, spec.n_actors - spec.n_agents, spec.n_enemy_actions)


def action_space(
    n_agents: int, n_actions: int, n_enemies: int = 0, n_enemy_actions: int = 0
) -> spaces.MultiDiscrete:
    """The same of these numbers of units that actions play, and of their actions."""
    return spaces.MultiDiscrete([n_actions] * n_agents + [n_enemy_actions] * n_enemies)


def batched_action_space(envs: Envs) -> AvailableBox:
    """The actions of all environments; equal to Gymnasium's `batch_space` of the single space."""
    batched = batch_space(single_action_space(envs), envs.spec.num_envs)
    assert isinstance(batched, spaces.Box)
    return AvailableBox(envs, batched)
