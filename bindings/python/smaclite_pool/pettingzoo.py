"""PettingZoo's face: one battle as a `ParallelEnv` (extra `pettingzoo`).

    from smaclite_pool.pettingzoo import parallel_env

    env = parallel_env("2s3z")
    observations, infos = env.reset(seed=1)
    while env.agents:
        actions = {agent: env.action_space(agent).sample(seen["action_mask"]) for agent, seen in observations.items()}
        observations, rewards, terminations, truncations, infos = env.step(actions)
    env.close()

Agents are "agent_0", "agent_1", ...; all of them stay in `agents` until the battle ends, the dead with zeros for an
observation and the no-op alone in their mask. One battle is a slow way to play; to train fast, step many at once with
`smaclite_pool.make` or one of the vectorised faces.
"""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any, TypeAlias

import numpy as np
from gymnasium.spaces import Box, Dict, Discrete
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from ._native import Batch, make
from .errors import InvalidRequest

__all__ = ["LegalActions", "ParallelBattle", "parallel_env"]

Observation: TypeAlias = dict[str, NDArray[Any]]


class LegalActions(Discrete):
    """`Discrete(n_actions)` whose `sample()`, called without a mask, draws what is legal in the battle just now."""

    def __init__(self, n_actions: int) -> None:
        super().__init__(n_actions)
        self.legal = np.ones(n_actions, np.int8)

    def sample(self, mask: Any = None, probability: Any = None) -> np.int64:
        """A random action: under `mask`, int8 [n_actions], or by `probability`; with neither, of the legal ones."""
        if mask is None and probability is None:
            mask = self.legal
        return super().sample(mask, probability)


class ParallelBattle(ParallelEnv[str, Observation, np.int64]):
    """One battle with PettingZoo's parallel interface.

    Each agent observes `{"observation": float32 [obs_size], "action_mask": int8 [n_actions]}`, arrays of its own. Every
    agent gets the team's reward, and termination, truncation and info (`battle_won`, `dead_allies`, `dead_enemies`)
    are the same for all.

    Args:
        scenario: a standard scenario (see `smaclite_pool.scenarios()`) or the path of a scenario file.
        settings: `seed`, `episode_limit`, `rules` and the like, as `smaclite_pool.make` takes them.
    """

    def __init__(self, scenario: str | PathLike[str] = "2s3z", **settings: Any) -> None:
        self._envs = make(scenario, 1, autoreset="disabled", **{"threads": 1, **settings})
        envs = self._envs
        self.metadata = {"name": f"smaclite_pool_{envs.scenario}", "render_modes": [], "is_parallelizable": True}
        self.render_mode = None
        self.possible_agents = [f"agent_{i}" for i in range(envs.n_agents)]
        self.agents: list[str] = []
        self.observation_spaces = {agent: self._observation_space() for agent in self.possible_agents}
        self.action_spaces = {agent: LegalActions(envs.n_actions) for agent in self.possible_agents}
        self.state_space = Box(-np.inf, np.inf, (envs.state_size,), np.float32)
        self._state: NDArray[np.float32] | None = None

    def _observation_space(self) -> Dict:
        observation = Box(-1.0, 1.0, (self._envs.obs_size,), np.float32)
        return Dict(observation=observation, action_mask=Box(0, 1, (self._envs.n_actions,), np.int8))

    def observation_space(self, agent: str) -> Dict:
        """What the agent observes; the same object every time."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> LegalActions:
        """What the agent can do; the same object every time."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Begin a new battle; with a seed the generator starts anew, without one it goes on. `options` are ignored."""
        batch = self._envs.reset(seed)
        self.agents = self.possible_agents[:]
        return self._observe(batch), self._infos(batch)

    def step(
        self, actions: Mapping[str, int | np.integer[Any]]
    ) -> tuple[
        dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:
        """Step the battle by one action an agent, of the dead too (their no-op).

        Raises IllegalAction for an action that is not available, and InvalidRequest for agents without an action or
        after the battle's end; then nothing was stepped.
        """
        if not self.agents:
            raise InvalidRequest("no battle is on: reset begins one")
        if missing := [agent for agent in self.agents if agent not in actions]:
            raise InvalidRequest(f"no action was given for {', '.join(missing)}; the dead take 0, the no-op")
        batch = self._envs.step([[int(actions[agent]) for agent in self.agents]])
        observations, infos = self._observe(batch), self._infos(batch)
        rewards = dict.fromkeys(self.agents, batch.reward[0].item())
        terminations = dict.fromkeys(self.agents, batch.terminated[0].item())
        truncations = dict.fromkeys(self.agents, batch.truncated[0].item())
        if batch.terminated[0] or batch.truncated[0]:
            self.agents = []
        return observations, rewards, terminations, truncations, infos

    def _observe(self, batch: Batch) -> dict[str, Observation]:
        # Copies: learners keep observations, and a lane lets a learner hold few frames.
        obs, masks = batch.obs[0].copy(), batch.avail_actions[0].astype(np.int8)
        self._state = batch.state[0].copy()
        for agent, mask in zip(self.possible_agents, masks, strict=True):
            self.action_spaces[agent].legal = mask
        return {
            agent: {"observation": obs[i], "action_mask": masks[i]} for i, agent in enumerate(self.possible_agents)
        }

    def _infos(self, batch: Batch) -> dict[str, dict[str, Any]]:
        info = {name: getattr(batch, name)[0].item() for name in ("battle_won", "dead_allies", "dead_enemies")}
        return {agent: info.copy() for agent in self.agents}

    def state(self) -> NDArray[np.float32]:
        """The global state, float32 [state_size], for training only."""
        if self._state is None:
            raise InvalidRequest("there is no state before the first reset")
        return self._state.copy()

    def render(self) -> None:
        """Battles are not drawn."""

    def close(self) -> None:
        """End the pool. A second time does nothing."""
        self.agents = []
        self._envs.close()


parallel_env = ParallelBattle
