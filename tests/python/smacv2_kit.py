"""For tests of SMACv2's interface: its configurations and defaults, and a battle that plays nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import smaclite_pool as sp
from numpy.typing import NDArray

RACES = {
    "terran": (["marine", "marauder", "medivac"], [0.45, 0.45, 0.1], ["medivac"]),
    "zerg": (["zergling", "baneling", "hydralisk"], [0.45, 0.1, 0.45], ["baneling"]),
    "protoss": (["stalker", "zealot", "colossus"], [0.45, 0.45, 0.1], []),
}


def standard(race: str = "terran", n_units: int = 5, n_enemies: int = 5, **tables: Any) -> dict[str, Any]:
    """`capability_config` of SMACv2's own files."""
    types, weights, exceptions = RACES[race]
    teams = {"dist_type": "weighted_teams", "unit_types": types, "weights": weights, "observe": True}
    starts = {"dist_type": "surrounded_and_reflect", "p": 0.5, "map_x": 32, "map_y": 32}
    return {
        "n_units": n_units,
        "n_enemies": n_enemies,
        "team_gen": {**teams, "exception_unit_types": exceptions} if exceptions else teams,
        "start_positions": starts,
        **tables,
    }


# All options of SMACv2 with their defaults; None stands for an empty `capability_config`.
SMACV2_DEFAULTS: dict[str, object] = {
    "map_name": "8m", "step_mul": 8, "move_amount": 2, "difficulty": "7", "game_version": None, "seed": None,
    "continuing_episode": False, "obs_all_health": True, "obs_own_health": True, "obs_last_action": False,
    "obs_pathing_grid": False, "obs_terrain_height": False, "obs_instead_of_state": False,
    "obs_timestep_number": False, "obs_own_pos": False, "obs_starcraft": True, "conic_fov": False,
    "num_fov_actions": 12, "state_last_action": True, "state_timestep_number": False, "reward_sparse": False,
    "reward_only_positive": True, "reward_death_value": 10, "reward_win": 200, "reward_defeat": 0,
    "reward_negative_scale": 0.5, "reward_scale": True, "reward_scale_rate": 20, "kill_unit_step_mul": 2,
    "fully_observable": False, "capability_config": None, "use_unit_ranges": False, "min_attack_range": 2,
    "prob_obs_enemy": 1.0, "action_mask": True, "replay_dir": "", "replay_prefix": "",
    "window_size_x": 1920, "window_size_y": 1200, "heuristic_ai": False, "heuristic_rest": False,
    "debug": False,
}  # fmt: skip

UNIFORM = {"dist_type": "per_agent_uniform", "lower_bound": [0.0], "upper_bound": [0.5], "observe": True}


class ScriptedBattle:
    """In place of the native battle. Agents can do everything but the no-op; `ends` says when it ends."""

    def __init__(
        self, scenario: Mapping[str, Any] | str, seed: int, smacv2: Mapping[str, Any] | None = None
    ) -> None:
        if isinstance(scenario, str):
            info = sp.scenario(scenario)
            scenario = {
                **info,
                "num_allied_units": len(info["allies"]),
                "num_enemy_units": len(info["enemies"]),
                "unit_type_ids": [unit_type["unit_type"] for unit_type in info["unit_types"]],
                "smacv2": smacv2,
            }
        self.scenario, self.seeds = scenario, [seed]
        options = scenario["smacv2"]
        self.n_agents: int = scenario["num_allied_units"]
        self.n_enemies: int = scenario["num_enemy_units"]
        self.episode_limit: int | None = scenario["episode_limit"]
        self.type_names = list(scenario["unit_type_ids"])
        heals = "MEDIVAC" in self.type_names
        looks = options["num_fov_actions"] * options["conic_fov"]
        self.n_actions = 6 + looks + max(self.n_enemies, self.n_agents * heals)
        self.obs_size, self.state_size = 7, 5
        self.cap_size = len({"attack", "health"} & set(options)) + scenario["num_unit_types"]
        self.steps = self.n_looks = 0
        self.is_lost = False
        self.ends: dict[int, dict[str, Any]] = {}
        """By step, what its `info` has; `over` says that the battle is over."""
        self.actions: list[list[int]] = []

    def reset(self, seed: int | None = None) -> None:
        if seed is not None:
            self.seeds.append(seed)
        self.steps, self.n_looks = 0, 1

    def step(self, actions: list[int]) -> tuple[float, bool, dict[str, Any]]:
        self.steps += 1
        self.n_looks += 1
        self.actions.append(actions)
        info = {"battle_won": False, "dead_allies": 0, "dead_enemies": 0, **self.ends.get(self.steps, {})}
        return 0.5, info.pop("over", False), info

    def perceive(self) -> None:
        self.n_looks += 1

    def obs(self) -> NDArray[np.float32]:
        return np.full((self.n_agents, self.obs_size), self.n_looks, np.float32)

    def state(self) -> NDArray[np.float32]:
        return np.full(self.state_size, self.steps, np.float32)

    def avail(self) -> NDArray[np.uint8]:
        available = np.ones((self.n_agents, self.n_actions), np.uint8)
        available[:, 0] = 0
        return available

    def capabilities(self) -> NDArray[np.float32]:
        return np.arange(self.n_agents * self.cap_size, dtype=np.float32).reshape(self.n_agents, -1)

    def visibility(self) -> NDArray[np.uint8]:
        return np.ones((self.n_agents, self.n_agents + self.n_enemies), np.uint8)

    def time(self) -> float:
        return self.steps / 3

    def max_reward(self) -> float:
        return 1000.0

    def units(self) -> dict[str, NDArray[Any]]:
        n_units = self.n_agents + self.n_enemies
        columns = ("y", "shield", "health_max", "shield_max", "energy", "cooldown")
        return {
            **{name: np.ones(n_units, np.float32) for name in columns},
            "type": np.arange(n_units) % len(self.type_names),
            "x": np.arange(n_units, dtype=np.float32),
            "health": np.full(n_units, 100 - self.steps, np.float32),
        }
