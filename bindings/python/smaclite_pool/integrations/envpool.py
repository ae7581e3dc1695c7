"""An EnvPool-compatible API: `make`, `send`, `recv`, `async_reset`, `step`, `reset`, `spec` and `config`.

    import numpy as np
    from smaclite_pool.integrations import envpool

    envs = envpool.make("2s3z", env_type="gymnasium", num_envs=8, batch_size=4, seed=1)
    envs.async_reset()  # begins all environments; recv returns the first four that are ready
    for _ in range(200):
        obs, reward, terminated, truncated, info = envs.recv()
        actions = obs["action_mask"].argmax(-1).astype(np.int32)  # int32 [4, n_agents], available actions
        envs.send(actions, info["env_id"])
    envs.close()

An observation is a dict: `obs` float32 [M, n_agents, obs_size], `state` float32 [M, state_size],
`action_mask` bool [M, n_agents, n_actions]. Agents are an axis and not players of EnvPool: there is one
reward per environment, that of the team. With `sides="both"`, the other team is no player either:
observations have `enemy_obs`, `enemy_state` and `enemy_action_mask`, info has `enemy_reward` and
`enemy_alive`, and actions are [M, n_agents + n_enemies]. Three differences from EnvPool: `reset` accepts a
seed, an unavailable action is an error, and so are actions for some environments of a synchronous pool,
which steps all. This module needs no further package; only the spaces of `spec`
need gymnasium.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _native
from .._extra import extra
from .._native import Batch, Envs, scenarios
from .._requirements import require_integer
from ..errors import InvalidRequest
from ._common import ENEMY_OBSERVATION_KEYS, INFO_FIELDS, OBSERVATION_KEYS, check_keywords

if TYPE_CHECKING:
    from gymnasium import spaces

__all__ = ["ArraySpec", "EnvPool", "EnvSpec", "list_all_envs", "make", "make_gymnasium", "make_spec"]

Arrays: TypeAlias = dict[str, NDArray[Any]]
Step: TypeAlias = tuple[Arrays, NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_], Arrays]

INFO_KEYS = {
    "env_id": "env_id",
    "elapsed_step": "episode_length",
    **{field: field for field in INFO_FIELDS if field != "episode_length"},
    "alive": "alive",
    "enemy_alive": "enemy_alive",
    "enemy_reward": "enemy_reward",
}
"""Keys of `info`, EnvPool's where it has one, and the field of a batch that each one contains."""

OBS_KEYS = OBSERVATION_KEYS | ENEMY_OBSERVATION_KEYS
"""Keys of observations; those of fields that the lane has."""


class ArraySpec(NamedTuple):
    """Type and shape of an array."""

    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    """For one environment."""


@dataclass(frozen=True)
class EnvSpec:
    """The description of environments, known before the first reset."""

    config: dict[str, Any]
    """The arguments of `make`, including defaults."""
    state_array_spec: dict[str, ArraySpec]
    """Arrays that `recv` returns: `obs:<key>`, `info:<key>`, `reward`, `terminated` and `trunc`."""
    action_array_spec: dict[str, ArraySpec]
    """Arrays that `send` expects: `env_id` and `action`."""
    _envs: Envs = field(repr=False)
    reward_threshold: None = None

    @property
    def observation_space(self) -> spaces.Dict:
        """Of one environment; needs gymnasium."""
        with extra("gymnasium"):
            from ._spaces import single_observation_space

        return single_observation_space(self._envs)

    @property
    def action_space(self) -> spaces.MultiDiscrete:
        """Of one environment; needs gymnasium."""
        with extra("gymnasium"):
            from ._spaces import single_action_space

        return single_action_space(self._envs)


class EnvPool:
    """The environments of a lane with EnvPool's methods; `make` returns one.

    Args:
        envs: a lane, from `smaclite_pool.make` or `smaclite_pool.connect`; closed with this object.
        config: the arguments of `make`; by default num_envs and batch_size.
        copy: True: arrays are copies that you can keep and change. False: they are read-only views of shared
            memory, unless another order of `env_id` was asked for; at most the lane's `max_held_batches` can
            be held.
    """

    def __init__(self, envs: Envs, config: dict[str, Any] | None = None, *, copy: bool = True) -> None:
        spec = envs.spec
        self._envs, self._copy = envs, copy
        self._fields = spec.fields
        self.config: dict[str, Any] = config or {
            "num_envs": spec.num_envs,
            "batch_size": spec.batch_size,
        }
        self.num_envs: int = spec.num_envs
        self.all_env_ids: NDArray[np.int32] = np.arange(spec.num_envs, dtype=np.int32)
        self._slots: NDArray[Any] | None = None  # of the next batch, if another order than its own is wanted

    @property
    def spec(self) -> EnvSpec:
        """Names, dtypes, shapes and spaces."""
        keys = {f"obs:{key}": field for key, field in OBS_KEYS.items()}
        keys |= {f"info:{key}": field for key, field in INFO_KEYS.items()}
        keys |= {"reward": "reward", "terminated": "terminated", "trunc": "truncated"}
        received = {}
        for key, name in keys.items():
            if name in self._fields:
                dtype, shape = self._fields[name]
                received[key] = ArraySpec(dtype, shape[1:])
        int32 = np.dtype(np.int32)
        sent = {"env_id": ArraySpec(int32, ()), "action": ArraySpec(int32, (self._envs.spec.n_actors,))}
        return EnvSpec(self.config, received, sent, self._envs)

    @property
    def observation_space(self) -> spaces.Dict:
        """Of one environment; needs gymnasium."""
        return self.spec.observation_space

    @property
    def action_space(self) -> spaces.MultiDiscrete:
        """Of one environment; needs gymnasium."""
        return self.spec.action_space

    @property
    def is_async(self) -> bool:
        """Whether a batch contains fewer environments than `num_envs`."""
        return self._envs.spec.batch_size != self._envs.spec.num_envs

    def __len__(self) -> int:
        return self.num_envs

    def async_reset(self) -> None:
        """Request a new episode in every environment and return at once; `recv` the first observations."""
        self._envs.async_reset()
        self._slots = None

    def send(self, action: ArrayLike, env_id: ArrayLike | None = None) -> None:
        """Send actions to environments and return at once.

        `action`: integers [K, n_agents], with those of the enemies behind them if actions play both sides.
        `env_id`: integers [K]; None for all environments in order. Synchronous environments are stepped
        together, K is `num_envs` then, and the next `recv` returns them in this order. If an action is not
        available, nothing is stepped, and the next `recv` raises IllegalAction.
        """
        self._envs.send(action, env_id)
        ids = None if self.is_async or env_id is None else np.asarray(env_id)
        is_in_order = ids is None or ids.dtype == np.bool_ or np.array_equal(ids, self.all_env_ids)
        self._slots = None if is_in_order else ids

    def recv(self, timeout: float | None = None) -> Step:
        """Wait for the next batch: the `batch_size` environments that finish first, see `info["env_id"]`.

        Raises Timeout after `timeout` seconds; None waits without a limit. Raises IllegalAction if an action
        that was sent is not available; nothing was stepped then.
        """
        batch = self._envs.recv(timeout)
        obs, info = self._decode(batch, self._slots)
        results = (batch.reward, batch.terminated, batch.truncated)
        reward, terminated, truncated = (self._array(array, self._slots) for array in results)
        return obs, reward, terminated, truncated, info

    def step(self, action: ArrayLike, env_id: ArrayLike | None = None) -> Step:
        """`send`, then `recv`."""
        self.send(action, env_id)
        return self.recv()

    def reset(
        self,
        env_id: ArrayLike | None = None,
        *,
        seed: int | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Arrays, Arrays]:
        """Begin new episodes in environments `env_id` [K], where `options["reset_mask"]` is True, or in all.

        With a seed, environment i is seeded with seed + i. Returns observations and info of those
        environments, in that order; with asynchronous environments those of the next batch, as `recv` does.
        Raises InvalidRequest for both choices at once, for an empty one and for a mask of another shape, and
        TypeError for a mask that is not bool.
        """
        mask = (options or {}).get("reset_mask")
        if mask is not None:
            if env_id is not None:
                raise InvalidRequest("env_id and options['reset_mask'] exclude each other; give one")
            env_id = np.flatnonzero(self._checked(mask))
        ids = None if env_id is None else np.atleast_1d(np.asarray(env_id))
        if ids is not None and not ids.size:
            raise InvalidRequest("env_id and options['reset_mask'] must choose at least one environment")
        batch = self._envs.reset(seed, env_id=ids)
        self._slots = None
        return self._decode(batch, None if self.is_async else ids)

    def _checked(self, mask: ArrayLike) -> NDArray[np.bool_]:
        given, expected = np.asarray(mask), (self.num_envs,)
        if given.dtype != np.bool_:
            raise TypeError(f"options['reset_mask'] must be a bool array, got {given.dtype}")
        if given.shape != expected:
            raise InvalidRequest(
                f"options['reset_mask'] must be a bool array of shape {expected}, got {given.shape}"
            )
        return given

    def _decode(self, batch: Batch, slots: NDArray[Any] | None = None) -> tuple[Arrays, Arrays]:
        return self._select(OBS_KEYS, batch, slots), self._select(INFO_KEYS, batch, slots)

    def _select(self, keys: dict[str, str], batch: Batch, slots: NDArray[Any] | None) -> Arrays:
        present = {key: field for key, field in keys.items() if field in self._fields}
        return {key: self._array(getattr(batch, field), slots) for key, field in present.items()}

    def _array(self, array: NDArray[Any], slots: NDArray[Any] | None = None) -> NDArray[Any]:
        if slots is not None:
            chosen: NDArray[Any] = array[slots]  # indexing by an array copies
            return chosen
        return array.copy() if self._copy else array

    def close(self) -> None:
        """End the pool. Calling it again has no effect."""
        self._envs.close()

    def __enter__(self) -> EnvPool:
        return self

    def __exit__(
        self,
        exception_type: type[BaseException] | None,
        exception: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"EnvPool({', '.join(f'{name}={value!r}' for name, value in self.config.items())})"


def make(
    task_id: str | PathLike[str],
    env_type: str = "gymnasium",
    *,
    num_envs: int = 1,
    batch_size: int | None = None,
    num_threads: int = 0,
    seed: int = 42,
    max_episode_steps: int | None = None,
    thread_affinity_offset: int = -1,
    copy: bool = True,
    **settings: Any,
) -> EnvPool:
    """Start a pool within this process.

    Args:
        task_id: a standard scenario (see `list_all_envs()`) or the path of a scenario file.
        env_type: "gymnasium"; "gym" is the same.
        num_envs: number of environments (N).
        batch_size: environments per batch (M); None or 0 for all of them, fewer for asynchronous stepping.
        num_threads: number of threads that step environments; 0 for the cores that this process may use.
        seed: environment i is seeded with seed + i.
        max_episode_steps: steps after which an episode is truncated; None for the limit of the scenario.
        thread_affinity_offset: must be -1 (no pinning).
        copy: as in `EnvPool`.
        settings: `autoreset_mode`, `rules`, `fields`, `wait` and other arguments of `smaclite_pool.make`.

    Raises InvalidRequest, ScenarioError and StartError.
    """
    for name, own in {"threads": "num_threads", "episode_limit": "max_episode_steps"}.items():
        if name in settings:
            raise TypeError(
                f"make() got an unexpected keyword argument {name!r}; use `{own}`, EnvPool's name"
            )
    check_keywords(make, settings, ["scenario", "threads", "episode_limit"])
    if env_type not in ("gymnasium", "gym"):
        raise InvalidRequest(f'env_type must be "gymnasium" or "gym", got {env_type!r}')
    if thread_affinity_offset != -1:
        raise InvalidRequest(f"thread_affinity_offset must be -1 (no pinning), got {thread_affinity_offset}")
    require_integer("num_threads", num_threads, 0)
    if max_episode_steps is not None:
        require_integer("max_episode_steps", max_episode_steps, 1)
    envs = _native.make(
        task_id,
        num_envs,
        batch_size=batch_size or None,
        threads=num_threads or None,
        seed=seed,
        episode_limit="default" if max_episode_steps is None else max_episode_steps,
        **settings,
    )
    config = {
        "task_id": str(task_id),
        "num_envs": num_envs,
        "batch_size": envs.spec.batch_size,
        "num_threads": num_threads,
        "max_num_players": 1,
        "seed": seed,
        "max_episode_steps": envs.spec.episode_limit,
        "thread_affinity_offset": thread_affinity_offset,
        **settings,
    }
    return EnvPool(envs, config, copy=copy)


def make_gymnasium(task_id: str | PathLike[str], **kwargs: Any) -> EnvPool:
    """`make` with env_type="gymnasium"."""
    return make(task_id, "gymnasium", **kwargs)


def make_spec(task_id: str | PathLike[str], **kwargs: Any) -> EnvSpec:
    """The spec of `make` with these arguments; starts a pool for it and closes it again."""
    with make(task_id, **kwargs) as envs:
        return envs.spec


def list_all_envs() -> list[str]:
    """Names of the standard scenarios."""
    return scenarios()
