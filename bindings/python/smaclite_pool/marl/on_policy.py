"""on-policy, the code base of MAPPO: its `ShareVecEnv` interface over one pool, without further processes.

    from smaclite_pool.marl.on_policy import ShareVecEnv

    envs = ShareVecEnv("2s3z", num_envs=8, seed=1)
    obs, share_obs, available_actions = envs.reset()
    for _ in range(200):
        actions = available_actions.argmax(axis=2)[..., None]         # [B, A, 1], the first available action
        obs, share_obs, rewards, dones, infos, available_actions = envs.step(actions)
    envs.close()

In `onpolicy/scripts/train/train_smac.py`, replace the result of `make_train_env` by
`ShareVecEnv(all_args.map_name, all_args.n_rollout_threads, seed=all_args.seed)`; `num_agents` is
`envs.n_agents`.

`obs`, `share_obs` and `available_actions` are read-only views of shared memory; the state is the same memory
for every agent. on-policy's buffers copy what they keep. Code that keeps these arrays for more than two steps
needs a higher `max_held_batches`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._layout import limit_ends, terminates_at_limit
from .._native import Batch, Envs, connect, make, scenario
from .._requirements import require_synchronous
from ..errors import InvalidRequest
from ..integrations._common import check_one_side, require_fields

__all__ = ["Discrete", "ShareVecEnv"]

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Discrete:
    """An action space; on-policy recognises it by the name of its class."""

    n: int
    """Number of actions."""
    shape: tuple[int, ...] = ()


class Reset(NamedTuple):
    """The result of `reset`; A is `n_agents`, O `obs_size`, S `state_size`, N `n_actions`."""

    obs: Floats
    """float32 [B, A, O]."""
    share_obs: Floats
    """float32 [B, A, S]: the state, the same for all agents."""
    available_actions: Bools
    """bool [B, A, N]."""


class Step(NamedTuple):
    """The result of `step`. Where an episode ended, the observations are those of the next episode."""

    obs: Floats
    share_obs: Floats
    rewards: Floats
    """float32 [B, A, 1]: the team reward, the same for all agents."""
    dones: Bools
    """bool [B, A]: whether the agent is dead; True for all agents where the episode ended."""
    infos: list[list[dict[str, Any]]]
    """`infos[b][a]`, the same for all agents.

    `won` (bool: the episode ended with a victory), `bad_transition` (bool: it reached the episode limit), and
    counts of the environment: `battles_won`, `battles_game`, `battles_draw` (reached the limit) and
    `restarts`.
    """
    available_actions: Bools


class ShareVecEnv:
    """`num_envs` environments with same-step autoreset.

    Args:
        scenario: a standard scenario or the path of a scenario file.
        num_envs: number of environments (B).
        seed: environment i is seeded with seed + i; None for a random seed.
        threads, episode_limit, rules, opponent, rewards, max_held_batches: as in `smaclite_pool.make`.

    Raises InvalidRequest, ScenarioError and StartError.
    """

    closed = False

    def __init__(
        self,
        scenario: str | PathLike[str],
        num_envs: int,
        *,
        seed: int | None = None,
        threads: int | None = None,
        episode_limit: int | Literal["default"] | None = "default",
        rules: Literal["smaclite", "paper", "starcraft", "starcraft-1"] = "smaclite",
        opponent: str | Mapping[str, float] | None = None,
        rewards: dict[str, Any] | None = None,
        max_held_batches: int = 4,
    ) -> None:
        self._serve(
            make(
                scenario,
                num_envs,
                seed=seed,
                threads=threads,
                autoreset_mode="SameStep",
                episode_limit=episode_limit,
                rules=rules,
                opponent=opponent,
                rewards=rewards,
                max_held_batches=max_held_batches,
            )
        )

    @classmethod
    def connect(cls, pool: str, lane: str | None = None, *, timeout: float = 0.0) -> ShareVecEnv:
        """Attach to a running pool instead of starting one, as `smaclite_pool.connect` does.

        Start the pool with `smaclite-pool serve 2s3z:8 --autoreset-mode SameStep --name train`. Raises
        ConnectError, and InvalidRequest for a pool with other settings.
        """
        envs = connect(pool, lane, timeout=timeout)
        needed = ["obs", "state", "avail_actions", "alive", "battle_won"]
        try:
            if terminates_at_limit(scenario(envs)):
                needed += ["dead_allies", "episode_length"]
            require_synchronous(check_one_side(envs), f"the learner of pool `{pool}`", "SameStep")
            require_fields(envs, cls.__name__, needed)
        except BaseException:
            envs.close()
            raise
        self = cls.__new__(cls)
        self._serve(envs)
        return self

    def _serve(self, envs: Envs) -> None:
        spec = envs.spec
        self._envs, self._at_limit = envs, limit_ends(envs)
        self.num_envs, self.n_agents = spec.num_envs, spec.n_agents
        self.observation_space = [[spec.obs_size] for _ in range(spec.n_agents)]
        self.share_observation_space = [[spec.state_size] for _ in range(spec.n_agents)]
        self.action_space = [Discrete(spec.n_actions) for _ in range(spec.n_agents)]
        self._counts = np.zeros((spec.num_envs, 3), np.int64)  # won, all, reached the limit

    def reset(self) -> Reset:
        """Begin a new episode in every environment."""
        batch = self._envs.reset()
        return Reset(batch.obs, self._shared(batch), batch.avail_actions)

    def step_async(self, actions: ArrayLike) -> None:
        """Send whole numbers of any dtype, [B, A, 1] or [B, A].

        Raises InvalidRequest for another shape, for a fraction and for a number that does not fit into int32;
        nothing is stepped then.
        """
        given = np.asarray(actions)
        shape = (self.num_envs, self.n_agents)
        if given.shape == (*shape, 1):
            given = given[..., 0]
        elif given.shape != shape:
            raise InvalidRequest(
                f"actions must be an array of shape {(*shape, 1)} or {shape}, got {given.shape}"
            )
        if given.dtype.kind == "f":  # of networks; the pool refuses what is no number
            if not np.all(np.isfinite(given) & (np.rint(given) == given)):
                raise InvalidRequest(f"actions must be integers, got {given.dtype} with fractions")
            beyond = given[np.abs(given) >= 2**31]
            if beyond.size > 0:
                raise InvalidRequest(f"actions must fit into int32, got {beyond[0]:g}")
            given = given.astype(np.int64)
        self._envs.send(given)

    def step_wait(self) -> Step:
        """Wait for the result of the step. Raises IllegalAction if an action was unavailable."""
        batch = self._envs.recv()
        ended, at_limit = batch.terminated | batch.truncated, self._at_limit(batch)
        self._counts += np.stack((batch.battle_won, ended, at_limit), axis=1)
        # A copy, as on-policy keeps the rewards of an episode.
        rewards = batch.reward[:, None, None].repeat(self.n_agents, axis=1)
        dones = ~batch.alive | ended[:, None]
        infos = self._infos(batch.battle_won.tolist(), at_limit.tolist())
        return Step(batch.obs, self._shared(batch), rewards, dones, infos, batch.avail_actions)

    def step(self, actions: ArrayLike) -> Step:
        """`step_async`, then `step_wait`, with the errors of both."""
        self.step_async(actions)
        return self.step_wait()

    def close(self) -> None:
        """Close the environments. Calling it again has no effect."""
        self._envs.close()
        self.closed = True

    @property
    def unwrapped(self) -> ShareVecEnv:
        """This object."""
        return self

    def _shared(self, batch: Batch) -> Floats:
        return np.broadcast_to(
            batch.state[:, None, :], (self.num_envs, self.n_agents, self._envs.spec.state_size)
        )

    def _infos(self, won: list[bool], at_limit: list[bool]) -> list[list[dict[str, Any]]]:
        infos = []
        for (battles_won, battles_game, battles_draw), has_won, is_late in zip(
            self._counts.tolist(), won, at_limit, strict=True
        ):
            info = {
                "battles_won": battles_won,
                "battles_game": battles_game,
                "battles_draw": battles_draw,
                "restarts": 0,
                "bad_transition": is_late,
                "won": has_won,
            }
            infos.append([info] * self.n_agents)
        return infos
