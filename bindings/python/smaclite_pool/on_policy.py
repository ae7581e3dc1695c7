"""on-policy's ShareVecEnv over one pool: MAPPO's own code base, without a process for every environment.

    from smaclite_pool.on_policy import ShareVecEnv

    envs = ShareVecEnv("2s3z", num_envs=8, seed=1)
    obs, share_obs, available_actions = envs.reset()
    for _ in range(200):
        actions = available_actions.argmax(axis=2)[..., None]         # [B, A, 1], the first legal action
        obs, share_obs, rewards, dones, infos, available_actions = envs.step(actions)
    envs.close()

In `onpolicy/scripts/train/train_smac.py` it takes the place of what `make_train_env` returns:
`ShareVecEnv(all_args.map_name, all_args.n_rollout_threads, seed=all_args.seed)`; `num_agents` is `envs.n_agents`.

`obs`, `share_obs` and `available_actions` are read-only views of shared memory, the state the same one for every agent.
on-policy's buffers copy what they keep; whoever keeps such arrays of more than the last two steps needs `max_held_batches`.
"""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._native import Batch, Envs, connect, make
from .errors import InvalidRequest

__all__ = ["Discrete", "ShareVecEnv"]

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Discrete:
    """An action space as on-policy knows it, by the name of its class."""

    n: int
    """How many actions."""
    shape: tuple[int, ...] = ()


class Reset(NamedTuple):
    """What `reset` returns."""

    obs: Floats
    """[B, A, O]."""
    share_obs: Floats
    """[B, A, S]: the state, the same for every agent."""
    available_actions: Bools
    """[B, A, N]."""


class Step(NamedTuple):
    """What `step` returns; where an episode ended, `obs`, `share_obs` and `available_actions` are of the next one."""

    obs: Floats
    share_obs: Floats
    rewards: Floats
    """[B, A, 1]: the team's reward, the same for every agent."""
    dones: Bools
    """[B, A]: is the agent dead; for all agents true where the episode ended."""
    infos: list[list[dict[str, Any]]]
    """`infos[b][a]`, the same for every agent: `won` (did the episode that ended here end in a victory),
    `bad_transition` (did it run out of time), and the environment's counts so far: `battles_won`, `battles_game`,
    `battles_draw` (out of time), `restarts`.
    """
    available_actions: Bools


class ShareVecEnv:
    """`num_envs` environments that begin their next episode by themselves.

    Args:
        scenario: a standard scenario or the path of a scenario file.
        num_envs: environments (B).
        seed: environment i begins with seed + i.
        threads, episode_limit, rules, max_held_batches: as in `smaclite_pool.make`.
    """

    closed = False

    def __init__(
        self,
        scenario: str | PathLike[str],
        num_envs: int,
        *,
        seed: int = 0,
        threads: int | None = None,
        episode_limit: int | Literal["default"] | None = "default",
        rules: Literal["smaclite", "paper"] = "smaclite",
        max_held_batches: int = 4,
    ) -> None:
        self._serve(
            make(
                scenario,
                num_envs,
                seed=seed,
                threads=threads,
                autoreset="same_step",
                episode_limit=episode_limit,
                rules=rules,
                max_held_batches=max_held_batches,
            )
        )

    @classmethod
    def connect(cls, pool: str, lane: str | None = None, *, timeout: float = 0.0) -> ShareVecEnv:
        """Attach to a running pool in place of starting one, as `smaclite_pool.connect` does. It is served by
        `smaclite-pool serve 2s3z:8 --autoreset same_step --name train`.
        """
        envs = connect(pool, lane, timeout=timeout)
        if envs.autoreset != "same_step" or envs.batch_size != envs.num_envs:
            served = f"autoreset {envs.autoreset}, {envs.batch_size} of {envs.num_envs} environments in a batch"
            envs.close()
            raise InvalidRequest(f"pool `{pool}` serves {served}; serve all at once, with --autoreset same_step")
        self = cls.__new__(cls)
        self._serve(envs)
        return self

    def _serve(self, envs: Envs) -> None:
        self._envs = envs
        self.num_envs, self.n_agents = envs.num_envs, envs.n_agents
        self.observation_space = [[envs.obs_size] for _ in range(envs.n_agents)]
        self.share_observation_space = [[envs.state_size] for _ in range(envs.n_agents)]
        self.action_space = [Discrete(envs.n_actions) for _ in range(envs.n_agents)]
        self._counts = np.zeros((envs.num_envs, 3), np.int64)  # won, fought, out of time

    def reset(self) -> Reset:
        """Begin a new episode in every environment."""
        batch = self._envs.reset()
        return Reset(batch.obs, self._shared(batch), batch.avail_actions)

    def step_async(self, actions: ArrayLike) -> None:
        """Send whole numbers, [B, A, 1] or [B, A], of any type. Raises IllegalAction; then nothing was stepped."""
        given = np.asarray(actions)
        chosen = given.astype(np.int32).reshape(self.num_envs, self.n_agents)
        if not np.issubdtype(given.dtype, np.integer) and np.any(chosen != given.reshape(chosen.shape)):
            raise InvalidRequest("actions are whole numbers")
        self._envs.send(chosen)

    def step_wait(self) -> Step:
        """Wait for the step."""
        batch = self._envs.recv()
        truncated = batch.truncated
        ended = batch.terminated | truncated
        self._counts += np.stack((batch.battle_won, ended, truncated), axis=1)
        rewards = batch.reward[:, None, None].repeat(self.n_agents, axis=1)  # a copy: on-policy keeps an episode's
        dones = ~batch.alive | ended[:, None]
        infos = self._infos(batch.battle_won.tolist(), truncated.tolist())
        return Step(batch.obs, self._shared(batch), rewards, dones, infos, batch.avail_actions)

    def step(self, actions: ArrayLike) -> Step:
        """`step_async` and `step_wait`."""
        self.step_async(actions)
        return self.step_wait()

    def close(self) -> None:
        """Give the pool back. A second time does nothing."""
        self._envs.close()
        self.closed = True

    @property
    def unwrapped(self) -> ShareVecEnv:
        """Itself."""
        return self

    def _shared(self, batch: Batch) -> Floats:
        return np.broadcast_to(batch.state[:, None, :], (self.num_envs, self.n_agents, self._envs.state_size))

    def _infos(self, won: list[bool], out_of_time: list[bool]) -> list[list[dict[str, Any]]]:
        infos = []
        for (battles_won, battles_game, battles_draw), now, late in zip(
            self._counts.tolist(), won, out_of_time, strict=True
        ):
            info = {
                "battles_won": battles_won,
                "battles_game": battles_game,
                "battles_draw": battles_draw,
                "restarts": 0,
                "bad_transition": late,
                "won": now,
            }
            infos.append([info] * self.n_agents)
        return infos
