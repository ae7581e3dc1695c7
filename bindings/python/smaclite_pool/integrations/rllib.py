"""RLlib: one battle as a `MultiAgentEnv` of the new API stack (extra `rllib`).

    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.core.rl_module.multi_rl_module import MultiRLModuleSpec
    from ray.rllib.core.rl_module.rl_module import RLModuleSpec
    from ray.rllib.examples.rl_modules.classes.action_masking_rlm import ActionMaskingTorchRLModule
    from smaclite_pool.integrations.rllib import BattleMultiAgentEnv, log_team

    hidden = {"head_fcnet_hiddens": [64, 64]}
    shared = RLModuleSpec(module_class=ActionMaskingTorchRLModule, model_config=hidden)
    config = (
        PPOConfig()
        .environment(BattleMultiAgentEnv, env_config={"scenario": "2s3z"})
        .multi_agent(policies={"shared"}, policy_mapping_fn=lambda agent, episode, **_: "shared")
        .rl_module(rl_module_spec=MultiRLModuleSpec(rl_module_specs={"shared": shared}))
        .callbacks(on_episode_end=log_team)
        .env_runners(num_env_runners=0, rollout_fragment_length=100)
        .training(train_batch_size=200, minibatch_size=100, num_epochs=1)
    )
    algorithm = config.build_algo()
    metrics = algorithm.train()["env_runners"]
    print(metrics["team_return"], metrics["win_rate"])
    algorithm.stop()

Agents are "agent_0", "agent_1", ...; dead agents observe zeros, and their only available action is 0 (no-op).
A module that ignores the mask soon chooses an unavailable action, and the step raises IllegalAction. RLlib's
`episode_return_mean` is the sum over all agents, each of which gets the reward of the team; `log_team` adds
the return of the team.

With `"sides": "both"` in `env_config`, "enemy_0", "enemy_1", ... are agents too, with the observations,
actions and rewards of their side. For a policy per side, name the policies "agent" and "enemy", and map by
`policy_mapping_fn=lambda agent, episode, **_: agent.split("_")[0]`.

RLlib steps one battle at a time through dicts, hundreds of times slower than a pool can. To use an RLlib
cluster at full speed, see `smaclite_pool.integrations.ray`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._extra import extra
from .._layout import Bounds
from .._native import check_settings
from .._render import RENDER_FPS, RENDER_MODES, BattleViewer, check_rendering
from .._requirements import require_integer
from ._common import FIXED_SETTINGS, SingleBattle, TimeStep

with extra("rllib"):
    from gymnasium.spaces import Box, Dict
    from ray.rllib.env.env_context import EnvContext
    from ray.rllib.env.multi_agent_env import MultiAgentEnv

    from ._spaces import AvailableDiscrete, bounded_box, update_masks

__all__ = ["BattleMultiAgentEnv", "log_team"]

SEEDS_PER_RUNNER = 10_000
"""Distance between the seeds of env runners; each runner has fewer battles than that."""

SEED_OF_CHECK = 42
"""RLlib checks a new environment by a reset with this seed and a step."""


class BattleMultiAgentEnv(MultiAgentEnv):
    """One battle with the interface of RLlib's multi-agent environments.

    Each agent observes `{"observations": float32 [obs_size], "action_mask": float32 [n_actions]}`. Every
    agent gets its team's reward, and infos (`battle_won`, `dead_allies`, `dead_enemies`, `episode_return`,
    `episode_length`) are the same for all.

    Args:
        config: RLlib's `env_config`, with `scenario`, a standard scenario or the path of a scenario file
            (default "2s3z"), `render_mode` ("rgb_array" by default: `render()` returns a picture; "human": a
            window shows every step, which needs pygame and a display; or None), `render_speed` of that window
            (1 for the speed of the battle, 0.25 for slow motion, None for no waiting), and `seed`,
            `episode_limit` and other arguments of `smaclite_pool.make`. Each battle of each env runner gets a
            different seed, without one a random seed; a reset with a seed, as RLlib's `debugging(seed=)`
            makes, replaces it. Env runners for evaluation have the same numbers as those for training: give
            them another seed by `evaluation(evaluation_config={"env_config": {..., "seed": ...}})`.

    Raises InvalidRequest, ScenarioError and StartError.
    """

    picture_size = (640, 640)

    def __init__(self, config: Mapping[str, Any] | None = None) -> None:
        settings = {"scenario": "2s3z", **(config or {})}
        if settings.get("seed") is not None:
            seed = require_integer("env_config['seed']", settings["seed"], 0)
            settings["seed"] = seed + SEEDS_PER_RUNNER * getattr(config, "worker_index", 0) + _index(config)
        self.metadata = {"render_modes": list(RENDER_MODES), "render_fps": RENDER_FPS}  # RLlib adds to it
        check_settings("env_config", settings, ["scenario", "render_mode", "render_speed"], [*FIXED_SETTINGS])
        scenario = settings.pop("scenario")
        self.render_mode: str | None = settings.pop("render_mode", "rgb_array")
        speed: float | None = settings.pop("render_speed", 1.0)
        check_rendering(self.render_mode, speed)
        self._battle = SingleBattle(scenario, settings, both_sides=True)
        self._viewer = BattleViewer(self._battle.envs, *self.picture_size, self.render_mode, speed)
        agents, sizes = self._battle.agents, self._battle.sizes
        self._available_actions = {agent: AvailableDiscrete(n) for agent, (_, n) in sizes.items()}
        self.possible_agents, self.agents = list(agents), list(agents)
        bounds = self._battle.obs_bounds
        self.observation_spaces = {
            agent: _observation_space(bounds[agent], n_actions) for agent, (_, n_actions) in sizes.items()
        }
        self.action_spaces = {agent: self._available_actions[agent] for agent in agents}
        super().__init__()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[Any, Any], dict[Any, Any]]:
        """Begin a new battle. Without a seed the random generator continues. `options` are ignored.

        The check of a new environment, which RLlib makes with the same seed in every env runner, is no battle
        from which it continues.
        """
        is_check = not self._battle.has_begun and seed == SEED_OF_CHECK and options == {}
        now = self._battle.reset(seed)
        if is_check:
            self._battle.seed_next_reset(self._battle.envs.spec.seed)
        self._viewer.observe(now.state)
        return self._observe(now), self._for_all(now.totals)

    def step(  # type: ignore[override]  # RLlib's own differs from Gymnasium's
        self, action_dict: Mapping[Any, int | np.integer[Any]]
    ) -> tuple[dict[Any, Any], dict[Any, Any], dict[Any, Any], dict[Any, Any], dict[Any, Any]]:
        """Step the battle by one action per agent; dead agents use 0 (no-op).

        Raises IllegalAction for an unavailable action, and InvalidRequest if an agent is missing or the
        battle has ended; nothing is stepped then.
        """
        now = self._battle.step_by_name(action_dict)
        self._viewer.observe(now.state)
        terminateds = self._for_all(now.terminated) | {"__all__": now.terminated}
        truncateds = self._for_all(now.truncated) | {"__all__": now.truncated}
        rewards = dict(zip(self._battle.agents, now.rewards, strict=True))
        infos = self._for_all(now.totals)
        return self._observe(now), rewards, terminateds, truncateds, infos

    def _observe(self, now: TimeStep) -> dict[str, dict[str, NDArray[np.float32]]]:
        update_masks(self._available_actions, now.masks)  # RLlib begins with a random step as a check
        return {
            agent: {"action_mask": mask.astype(np.float32), "observations": obs}
            for agent, mask, obs in zip(self._battle.agents, now.masks, now.rows, strict=True)
        }

    def _for_all(self, value: Any) -> dict[str, Any]:
        return dict.fromkeys(self._battle.agents, value)

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]  # RLlib's own draws nothing
        """The battle from above, uint8 [640, 640, 3], or in a window with "human".

        Raises InvalidRequest before the first reset, and PoolError if a window is needed and pygame is not
        installed or there is no display.
        """
        return self._viewer.render(self._battle.last.state)

    def close(self) -> None:
        """End the pool and close the window. Calling it again has no effect."""
        self._viewer.close()
        self._battle.close()


def _index(config: Any) -> int:
    """The index of a new battle in its env runner.

    RLlib's new API stack makes all battles of a runner with one context, whose `vector_index` is 0.
    """
    if not isinstance(config, EnvContext):
        return 0
    made: int = getattr(config, "battles_made", 0)
    config.battles_made = made + 1
    return int(config.vector_index) + made


def _observation_space(bounds: Bounds, n_actions: int) -> Dict:
    observations = bounded_box(bounds, bounds[0].shape)
    return Dict(action_mask=Box(0.0, 1.0, (n_actions,), np.float32), observations=observations)


def log_team(*, episode: Any, metrics_logger: Any, **_: Any) -> None:
    """Log `team_return` and `win_rate` with the metrics of env runners: means of the last 100 episodes.

    Pass it to the configuration: `config.callbacks(on_episode_end=log_team)`.
    """
    last = next(iter(episode.get_infos(-1).values()))  # those of all agents are the same
    metrics_logger.log_value("team_return", last["episode_return"], window=100)
    metrics_logger.log_value("win_rate", float(last["battle_won"]), window=100)
