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
from gymnasium.spaces import Box, Dict
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from ._battle import Battle, LegalActions, Moment, show_legal
from .errors import InvalidRequest

__all__ = ["ParallelBattle", "parallel_env"]

Observation: TypeAlias = dict[str, NDArray[Any]]


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
        self._battle = Battle(scenario, settings)
        envs = self._battle.envs
        self.metadata = {"name": f"smaclite_pool_{envs.scenario}", "render_modes": [], "is_parallelizable": True}
        self.render_mode = None
        self.possible_agents = self._battle.agents
        self.agents: list[str] = []
        self.observation_spaces = {agent: self._observation_space() for agent in self.possible_agents}
        self.action_spaces = {agent: LegalActions(envs.n_actions) for agent in self.possible_agents}
        self.state_space = Box(-1.0, 1.0, (envs.state_size,), np.float32)
        self._state: NDArray[np.float32] | None = None

    def _observation_space(self) -> Dict:
        envs = self._battle.envs
        observation = Box(-1.0, 1.0, (envs.obs_size,), np.float32)
        return Dict(observation=observation, action_mask=Box(0, 1, (envs.n_actions,), np.int8))

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
        now = self._battle.reset(seed)
        self.agents = self.possible_agents[:]
        return self._observe(now), self._infos(now)

    def step(
        self, actions: Mapping[str, int | np.integer[Any]]
    ) -> tuple[
        dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:
        """Step the battle by one action an agent, of the dead too (their no-op).

        Raises IllegalAction for an action that is not available, and InvalidRequest for agents without an action or
        after the battle's end; then nothing was stepped.
        """
        now = self._battle.step(actions)
        observations, infos = self._observe(now), self._infos(now)
        rewards = dict.fromkeys(self.agents, now.reward)
        terminations = dict.fromkeys(self.agents, now.terminated)
        truncations = dict.fromkeys(self.agents, now.truncated)
        if not self._battle.is_on:
            self.agents = []
        return observations, rewards, terminations, truncations, infos

    def _observe(self, now: Moment) -> dict[str, Observation]:
        self._state, masks = now.state, now.legal.view(np.int8)
        show_legal(self.action_spaces, masks)
        return {
            agent: {"observation": obs, "action_mask": mask}
            for agent, obs, mask in zip(self.possible_agents, now.obs, masks, strict=True)
        }

    def _infos(self, now: Moment) -> dict[str, dict[str, Any]]:
        return {agent: now.info.copy() for agent in self.agents}

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
        self._battle.close()


parallel_env = ParallelBattle
