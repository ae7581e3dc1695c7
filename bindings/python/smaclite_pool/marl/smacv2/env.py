"""SMACv2's environment: its options, reset, step, and what it counts."""

from __future__ import annotations

import logging
import secrets
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn, SupportsInt

import numpy as np
from numpy.typing import NDArray

from ..._layout import Floats
from ..._native import CapabilityBattle
from ..._render import RENDER_MODES, Window
from ..._requirements import require_integer
from ...errors import Closed, InvalidRequest
from .._counts import EpisodeCounts
from ..smac.env import check_fixed
from ..smac.unavailable import Unavailable
from .base import UnavailableAction
from .distributions import DRAWN_BY_THE_BATTLE
from .maps import get_map_params, race_types
from .names import FeatureNames
from .queries import Queries
from .scenario import scenario_of

__all__ = ["StarCraft2Env"]

_log = logging.getLogger(__name__)

FIRST_LOOK = 6
"""The action of the first look direction, or of the first target where there are none."""


class StarCraft2Env(EpisodeCounts, Queries):
    """One battle with SMACv2's interface, with all options of SMACv2 under their names and defaults.

    Args:
        map_name: 10gen_terran, 10gen_zerg or 10gen_protoss, whose teams `capability_config` describes, or one
            of the 23 maps of SMAC.
        step_mul, difficulty, game_version: only their defaults are supported; the error says why.
        move_amount: length of a move in squares.
        seed: seed of the first reset; equal seeds and actions give equal episodes with equal teams and
            capabilities, which they do not in SMACv2. None for a random seed.
        continuing_episode: mark an episode that reached the episode limit with `info["episode_limit"]`.
        obs_all_health, obs_own_health, obs_last_action, obs_pathing_grid, obs_terrain_height, obs_own_pos:
            this option and those below are the options of `smacv2` in scenario files.
        obs_timestep_number, obs_starcraft, obs_instead_of_state, state_last_action, state_timestep_number:
            what else agents and the state are told.
        conic_fov, num_fov_actions, use_unit_ranges, min_attack_range, kill_unit_step_mul: sight and attacks.
        fully_observable, prob_obs_enemy, action_mask: which enemies are seen, and which actions are offered.
        reward_sparse, reward_only_positive, reward_death_value, reward_win, reward_defeat: the reward.
        reward_negative_scale, reward_scale, reward_scale_rate: how the reward is scaled.
        capability_config: SMACv2's `n_units`, `n_enemies` and its tables `team_gen`, `start_positions`,
            `enemy_mask`, `attack` and `health`. It is not changed.
        replay_dir, replay_prefix: without an effect, as `save_replay` is not offered.
        window_size_x, window_size_y: size of pictures and of the window of `render()`, in pixels.
        heuristic_ai, heuristic_rest: must be False; SMACv2's scripted player is not offered.
        debug: log actions and rewards at level DEBUG.
        published: not in SMACv2: reproduce the faults of its published code, for comparisons with it. By
            default, its intended rules hold.

    Raises InvalidRequest for an invalid value, Unavailable for what a battle here does not have, and
    ScenarioError for values that a scenario file refuses.

    Shapes use A for `n_agents`, E for `n_enemies` and N for `n_actions`.
    """

    def __init__(
        self,
        map_name: str = "8m",
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
        obs_own_pos: bool = False,
        obs_starcraft: bool = True,
        conic_fov: bool = False,
        num_fov_actions: int = 12,
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
        kill_unit_step_mul: int = 2,
        fully_observable: bool = False,
        capability_config: Mapping[str, Any] | None = None,
        use_unit_ranges: bool = False,
        min_attack_range: float = 2,
        prob_obs_enemy: float = 1.0,
        action_mask: bool = True,
        replay_dir: str | None = "",
        replay_prefix: str | None = "",
        window_size_x: int = 1920,
        window_size_y: int = 1200,
        heuristic_ai: bool = False,
        heuristic_rest: bool = False,
        debug: bool = False,
        *,
        published: bool = False,
    ) -> None:
        check_fixed(step_mul=step_mul, difficulty=difficulty, game_version=game_version)
        if heuristic_ai or heuristic_rest:
            raise Unavailable(
                "heuristic_ai and heuristic_rest must be False: SMACv2's scripted player is not offered; "
                "smaclite_pool.ScriptedPolicy has others"
            )
        given = locals()
        self._options: dict[str, Any] = {name: given[name] for name in _SCENARIO_OPTIONS}
        self.map_name, self.continuing_episode, self.debug = map_name, continuing_episode, debug
        self.replay_dir, self.replay_prefix = replay_dir or "", replay_prefix or ""
        self.window_size, self._window = (window_size_x, window_size_y), Window(f"smaclite_pool: {map_name}")
        self.capability_config = dict(capability_config or {})
        self._scenario = scenario_of(map_name, self.capability_config, self._options)
        self._seed = secrets.randbits(32) if seed is None else require_integer("seed", seed, 0)
        self._battle = (
            CapabilityBattle(self._scenario, self._seed)
            if race_types(map_name)
            else CapabilityBattle(map_name, self._seed, self._scenario["smacv2"])
        )
        self._next_seed: int | None = None
        self._last_actions: list[int] | None = None
        self._set_constants()
        self._names = FeatureNames(self._scenario, self.n_actions)
        EpisodeCounts.__init__(self)
        self._has_begun = self._has_ended = self._has_been_seen = self._is_closed = False

    def _set_constants(self) -> None:
        """The attributes that analysis scripts read."""
        battle, options, params = self._battle, self._options, get_map_params(self.map_name)
        self.n_agents, self.n_enemies, self.n_actions = battle.n_agents, battle.n_enemies, battle.n_actions
        self.episode_limit = battle.episode_limit or params["limit"]
        self.n_actions_no_attack = FIRST_LOOK + options["num_fov_actions"] * options["conic_fov"]
        self.map_type, self.unit_type_bits = params["map_type"], params["unit_type_bits"]
        self.shield_bits_ally = int(self._scenario["ally_has_shields"])
        self.shield_bits_enemy = int(self._scenario["enemy_has_shields"])
        # Maps without a size have that of the presets.
        self.map_x, self.map_y = self._scenario.get("width", 32), self._scenario.get("height", 32)

    def reset(self, episode_config: Mapping[str, Any] | None = None) -> tuple[list[NDArray[Any]], Floats]:
        """Begin a new episode, and return `get_obs()` and `get_state()`.

        The random generator continues, unless `seed` was called. The battle draws teams, start positions and
        capabilities itself; an `episode_config` with values raises Unavailable.
        """
        if self._is_closed:
            raise Closed("the environment is closed; make another one")
        for name, value in (episode_config or {}).items():
            if value != DRAWN_BY_THE_BATTLE:
                raise Unavailable(f"{name} cannot be given: the battle draws it, from its seed")
        self._battle.reset(self._next_seed)
        self._next_seed = self._last_actions = None
        self._count_begin()
        self._has_begun, self._has_ended, self._has_been_seen = True, False, False
        self._before = self._battle.units()
        return self.get_obs(), self.get_state()

    def step(self, actions: Sequence[SupportsInt] | NDArray[Any]) -> tuple[float, bool, dict[str, Any]]:
        """Step by one action per agent, and return the reward, whether the episode ended, and `info`.

        Actions are converted by `int()`. An episode that reaches its limit has ended. `info` contains
        `battle_won`, `dead_allies`, `dead_enemies`, and `episode_limit` (True) if the episode reached its
        limit and `continuing_episode` is set. Raises UnavailableAction, an AssertionError, for an unavailable
        action, and InvalidRequest before the first reset and after the end of an episode; nothing is stepped
        then.
        """
        self._require_episode()
        if self._has_ended:
            raise InvalidRequest("the episode has ended; call reset")
        chosen = self._chosen(actions)
        self._before = self._battle.units()
        reward, is_over, found = self._battle.step(chosen)
        self._has_been_seen, self._last_actions = False, chosen
        info = dict(found)
        at_limit = bool(info.pop("episode_limit", False))
        self._has_ended = is_over or at_limit
        won = bool(info["battle_won"])
        lost = self._battle.is_lost
        self._count_step(ended=self._has_ended, won=won, lost=lost, at_limit=at_limit)
        if at_limit and self.continuing_episode:
            info["episode_limit"] = True
        if self.debug:
            _log.debug("actions %s, reward %s, info %s", chosen, reward, info)
        return reward, self._has_ended, info

    def _chosen(self, actions: Sequence[SupportsInt] | NDArray[Any]) -> list[int]:
        # HARL passes arrays of one number each, which newer versions of NumPy do not convert by `int`.
        chosen = [int(action.item() if hasattr(action, "item") else action) for action in actions]
        if len(chosen) != self.n_agents:
            raise InvalidRequest(f"actions must have one per agent, {self.n_agents}, got {len(chosen)}")
        for agent, (action, row) in enumerate(zip(chosen, self.get_avail_actions(), strict=True)):
            if not (0 <= action < self.n_actions and row[action]):
                available = [number for number, is_available in enumerate(row) if is_available]
                raise UnavailableAction(
                    f"Agent {agent} cannot perform action {action}; available are {available}",
                    agent=agent,
                    action=action,
                    available=available,
                )
        return chosen

    def get_obs(self) -> list[NDArray[Any]]:
        """The observation of each agent: a list of float32 [get_obs_size()].

        With `published`, each call but the first after a reset or step lets the agents look once more, which
        can change who sees what, and observations with `obs_timestep_number` are float64.
        """
        self._require_episode()
        if self._has_been_seen and self._options["published"]:
            self._battle.perceive()
        self._has_been_seen = True
        return self._observations()

    def get_obs_agent(self, agent_id: int) -> NDArray[Any]:
        """The observation of one agent, float32 [get_obs_size()]: what it saw when the agents looked last."""
        self._require_episode()
        return self._observations()[agent_id]

    def seed(self, seed: int | None = None) -> int:
        """Set the seed for the next `reset`, if one is given, and return the last seed."""
        if seed is not None:
            self._seed = self._next_seed = require_integer("seed", seed, 0)
        return self._seed

    def render(self, mode: str = "human") -> NDArray[np.uint8] | bool:
        """Draw the battle from above, with north at the top.

        "rgb_array" returns uint8 [height, width, 3]. "human" shows it in a window (needs pygame and a
        display), and returns whether the window is still open. Raises InvalidRequest before the first reset,
        for another mode, and for a window size that is not between 16 and 4096; and PoolError if a window is
        needed and pygame is not installed or there is no display.
        """
        if mode not in RENDER_MODES:
            raise InvalidRequest(f'mode must be "human" or "rgb_array", got {mode!r}')
        self._require_episode()
        picture = self._battle.picture(*self.window_size)
        return picture if mode == "rgb_array" else self._window.show(picture)

    def save_replay(self) -> NoReturn:
        """Not offered: raises Unavailable."""
        raise Unavailable(
            "save_replay is not offered: SMACv2 saves replays of StarCraft II, which is not used"
        )

    def full_restart(self) -> NoReturn:
        """Not offered: raises Unavailable."""
        raise Unavailable("full_restart is not offered: StarCraft II is not used; call reset")

    def __repr__(self) -> str:
        teams = f"{self.n_agents} agents against {self.n_enemies}"
        return f"<{type(self).__name__} {self.map_name}, {teams}, seed {self._seed}>"

    def close(self) -> None:
        """End the battle and close the window. Calling it again has no effect."""
        self._has_begun, self._is_closed = False, True
        self._window.close()

    def _require_episode(self) -> None:
        if not self._has_begun:
            raise InvalidRequest("no battle has begun; call reset first")


# The options that a scenario file has under the same name.
_SCENARIO_OPTIONS = (
    "use_unit_ranges", "min_attack_range", "conic_fov", "num_fov_actions", "prob_obs_enemy", "action_mask",
    "fully_observable", "obs_all_health", "obs_own_health", "obs_last_action", "obs_pathing_grid",
    "obs_terrain_height", "obs_own_pos", "obs_timestep_number", "obs_starcraft", "obs_instead_of_state",
    "state_last_action", "state_timestep_number", "move_amount", "kill_unit_step_mul", "reward_sparse",
    "reward_only_positive", "reward_death_value", "reward_win", "reward_defeat", "reward_negative_scale",
    "reward_scale", "reward_scale_rate", "published",
)  # fmt: skip
