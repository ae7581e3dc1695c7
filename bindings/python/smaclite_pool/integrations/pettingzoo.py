"""PettingZoo: one battle with the parallel or the AEC interface (extra `pettingzoo`).

    from smaclite_pool.integrations.pettingzoo import parallel_env

    env = parallel_env("2s3z")
    observations, infos = env.reset(seed=1)
    while env.agents:
        actions = {
            agent: env.action_space(agent).sample(observation["action_mask"])
            for agent, observation in observations.items()
        }
        observations, rewards, terminations, truncations, infos = env.step(actions)
    env.close()

`parallel_env` is the environment. `raw_env` converts it to the AEC interface, and `env` also adds
PettingZoo's checks of actions and of the order of calls. All take the same arguments.

Agents are "agent_0", "agent_1", ...; all of them stay in `agents` until the battle ends. Dead agents observe
zeros, and their only available action is 0 (no-op). With `sides="both"`, "enemy_0", "enemy_1", ... are agents
too, with the observations, actions and rewards of their side. Single battles are slow; for training, step
many at once with `smaclite_pool.make` or an integration with vector environments.

For wrappers and learners that know only plain observations, such as those of SuperSuit:

    import supersuit
    from smaclite_pool.integrations.pettingzoo import parallel_env

    env = parallel_env("3m", action_mask="info", illegal_actions="stop")
    envs = supersuit.pettingzoo_env_to_vec_env_v1(supersuit.frame_stack_v1(env, 4))
    envs = supersuit.concat_vec_envs_v1(envs, 8, base_class="gymnasium")

Before its first reset, an environment can be copied and pickled: by its arguments. Without a seed among them
each copy draws its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .._extra import extra
from .._layout import Bounds, field_bounds
from .._render import RENDER_FPS, RENDER_MODES, BattleViewer, check_rendering
from ..errors import InvalidRequest
from ._common import (
    FIXED_SETTINGS,
    CopiedByArguments,
    IllegalActions,
    SingleBattle,
    TimeStep,
    check_keywords,
    stop_unavailable,
    stops,
)

with extra("pettingzoo"):
    from gymnasium.spaces import Box, Dict
    from pettingzoo import AECEnv, ParallelEnv
    from pettingzoo.utils import BaseParallelWrapper, parallel_to_aec, wrappers

    from ._spaces import AvailableDiscrete, bounded_box, update_masks

__all__ = ["env", "parallel_env", "raw_env"]

Observation: TypeAlias = "dict[str, NDArray[Any]] | NDArray[Any]"
Scenario: TypeAlias = "str | PathLike[str]"


# Named as PettingZoo names its environments.
class parallel_env(CopiedByArguments, ParallelEnv[str, Observation, np.int64]):
    """One battle with PettingZoo's parallel interface.

    Each agent observes `{"observation": float32 [obs_size], "action_mask": int8 [n_actions]}`, copies that
    you can keep and change. Every agent gets its team's reward, or its own share in it; termination,
    truncation and info (`battle_won`, `dead_allies`, `dead_enemies`) are the same for all.

    Args:
        scenario: a standard scenario (see `smaclite_pool.scenarios()`) or the path of a scenario file.
        render_mode: None; "rgb_array": `render()` returns a picture; "human": a window shows every step
            (needs pygame and a display).
        render_speed: of the window: 1 for the speed of the battle, two steps per second; 0.25 for slow
            motion; None for no waiting.
        action_mask: where the mask is: in the "observation", or in the "info" of the agent, as `action_mask`;
            an observation is then the plain float32 [obs_size].
        illegal_actions: "error": an unavailable action raises IllegalAction. "stop": agents given an
            unavailable action stop instead; for learners that ignore action masks.
        own_rewards: whether each agent gets its share in the reward of its team, `reward_agents`, instead of
            the whole.
        settings: `seed`, `episode_limit`, `rules` and other arguments of `smaclite_pool.make`.

    Raises InvalidRequest, ScenarioError and StartError.
    """

    picture_size = (640, 640)

    def __init__(
        self,
        scenario: Scenario = "2s3z",
        *,
        render_mode: str | None = None,
        render_speed: float | None = 1.0,
        action_mask: Literal["observation", "info"] = "observation",
        illegal_actions: IllegalActions = "error",
        own_rewards: bool = False,
        **settings: Any,
    ) -> None:
        check_keywords(type(self), settings, FIXED_SETTINGS)
        if action_mask not in ("observation", "info"):
            raise InvalidRequest(f'action_mask must be "observation" or "info", got {action_mask!r}')
        self._is_plain, self._stops = action_mask == "info", stops(illegal_actions)
        self.render_mode = render_mode
        check_rendering(render_mode, render_speed)
        self._battle = SingleBattle(scenario, settings, both_sides=True, shares=own_rewards)
        envs = self._battle.envs
        self._viewer = BattleViewer(envs, *self.picture_size, render_mode, render_speed)
        self.metadata = {
            "name": f"smaclite_pool_{envs.spec.scenario}",
            "render_modes": list(RENDER_MODES),
            "render_fps": RENDER_FPS,
            "is_parallelizable": True,
        }
        self.possible_agents = self._battle.agents
        self.agents: list[str] = []
        sizes, bounds = self._battle.sizes, self._battle.obs_bounds
        space = _observation_box if self._is_plain else _observation_space
        self.observation_spaces = {agent: space(bounds[agent], n) for agent, (_, n) in sizes.items()}
        self.action_spaces = {agent: AvailableDiscrete(n) for agent, (_, n) in sizes.items()}
        self.state_space = bounded_box(field_bounds(envs)["state"], (envs.spec.state_size,))

    def observation_space(self, agent: str) -> Dict | Box:
        """The observation space of an agent; the same object every time."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> AvailableDiscrete:
        """The action space of an agent; the same object every time."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Begin a new battle. Without a seed the random generator continues.

        With `options["snapshot"]` the battle continues from a snapshot, as by `restore`, and wrappers begin
        to count anew; if it had ended there, `agents` is empty. Other options are ignored.
        """
        return self._begin(self._battle.reset(seed, options))

    def step(
        self, actions: Mapping[str, int | np.integer[Any]]
    ) -> tuple[
        dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:
        """Step the battle by one action per agent; dead agents use 0 (no-op).

        Raises IllegalAction for an unavailable action, and InvalidRequest if an agent is missing or
        unknown, or the battle has ended; nothing is stepped then.
        """
        if self._stops and self._battle.has_begun and isinstance(actions, Mapping):
            actions = self._stopped(actions)
        now = self._battle.step_by_name(actions)
        self._viewer.observe(now.state)
        observations, infos = self._observe(now), self._infos(now)
        rewards = dict(zip(self.agents, now.shares or now.rewards, strict=True))
        terminations = dict.fromkeys(self.agents, now.terminated)
        truncations = dict.fromkeys(self.agents, now.truncated)
        if now.ended:
            self.agents = []
        return observations, rewards, terminations, truncations, infos

    def _stopped(self, actions: Mapping[str, int | np.integer[Any]]) -> dict[str, Any]:
        masks = dict(zip(self.possible_agents, self._battle.last.masks, strict=True))
        return {
            agent: stop_unavailable(action, masks[agent]) if agent in masks else action
            for agent, action in actions.items()
        }

    def _observe(self, now: TimeStep) -> dict[str, Observation]:
        update_masks(self.action_spaces, now.masks)
        if self._is_plain:
            return dict(zip(self.possible_agents, map(np.copy, now.rows), strict=True))
        return {
            agent: {"observation": obs, "action_mask": mask.astype(np.int8)}
            for agent, obs, mask in zip(self.possible_agents, now.rows, now.masks, strict=True)
        }

    def _infos(self, now: TimeStep) -> dict[str, dict[str, Any]]:
        infos: dict[str, dict[str, Any]] = {agent: now.info.copy() for agent in self.agents}
        if self._is_plain and self.agents:
            for info, mask in zip(infos.values(), now.masks, strict=True):
                info["action_mask"] = mask.astype(np.int8)
        return infos

    def save(self) -> NDArray[np.uint8]:
        """The battle as it is now, uint8 [snapshot_size], for `restore`.

        Raises InvalidRequest before the first reset.
        """
        return self._battle.last.snapshot.copy()

    def restore(
        self, snapshot: NDArray[np.uint8], seed: int | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Continue from a snapshot, and return observations and infos as after a reset.

        Without a seed the battle goes on as it would have gone on; with one it has other execution orders.
        Wrappers do not know of it; `reset(options={"snapshot": snapshot})` does the same, and they do. Raises
        InvalidRequest for a snapshot of another scenario or rule set.
        """
        return self._begin(self._battle.restore(snapshot, seed))

    def _begin(self, now: TimeStep) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        self.agents = [] if now.ended else self.possible_agents[:]
        self._viewer.observe(now.state)
        return self._observe(now), self._infos(now)

    def state(self) -> NDArray[np.float32]:
        """The global state, float32 [state_size], for training only.

        Raises InvalidRequest before the first reset.
        """
        return self._battle.last.state.copy()

    def render(self) -> NDArray[np.uint8] | None:
        """The battle from above: uint8 [640, 640, 3] with "rgb_array", or in a window with "human".

        Raises InvalidRequest before the first reset, and PoolError if a window is needed and pygame is not
        installed or there is no display.
        """
        return self._viewer.render(self._battle.last.state)

    def __repr__(self) -> str:
        return self._battle.description(self)

    def close(self) -> None:
        """End the pool. Calling it again has no effect."""
        self.agents = []
        self._viewer.close()
        self._battle.close()


def _observation_space(bounds: Bounds, n_actions: int) -> Dict:
    observation = _observation_box(bounds, n_actions)
    return Dict(observation=observation, action_mask=Box(0, 1, (n_actions,), np.int8))


def _observation_box(bounds: Bounds, n_actions: int) -> Box:
    return bounded_box(bounds, bounds[0].shape)


class _BeginsWithAgents(BaseParallelWrapper[str, Observation, np.int64]):
    """PettingZoo's AEC interface divides by the number of agents: in a battle that has ended, by zero."""

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        begun = super().reset(seed, options)
        if not self.env.agents:
            raise InvalidRequest(
                "the battle of this snapshot has ended, so no agent can act; see parallel_env"
            )
        return begun


def raw_env(scenario: Scenario = "2s3z", **settings: Any) -> AECEnv[str, Observation, np.int64]:
    """One battle with PettingZoo's AEC interface (agents act in turn); arguments as in `parallel_env`.

    A reset to a battle that has ended raises InvalidRequest.
    """
    return parallel_to_aec(_BeginsWithAgents(parallel_env(scenario, **settings)))


def env(scenario: Scenario = "2s3z", **settings: Any) -> AECEnv[str, Observation, np.int64]:
    """`raw_env` with PettingZoo's checks of actions and of the order of calls."""
    checked = wrappers.AssertOutOfBoundsWrapper(raw_env(scenario, **settings))
    return wrappers.OrderEnforcingWrapper(checked)
