"""EnvPool's names over a pool: `make`, `send`, `recv`, `async_reset`, `step`, `reset`, `spec`, `config`.

    import numpy as np
    from smaclite_pool import envpool

    envs = envpool.make("2s3z", env_type="gymnasium", num_envs=8, batch_size=4, seed=1)
    envs.async_reset()  # every environment begins; recv gives the first four that are ready
    for _ in range(200):
        obs, reward, terminated, truncated, info = envs.recv()
        actions = obs["action_mask"].argmax(-1).astype(np.int32)  # int32 [4, n_agents]: each agent's first legal action
        envs.send(actions, info["env_id"])
    envs.close()

An observation is a dict: `obs` float32 [M, n_agents, obs_size], `state` float32 [M, state_size], `action_mask` bool
[M, n_agents, n_actions]. Agents are an axis, not players: there is one reward an environment, the team's. Unlike
EnvPool's, a seed given to `reset` counts, and an action that is not available is an error.
Needs nothing beyond this package; the spaces of `spec` need gymnasium.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._native import Batch, Envs, scenarios
from ._sights import SIGHTS
from .errors import InvalidRequest

if TYPE_CHECKING:
    from gymnasium import spaces

__all__ = ["ArraySpec", "EnvPool", "EnvSpec", "list_all_envs", "make", "make_gymnasium", "make_spec"]

Arrays: TypeAlias = dict[str, NDArray[Any]]
Step: TypeAlias = tuple[Arrays, NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_], dict[str, NDArray[Any]]]

INFO = {
    "env_id": "env_id",
    "elapsed_step": "episode_length",
    "episode_return": "episode_return",
    "battle_won": "battle_won",
    "dead_allies": "dead_allies",
    "dead_enemies": "dead_enemies",
    "alive": "alive",
}
"""What `info` has, by EnvPool's or this package's name: the field of a batch."""


class ArraySpec(NamedTuple):
    """What an array holds."""

    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    """Of one environment."""


@dataclass(frozen=True)
class EnvSpec:
    """What is known of environments before they play."""

    config: dict[str, Any]
    """The arguments of `make`, defaults filled in."""
    state_array_spec: dict[str, ArraySpec]
    """What environments send, as `obs:<name>`, `info:<name>`, `reward`, `terminated` and `trunc`."""
    action_array_spec: dict[str, ArraySpec]
    """What environments take."""
    _envs: Envs = field(repr=False)
    reward_threshold: None = None

    @property
    def observation_space(self) -> spaces.Dict:
        """Of one environment; needs gymnasium."""
        from ._spaces import single_observation_space

        return single_observation_space(self._envs)

    @property
    def action_space(self) -> spaces.MultiDiscrete:
        """Of one environment; needs gymnasium."""
        from ._spaces import single_action_space

        return single_action_space(self._envs)


class EnvPool:
    """The environments of a lane by EnvPool's names; `make` makes one.

    Args:
        envs: a lane, from `smaclite_pool.make` or `smaclite_pool.connect`; closed with this object.
        config: what it was made with.
        copy: True: arrays are yours to keep. False: they are read-only views of shared memory, valid for as long as
            they are held; as many batches may be held as the lane's `max_held_batches`.
    """

    def __init__(self, envs: Envs, config: dict[str, Any] | None = None, *, copy: bool = True) -> None:
        self._envs, self._copy = envs, copy
        self._fields = envs.fields
        self.config: dict[str, Any] = config or {"num_envs": envs.num_envs, "batch_size": envs.batch_size}
        self.num_envs: int = envs.num_envs
        self.all_env_ids: NDArray[np.int32] = np.arange(envs.num_envs, dtype=np.int32)

    @property
    def spec(self) -> EnvSpec:
        """Names, data types, shapes and spaces."""
        names = {f"obs:{name}": field for name, field in SIGHTS.items()}
        names |= {f"info:{name}": field for name, field in INFO.items()}
        names |= {"reward": "reward", "terminated": "terminated", "trunc": "truncated"}
        sent = {}
        for name, of_batch in names.items():
            if of_batch in self._fields:
                dtype, shape = self._fields[of_batch]
                sent[name] = ArraySpec(dtype, shape[1:])
        int32 = np.dtype(np.int32)
        taken = {"env_id": ArraySpec(int32, ()), "action": ArraySpec(int32, (self._envs.n_agents,))}
        return EnvSpec(self.config, sent, taken, self._envs)

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
        """Does a batch hold fewer environments than there are?"""
        return self._envs.batch_size != self._envs.num_envs

    def __len__(self) -> int:
        return self.num_envs

    def async_reset(self) -> None:
        """Ask for a new episode in every environment and return at once; `recv` the first observations."""
        self._envs.async_reset()

    def send(self, action: ArrayLike, env_id: ArrayLike | None = None) -> None:
        """Send actions, integers [K, n_agents], to environments `env_id` [K] or to all in order; returns at once.

        Raises IllegalAction for an action that is not available; then nothing was stepped.
        """
        self._envs.send(action, env_id)

    def recv(self, timeout: float | None = None) -> Step:
        """Wait for the next batch: the `batch_size` environments that are done first. `info["env_id"]` says which.

        Raises Timeout after `timeout` seconds; None waits for ever.
        """
        batch = self._envs.recv(timeout)
        obs, info = self._seen(batch)
        return obs, self._array(batch.reward), self._array(batch.terminated), self._array(batch.truncated), info

    def step(self, action: ArrayLike, env_id: ArrayLike | None = None) -> Step:
        """`send` and `recv`."""
        self.send(action, env_id)
        return self.recv()

    def reset(
        self,
        env_id: ArrayLike | None = None,
        *,
        seed: int | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Arrays, dict[str, NDArray[Any]]]:
        """Begin new episodes in environments `env_id` [K], or where `options["reset_mask"]` says so, or in all.

        With a seed, environment i is seeded with seed + i. Returns what belongs to those environments, in that order;
        of asynchronous environments the next batch, as `recv` does.
        """
        mask = (options or {}).get("reset_mask")
        if mask is not None:
            if env_id is not None:
                raise InvalidRequest("env_id and options['reset_mask'] both choose environments; give one")
            env_id = np.flatnonzero(mask)
        ids = None if env_id is None else np.atleast_1d(np.asarray(env_id))
        if ids is not None and not ids.size:
            raise InvalidRequest("no environment is to be reset; choose at least one")
        batch = self._envs.reset(seed, env_id=ids)
        return self._seen(batch, None if self.is_async else ids)

    def _seen(self, batch: Batch, slots: NDArray[Any] | None = None) -> tuple[Arrays, dict[str, NDArray[Any]]]:
        return self._named(SIGHTS, batch, slots), self._named(INFO, batch, slots)

    def _named(self, names: dict[str, str], batch: Batch, slots: NDArray[Any] | None) -> Arrays:
        fields = {name: of_batch for name, of_batch in names.items() if of_batch in self._fields}
        return {name: self._array(getattr(batch, of_batch), slots) for name, of_batch in fields.items()}

    def _array(self, array: NDArray[Any], slots: NDArray[Any] | None = None) -> NDArray[Any]:
        own: NDArray[Any] = array if slots is None else array[slots]
        return own.copy() if self._copy and slots is None else own  # an array of indices copies

    def close(self) -> None:
        """End the pool. A second time does nothing."""
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
        num_envs: environments (N).
        batch_size: environments in a batch (M); None or 0 for all of them, fewer for asynchronous stepping.
        num_threads: worker threads; 0 for the cores this process may use, less one for the learner.
        seed: environment i is seeded with seed + i.
        max_episode_steps: steps after which an episode is truncated; None for the scenario's own limit.
        thread_affinity_offset: -1, no pinning, is the only value.
        copy: as in `EnvPool`.
        settings: `autoreset`, `rules`, `fields`, `wait` and the like, as `smaclite_pool.make` takes them.
    """
    if env_type not in ("gymnasium", "gym"):
        raise InvalidRequest(f'env_type={env_type!r}: "gymnasium" and "gym" are possible')
    if thread_affinity_offset != -1:
        raise InvalidRequest(f"thread_affinity_offset={thread_affinity_offset}: threads are not pinned; -1 is possible")
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
        "batch_size": envs.batch_size,
        "num_threads": num_threads,
        "max_num_players": 1,
        "seed": seed,
        "max_episode_steps": envs.episode_limit,
        "thread_affinity_offset": thread_affinity_offset,
        **settings,
    }
    return EnvPool(envs, config, copy=copy)


def make_gymnasium(task_id: str | PathLike[str], **kwargs: Any) -> EnvPool:
    """`make` with env_type="gymnasium"."""
    return make(task_id, "gymnasium", **kwargs)


def make_spec(task_id: str | PathLike[str], **kwargs: Any) -> EnvSpec:
    """What `make` would give environments: a pool is started for it and closed again."""
    with make(task_id, **kwargs) as envs:
        return envs.spec


def list_all_envs() -> list[str]:
    """The standard scenarios."""
    return scenarios()
