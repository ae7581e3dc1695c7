"""The environment with SMAC's interface."""

from __future__ import annotations

import logging
import secrets
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal, SupportsInt, cast

import numpy as np
from numpy.typing import NDArray

from ..._layout import Bools, Floats, loses_draws
from ..._native import Recorder, scenario
from ..._render import RENDER_MODES, BattleViewer, check_rendering
from ..._requirements import require_integer
from ...errors import InvalidRequest
from ...integrations._common import SingleBattle, TimeStep
from .._counts import EpisodeCounts
from .._replay import save_replay
from .._rewards import changed_rewards
from .details import Details
from .heuristic import Heuristic
from .queries import Queries
from .unavailable import Unavailable
from .views import ViewOptions, Views

_log = logging.getLogger(__name__)

# Options of SMAC about StarCraft II: their allowed values, and why there are no others.
_FIXED: dict[str, tuple[tuple[object, ...], str]] = {
    "step_mul": ((8, None), "a step is 8 ticks by the rules of the game"),
    "move_amount": ((2,), "a move order is 2 squares long by the rules of the game"),
    "difficulty": (("7",), "the enemies follow a fixed script; the difficulties are those of StarCraft II"),
    "game_version": ((None, "latest"), "StarCraft II is not used; `rules` chooses the rule set"),
}


# Options that are attributes of an environment, as in SMAC, beside those of rewards.
_OPTIONS = (
    "difficulty", "game_version", "obs_all_health", "obs_own_health", "obs_last_action", "obs_pathing_grid",
    "obs_terrain_height", "obs_instead_of_state", "obs_timestep_number", "state_last_action",
    "state_timestep_number",
)  # fmt: skip

__all__ = ["MultiAgentEnv", "check_fixed", "get_map_params"]


class MultiAgentEnv(EpisodeCounts, Queries, Details):
    """One battle with SMAC's interface, with all options of SMAC under their names and defaults.

    Args:
        map_name: a standard scenario (see `smaclite_pool.scenarios()`) or the path of a scenario file.
        step_mul, move_amount, difficulty, game_version: only their defaults are supported; the error says
            why.
        seed: seed of the first reset; with the same actions, its episodes equal those of the published
            environment with that seed. None for a random seed.
        continuing_episode: mark an episode that reached the episode limit with `info["episode_limit"]`.
        obs_all_health: observations contain health and shields of all units.
        obs_own_health: observations contain health and shield of the agent itself; implied by obs_all_health.
        obs_last_action: observations contain the last actions of visible allies.
        obs_pathing_grid: observations contain whether 8 squares around are walkable (or off the map).
        obs_terrain_height: observations contain the heights of 9 squares around: 0, as all maps are flat, and
            1 off the map.
        obs_timestep_number, state_timestep_number: contain the number of steps divided by the episode limit.
        obs_instead_of_state: the state is the concatenation of all observations.
        state_last_action: the state contains the last actions.
        reward_sparse: the reward is 1 for a victory, -1 for a defeat, 0 otherwise; also subject to
            `reward_scale`, as in SMAC.
        reward_only_positive: if False, losses of allies are subtracted: health and shields lost in the step
            (net of what was regained) and `reward_death_value` per death, times `reward_negative_scale`.
        reward_death_value, reward_win, reward_defeat: points for a kill, a victory, a defeat.
        reward_scale, reward_scale_rate: multiply rewards by rate / (the maximum return in points).
            Reward options that have SMAC's defaults are those of the scenario.
        replay_dir, replay_prefix: folder of `save_replay`, and prefix of its file names (default: name of the
            map).
        window_size_x, window_size_y: size of pictures and of the window of `render()`, in pixels.
        heuristic_ai: use SMAC's scripted policy instead of the actions given to `step`, and write its actions
            into them. Requires `heuristic_rest`, since orders at targets out of range are not available
            actions here.
        debug: log actions and rewards at level DEBUG.
        rules, episode_limit, opponent: not in SMAC; as in `smaclite_pool.make`.
        render_speed: not in SMAC; of the window: 1 for the speed of the battle, two steps per second; 0.25
            for slow motion; None for no waiting.

    Raises Unavailable for options without a meaning here, ScenarioError for an invalid scenario or reward
    option, and InvalidRequest for another invalid value, and for a scenario that SMAC's interface cannot
    tell: with options of `smacv2` that give actions or health another meaning (`conic_fov`, `health`,
    `enemy_mask`, hidden health, parts of observations), or with drawn types that observations do not tell.
    docs/reference/observations.md says how rewards are computed.

    Shapes use A for `n_agents`, E for `n_enemies` and N for `n_actions`.
    """

    def __init__(
        self,
        map_name: str | PathLike[str] = "8m",
        step_mul: int | None = 8,
        move_amount: float = 2,
        difficulty: str = "7",
        game_version: str | None = None,
        seed: int | None = None,
        continuing_episode: bool = False,
        obs_all_health: bool = True,
        obs_own_health: bool = True,
        obs_last_action: bool = False,
        obs_pathing_grid: bool = False,
        obs_terrain_height: bool = False,
        obs_instead_of_state: bool = False,
        obs_timestep_number: bool = False,
        state_last_action: bool = True,
        state_timestep_number: bool = False,
        reward_sparse: bool = False,
        reward_only_positive: bool = True,
        reward_death_value: float = 10,
        reward_win: float = 200,
        reward_defeat: float = 0,
        reward_negative_scale: float = 0.5,
        reward_scale: bool = True,
        reward_scale_rate: float = 20,
        replay_dir: str | None = "",
        replay_prefix: str | None = "",
        window_size_x: int = 1920,
        window_size_y: int = 1200,
        heuristic_ai: bool = False,
        heuristic_rest: bool = False,
        debug: bool = False,
        *,
        rules: Literal["smaclite", "paper", "starcraft", "starcraft-1"] = "smaclite",
        opponent: str | Mapping[str, float] | None = None,
        episode_limit: int | Literal["default"] | None = "default",
        render_speed: float | None = 1.0,
    ) -> None:
        check_fixed(step_mul=step_mul, move_amount=move_amount)
        check_fixed(difficulty=difficulty, game_version=game_version)
        if heuristic_ai and not heuristic_rest:
            raise Unavailable(
                "heuristic_ai=True attacks targets out of range, which are not available actions here; "
                "heuristic_rest=True restricts it to available ones"
            )
        self.map_name = str(map_name)
        given = locals()
        self._options = {name: given[name] for name in _OPTIONS}
        self.continuing_episode = continuing_episode
        self.heuristic_ai, self.heuristic_rest, self.debug = heuristic_ai, heuristic_rest, debug
        self.replay_dir, self.replay_prefix = replay_dir or "", replay_prefix or ""
        self.window_size = (window_size_x, window_size_y)
        check_rendering(None, render_speed)
        self._seed = secrets.randbits(32) if seed is None else require_integer("seed", seed, 0)
        settings = {
            "seed": self._seed,
            "episode_limit": episode_limit,
            "rules": rules,
            "opponent": opponent,
            "rewards": changed_rewards(given),
        }
        self._battle = SingleBattle(map_name, settings)
        self._viewer = BattleViewer(self._battle.envs, *self.window_size, speed=render_speed)
        self._views = Views(self._battle.envs, cast(ViewOptions, self._options))
        spec = self._battle.envs.spec
        self._options |= spec.rewards  # those of the scenario, where the options have SMAC's defaults
        self.n_agents, self.n_enemies, self.n_actions = spec.n_agents, spec.n_enemies, spec.n_actions
        self._heuristic = Heuristic(self.n_agents)
        self.episode_limit = spec.episode_limit
        self._views.set_limit(self.episode_limit)
        EpisodeCounts.__init__(self)
        self._loses_draws = loses_draws(scenario(self._battle.envs))
        # Zeros until the first reset.
        self._avail: Bools = np.zeros((self.n_agents, self.n_actions), np.bool_)
        no_obs = np.zeros((self.n_agents, spec.obs_size), np.float32)
        self._views.update(no_obs, np.zeros(spec.state_size, np.float32), 0)
        self._recorder = Recorder(spec.pool)

    def reset(self) -> tuple[list[Floats], Floats]:
        """Begin a new episode, and return `get_obs()` and `get_state()`.

        The random generator continues, unless `seed` was called.
        """
        now = self._battle.reset()
        self._heuristic.reset()
        self._count_begin()
        self._update(now)
        return self.get_obs(), self.get_state()

    def step(self, actions: Sequence[SupportsInt] | NDArray[Any]) -> tuple[float, bool, dict[str, Any]]:
        """Step by one action per agent, and return the reward, whether the episode ended, and `info`.

        `info` contains `battle_won`, `dead_allies`, `dead_enemies`, and `episode_limit` (True) if the episode
        reached its limit and `continuing_episode` is set. Raises IllegalAction for an unavailable action, and
        InvalidRequest before the first reset and after the end of an episode; nothing is stepped then.
        """
        chosen = self._chosen(actions)
        now = self._battle.step(chosen)
        self._update(now)
        info, won = now.info.copy(), bool(now.info["battle_won"])
        is_draw = (info["dead_allies"], info["dead_enemies"]) == (self.n_agents, self.n_enemies)
        lost = now.terminated and not (won or now.at_limit) and (self._loses_draws or not is_draw)
        self._count_step(ended=now.ended, won=won, lost=lost, at_limit=now.at_limit)
        if now.at_limit and self.continuing_episode:
            info["episode_limit"] = True
        if self.debug:
            _log.debug("actions %s, reward %s, info %s", chosen, now.reward, info)
        return now.reward, now.ended, info

    def _chosen(self, actions: Sequence[SupportsInt] | NDArray[Any]) -> list[int]:
        if self.heuristic_ai:
            chosen = self._heuristic.actions(self._views.units, self._avail)
            if hasattr(actions, "__setitem__"):
                # As in SMAC, so that the learner trains with the actions that were used.
                for agent, action in enumerate(chosen):
                    cast(Any, actions)[agent] = action
            return chosen
        try:
            # Some learners pass arrays of one number each, which newer versions of NumPy do not convert.
            given = [action.item() if hasattr(action, "item") else action for action in actions]
            chosen = [int(action) for action in given]
        except (TypeError, ValueError, OverflowError, RuntimeError):
            given, chosen = list(actions), []
        if chosen != given:
            raise InvalidRequest(f"actions must be integers, one per agent, got {given}")
        return chosen

    def _update(self, now: TimeStep) -> None:
        self._views.update(now.obs, now.state, now.episode_length)
        self._avail = now.avail_actions

    def seed(self, seed: int | None = None) -> int:
        """Set the seed for the next `reset`, if one is given, and return the last seed."""
        if seed is not None:
            self._seed = require_integer("seed", seed, 0)
            self._battle.seed_next_reset(self._seed)
        return self._seed

    def render(self, mode: Literal["human", "rgb_array"] = "human") -> NDArray[np.uint8] | bool:
        """Draw the battle from above, with north at the top.

        "rgb_array" returns uint8 [height, width, 3]. "human" shows it in a window (needs pygame and a
        display), and returns whether the window is still open. Raises InvalidRequest before the first reset,
        for another mode, and for a window size that is not between 16 and 4096; and PoolError if a window is
        needed and pygame is not installed or there is no display.
        """
        if mode not in RENDER_MODES:
            raise InvalidRequest(f'mode must be "human" or "rgb_array", got {mode!r}')
        state = self._battle.last.state
        return self._viewer.picture(state) if mode == "rgb_array" else self._viewer.show(state)

    def save_replay(self) -> Path:
        """Write the last 100 episodes and the present one to a replay in `replay_dir`, and return its path.

        The name of the file is `<replay_prefix>_<time>.smreplay`; `smaclite-pool replay` plays it. Raises
        InvalidRequest before the first step.
        """
        return save_replay(self._recorder, self.replay_dir, self.replay_prefix or Path(self.map_name).stem)

    def __repr__(self) -> str:
        return self._battle.description(self)

    def close(self) -> None:
        """End the pool and close the window. Calling it again has no effect."""
        self._recorder.close()
        self._battle.close()
        self._viewer.close()

    def full_restart(self) -> None:
        """Begin a new episode; SMAC uses this when StarCraft II hangs."""
        self.reset()
        self.force_restarts += 1


def get_map_params(map_name: str) -> dict[str, Any]:
    """SMAC's function of that name: `n_agents`, `n_enemies`, `limit` and `unit_type_bits` of a scenario."""
    info = scenario(map_name)
    return {
        "n_agents": len(info["allies"]),
        "n_enemies": len(info["enemies"]),
        "limit": info["episode_limit"],
        "unit_type_bits": info["num_unit_types"],
    }


def check_fixed(**options: object) -> None:
    """Raise Unavailable unless options of SMAC about StarCraft II have a value with a meaning here."""
    for name, value in options.items():
        values, reason = _FIXED[name]
        if value not in values:
            raise Unavailable(f"{name} must be {values[0]!r}, got {value!r}: {reason}")
