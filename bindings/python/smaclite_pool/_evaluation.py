"""Evaluation of a policy: a given number of episodes, without favour for short ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InvalidRequest

if TYPE_CHECKING:
    from . import Envs
    from ._wrapper import Wrapper


@dataclass(frozen=True)
class Evaluation:
    """The episodes that `evaluate` counted, ordered by environment and, within each, by time."""

    env_id: NDArray[np.int32]
    """int32 [episodes]: the environment of each episode."""
    returns: NDArray[np.float32]
    """float32 [episodes]: the sum of rewards of each."""
    lengths: NDArray[np.int32]
    """int32 [episodes]: the number of steps of each."""
    won: NDArray[np.bool_]
    """bool [episodes]: whether the agents won it."""

    def __len__(self) -> int:
        return len(self.returns)

    @property
    def win_rate(self) -> float:
        """The share of episodes that the agents won, 0 to 1."""
        return float(self.won.mean())

    @property
    def mean_return(self) -> float:
        """The mean of `returns`."""
        return float(self.returns.mean(dtype=np.float64))

    @property
    def mean_length(self) -> float:
        """The mean of `lengths`."""
        return float(self.lengths.mean())


def evaluate(
    envs: Envs | Wrapper,
    policy: Callable[[Any], ArrayLike],
    episodes: int,
    seed: int | None = None,
) -> Evaluation:
    """Play a policy and return the episodes.

    Of every environment the first episodes count, the same number in each (to within one). To count the first
    episodes that end anywhere would favour short ones.

        result = smaclite_pool.evaluate(envs, policy, episodes=200, seed=1)
        print(result.win_rate, result.mean_return)

    Args:
        envs: the environments, or a wrapper of them, with the fields `battle_won`, `episode_return` and
            `episode_length`, and with autoreset. All of them are reset first; afterwards they are somewhere
            in an episode.
        policy: a function from a batch to its actions, integers [M, n_agents]. Whether it draws actions or
            takes the most probable ones is its own matter.
        episodes: how many episodes count, at least 1.
        seed: as for `Envs.reset`: environment i is seeded with seed + i.

    Raises:
        InvalidRequest: `episodes` is below 1, or the environments have no autoreset.
        AttributeError: the lane omits a field.
        IllegalAction: the policy chose an action that is not available.
    """
    if episodes < 1:
        raise InvalidRequest(f"episodes must be at least 1, got {episodes}")
    if envs.autoreset == "disabled":
        raise InvalidRequest('evaluate needs autoreset="next_step" or "same_step", got "disabled"')
    quota = np.full(envs.num_envs, episodes // envs.num_envs)
    quota[: episodes % envs.num_envs] += 1
    counts = np.zeros(envs.num_envs, np.int64)
    counted: list[tuple[int, int, float, int, bool]] = []
    batch = envs.reset(seed=seed)
    while True:
        for slot in np.flatnonzero(batch.terminated | batch.truncated):
            env = int(batch.env_id[slot])
            if counts[env] < quota[env]:
                result = (batch.episode_return[slot], batch.episode_length[slot], batch.battle_won[slot])
                counted.append((env, int(counts[env]), *result))
            counts[env] += 1
        if len(counted) == episodes:
            break
        batch = envs.step(policy(batch), batch.env_id)
    env_id, _, returns, lengths, won = zip(*sorted(counted), strict=True)
    return Evaluation(
        np.array(env_id, np.int32),
        np.array(returns, np.float32),
        np.array(lengths, np.int32),
        np.array(won, np.bool_),
    )
