"""Shared by several integrations: names of observations and infos, and single battles. Needs no framework."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._native import Batch, Envs, make
from ..errors import InvalidRequest

OBSERVATION_KEYS = {"obs": "obs", "state": "state", "action_mask": "avail_actions"}
"""Keys of the observations of vector environments, and the field of a batch that each one contains."""

ENEMY_OBSERVATION_KEYS = {
    "enemy_obs": "enemy_obs",
    "enemy_state": "enemy_state",
    "enemy_action_mask": "enemy_avail_actions",
}
"""The same of the enemies, where actions play both sides."""

OUTCOME_FIELDS = ("battle_won", "dead_allies", "dead_enemies")
"""Fields of a batch in the info of a single battle."""

INFO_FIELDS = (*OUTCOME_FIELDS, "episode_return", "episode_length")
"""Fields of a batch in the infos of vector environments. `Envs.fields` has their dtypes."""


ENEMY_FIELDS = ("enemy_obs", "enemy_avail_actions", "enemy_reward")
"""Fields of the enemies, where actions play both sides."""

SHARE_FIELDS = ("reward_agents", "enemy_reward_agents")
"""Fields of the shares of single units in the rewards."""

SINGLE_BATTLE_FIELDS = (*OBSERVATION_KEYS.values(), *INFO_FIELDS, *ENEMY_FIELDS, "snapshot")
"""Fields of the lane of a single battle; a lane leaves those out that it cannot have."""


def check_one_side(envs: Envs) -> Envs:
    """The environments, if a script plays their enemies. Raises InvalidRequest if actions play them, too."""
    if envs.sides == "both":
        raise InvalidRequest(
            "sides must be 'allies' here, got 'both'; smaclite_pool.make, connect(side=...) and PettingZoo's "
            "environment play both sides"
        )
    return envs


@dataclass(frozen=True)
class EnemyTimeStep:
    """The enemies of a battle after a reset or step, where actions play both sides."""

    obs: NDArray[np.float32]
    """float32 [n_enemies, enemy_obs_size]."""
    avail_actions: NDArray[np.bool_]
    """bool [n_enemies, n_enemy_actions]."""
    reward: float
    """The enemies' reward."""


@dataclass(frozen=True)
class TimeStep:
    """A battle after a reset or step. Arrays are copies, as a lane limits the batches that can be held."""

    obs: NDArray[np.float32]
    """float32 [n_agents, obs_size]."""
    avail_actions: NDArray[np.bool_]
    """bool [n_agents, n_actions]."""
    state: NDArray[np.float32]
    """float32 [state_size]."""
    reward: float
    """The team reward."""
    terminated: bool
    truncated: bool
    episode_return: float
    """Sum of rewards so far."""
    episode_length: int
    """Steps so far."""
    snapshot: NDArray[np.uint8]
    """uint8 [snapshot_size]: the battle, to restore it later."""
    info: dict[str, Any]
    """`battle_won` (bool), `dead_allies` and `dead_enemies` (int)."""
    enemies: EnemyTimeStep | None
    """If actions play both sides."""
    shares: list[float] | None
    """The share of each unit of `rows` in the reward of its team, if the battle has them."""

    @property
    def ended(self) -> bool:
        """Whether the episode has ended."""
        return self.terminated or self.truncated

    @property
    def rows(self) -> list[NDArray[np.float32]]:
        """The observation of each agent, and then of each enemy if actions play both sides."""
        return [*self.obs, *(self.enemies.obs if self.enemies else ())]

    @property
    def masks(self) -> list[NDArray[np.bool_]]:
        """The available actions of the units of `rows`."""
        return [*self.avail_actions, *(self.enemies.avail_actions if self.enemies else ())]

    @property
    def rewards(self) -> list[float]:
        """The reward of the team of each unit of `rows`."""
        of_enemies = [self.enemies.reward] * len(self.enemies.obs) if self.enemies else []
        return [self.reward] * len(self.obs) + of_enemies

    @property
    def totals(self) -> dict[str, Any]:
        """`info` with `episode_return` and `episode_length`."""
        return {**self.info, "episode_return": self.episode_return, "episode_length": self.episode_length}

    @staticmethod
    def of(batch: Batch) -> TimeStep:
        """The only environment of a batch."""
        enemies = None
        if "enemy_obs" in batch:
            enemies = EnemyTimeStep(
                obs=batch.enemy_obs[0].copy(),
                avail_actions=batch.enemy_avail_actions[0].copy(),
                reward=batch.enemy_reward[0].item(),
            )
        shares = [name for name in SHARE_FIELDS if name in batch]
        return TimeStep(
            obs=batch.obs[0].copy(),
            avail_actions=batch.avail_actions[0].copy(),
            state=batch.state[0].copy(),
            reward=batch.reward[0].item(),
            terminated=batch.terminated[0].item(),
            truncated=batch.truncated[0].item(),
            episode_return=batch.episode_return[0].item(),
            episode_length=batch.episode_length[0].item(),
            snapshot=batch.snapshot[0].copy(),
            info={name: getattr(batch, name)[0].item() for name in OUTCOME_FIELDS},
            enemies=enemies,
            shares=[share for name in shares for share in getattr(batch, name)[0].tolist()] or None,
        )


class SingleBattle:
    """A pool of one environment, which waits for a reset when its battle has ended.

    A reset uses the seed that it is given, or else the seed of `seed_next_reset`. Without either the first
    reset uses the seed of `settings`, and later ones continue the random generator.

    Args:
        scenario: a standard scenario or the path of a scenario file.
        settings: `seed`, `episode_limit`, `rules` and other arguments of `smaclite_pool.make`, except
            `fields`.
        both_sides: whether `sides="both"` is accepted among them; then `agents` has the enemies too.
        shares: whether steps have the `shares` of single units.

    Raises InvalidRequest, ScenarioError and StartError.
    """

    def __init__(
        self,
        scenario: str | PathLike[str],
        settings: Mapping[str, Any],
        *,
        both_sides: bool = False,
        shares: bool = False,
    ) -> None:
        if "fields" in settings:
            raise InvalidRequest("a single battle has all fields; remove `fields`")
        fields = [*SINGLE_BATTLE_FIELDS, *(SHARE_FIELDS if shares else ())]
        # Frameworks run many of these per machine, where a thread that spins takes CPU time from the others.
        defaults = {"threads": 1, "wait": "block", "max_held_batches": 2}
        self.envs = make(scenario, 1, autoreset="disabled", fields=fields, **{**defaults, **settings})
        if not both_sides:
            check_one_side(self.envs)
        self.agents = [f"agent_{agent}" for agent in range(self.envs.n_agents)]
        if self.envs.sides == "both":
            self.agents += [f"enemy_{enemy}" for enemy in range(self.envs.n_enemies)]
        self._next_seed: int | None = None
        self._last: TimeStep | None = None

    @property
    def last(self) -> TimeStep:
        """The result of the last step or reset. Raises InvalidRequest before the first reset."""
        if self._last is None:
            raise InvalidRequest("no battle has begun; call reset first")
        return self._last

    @property
    def has_begun(self) -> bool:
        """Whether there was a reset."""
        return self._last is not None

    def seed_next_reset(self, seed: int) -> None:
        """Use this seed for the next reset that is not given one."""
        self._next_seed = seed

    def reset(self, seed: int | None = None) -> TimeStep:
        """Begin a battle."""
        self._last = TimeStep.of(self.envs.reset(self._next_seed if seed is None else seed))
        self._next_seed = None
        return self._last

    def restore(self, snapshot: NDArray[np.uint8], seed: int | None = None) -> TimeStep:
        """Continue from a snapshot; with a seed, with execution orders drawn from it.

        Raises InvalidRequest before the first reset, and for a snapshot of another scenario or rule set.
        """
        rng = "keep" if seed is None else "reseed"
        self._last = TimeStep.of(self.envs.restore(snapshot, rng=rng, seed=seed))
        return self._last

    def step(self, actions: Sequence[int | np.integer[Any]] | NDArray[Any]) -> TimeStep:
        """Step by one action per agent, including dead agents.

        Raises IllegalAction for an unavailable action, and InvalidRequest for a wrong number of actions or
        after the end of the battle; nothing is stepped then.
        """
        if self.last.ended:
            raise InvalidRequest("the battle has ended; call reset first")
        given, expected = np.asarray(actions).shape, (len(self.agents),)
        if given != expected:
            raise InvalidRequest(f"actions must have one integer per agent, shape {expected}, got {given}")
        joint: Any = [actions]
        self._last = TimeStep.of(self.envs.step(joint))
        return self._last

    def step_by_name(self, actions: Mapping[str, int | np.integer[Any]]) -> TimeStep:
        """`step` by a dict with an action for every name in `agents`."""
        if not self.last.ended and (missing := [agent for agent in self.agents if agent not in actions]):
            raise InvalidRequest(
                f"actions must contain every agent, missing {', '.join(missing)}; dead agents use 0 (no-op)"
            )
        return self.step([int(actions.get(agent, 0)) for agent in self.agents])

    @property
    def sizes(self) -> dict[str, tuple[int, int]]:
        """`obs_size` and `n_actions` by name."""
        envs = self.envs
        own = dict.fromkeys(self.agents[: envs.n_agents], (envs.obs_size, envs.n_actions))
        sizes = (envs.enemy_obs_size, envs.n_enemy_actions)
        return own | dict.fromkeys(self.agents[envs.n_agents :], sizes)

    def close(self) -> None:
        """End the pool. Calling it again has no effect."""
        self.envs.close()
