"""The methods of SMAC that read an environment between two steps: observations, sizes, the map and units."""

from __future__ import annotations

import math
from typing import Any

from ..._layout import Bools, Floats
from ..._native import FIRST_TARGET, NORTH
from ..._units import Unit
from ...integrations._common import SingleBattle
from .views import N_HEIGHT, N_PATHING, Views

__all__ = ["Queries"]


class Queries:
    """The part of `MultiAgentEnv` that changes nothing. Arrays are copies that you can keep and change."""

    n_agents: int
    n_enemies: int
    n_actions: int
    episode_limit: int | None
    """Steps after which an episode ends; None for no limit."""
    n_actions_no_attack = FIRST_TARGET
    n_actions_move = FIRST_TARGET - NORTH
    n_obs_pathing = N_PATHING
    n_obs_height = N_HEIGHT
    _views: Views
    _battle: SingleBattle
    _avail: Bools

    # --- Observations, state, actions ---

    def get_obs(self) -> list[Floats]:
        """The observation of each agent: a list of float32 [get_obs_size()]."""
        return list(self._views.observations())

    def get_obs_agent(self, agent_id: int) -> Floats:
        """The observation of one agent: float32 [get_obs_size()]."""
        return self.get_obs()[agent_id]

    def get_state(self) -> Floats:
        """The state: float32 [get_state_size()]; for training only."""
        return self._views.state()

    def get_state_dict(self) -> dict[str, Floats]:
        """The parts of the state by name, float32.

        `allies` [A, features], `enemies` [E, features] and, if the options include them, `last_action` [A, N]
        and `timestep` []. `get_env_info()` has the names of the features.
        """
        return self._views.state_dict()

    def get_avail_actions(self) -> list[list[int]]:
        """Which actions are available in the next step: per agent, a list of 0 or 1 per action."""
        available: list[list[int]] = self._avail.astype(int).tolist()
        return available

    def get_avail_agent_actions(self, agent_id: int) -> list[int]:
        """Which actions of one agent are available in the next step: 0 or 1 per action."""
        return self.get_avail_actions()[agent_id]

    def get_visibility_matrix(self) -> Bools:
        """bool [A, A + E]: which units each agent sees; False for itself, and for dead agents."""
        return self._views.visibility()

    # --- Sizes ---

    def get_obs_size(self) -> int:
        """Number of features of an observation."""
        enemies, enemy = self.get_obs_enemy_feats_size()
        allies, ally = self.get_obs_ally_feats_size()
        own = self.get_obs_own_feats_size()
        return self.get_obs_move_feats_size() + enemies * enemy + allies * ally + own

    def get_obs_move_feats_size(self) -> int:
        """Number of features of an observation about moves and terrain."""
        return self._views.move_features()

    def get_obs_enemy_feats_size(self) -> tuple[int, int]:
        """Number of enemies in an observation, and number of features per enemy."""
        return self._views.enemy_features()

    def get_obs_ally_feats_size(self) -> tuple[int, int]:
        """Number of allies in an observation, and number of features per ally."""
        return self._views.ally_features(self.n_actions)

    def get_obs_own_feats_size(self) -> int:
        """Number of features of an observation about the agent itself."""
        return self._views.own_features()

    def get_state_size(self) -> int:
        """Number of features of the state."""
        if self._views.options["obs_instead_of_state"]:
            return self.n_agents * self.get_obs_size()
        return self._views.state_size(self.n_actions)

    def get_total_actions(self) -> int:
        """Number of actions of an agent."""
        return self.n_actions

    def get_ally_num_attributes(self) -> int:
        """Number of features of an ally in the state."""
        return len(self.ally_state_attr_names)

    def get_enemy_num_attributes(self) -> int:
        """Number of features of an enemy in the state."""
        return len(self.enemy_state_attr_names)

    def get_env_info(self) -> dict[str, Any]:
        """Sizes, the episode limit, and the names of the features of allies and enemies in the state."""
        return {
            "state_shape": self.get_state_size(),
            "obs_shape": self.get_obs_size(),
            "n_actions": self.get_total_actions(),
            "n_agents": self.n_agents,
            "episode_limit": self.episode_limit,
            "agent_features": self.ally_state_attr_names,
            "enemy_features": self.enemy_state_attr_names,
        }

    # --- Scenario ---

    @property
    def unit_type_bits(self) -> int:
        """Length of the type one-hot; 0 for none."""
        return self._views.layout.type_bits

    @property
    def shield_bits_ally(self) -> int:
        """1 if observations and state contain the shields of allies, else 0."""
        return self._views.layout.shield_bits_ally

    @property
    def shield_bits_enemy(self) -> int:
        """1 if observations and state contain the shields of enemies, else 0."""
        return self._views.layout.shield_bits_enemy

    @property
    def ally_state_attr_names(self) -> list[str]:
        """Names of the features of an ally in the state."""
        return list(self._views.layout.state.allies.features)

    @property
    def enemy_state_attr_names(self) -> list[str]:
        """Names of the features of an enemy in the state."""
        return list(self._views.layout.state.enemies.features)

    @property
    def map_x(self) -> int:
        """Width of the map in squares."""
        return int(self._views.layout.map_size[0])

    @property
    def map_y(self) -> int:
        """Height of the map in squares."""
        return int(self._views.layout.map_size[1])

    def get_unit_types(self) -> list[int]:
        """Type of each ally, then of each enemy: its index in the type one-hot, 0 if there is none."""
        return [unit["type_id"] for unit in self._views.units.stats]

    @property
    def max_reward(self) -> float:
        """The unscaled return that is scaled to `reward_scale_rate`; of the enemies of this episode."""
        rewards = self._battle.envs.spec.rewards
        enemies = self._views.units.stats[self.n_agents :]
        health = sum(unit["hp"] + unit["shield"] for unit in enemies)
        return rewards["reward_death_value"] * self.n_enemies + rewards["reward_win"] + health

    def unit_sight_range(self, agent_id: int) -> float:
        """Sight range of an agent in squares."""
        return self._views.units.stats[range(self.n_agents)[agent_id]]["sight_range"]

    def unit_shoot_range(self, agent_id: int) -> float:
        """Distance in squares within which an agent can choose targets."""
        return self._views.units.stats[range(self.n_agents)[agent_id]]["targeting_range"]

    # --- Units ---

    @property
    def agents(self) -> dict[int, Unit]:
        """All allies by agent, including dead ones."""
        return {agent: self.get_unit_by_id(agent) for agent in range(self.n_agents)}

    @property
    def enemies(self) -> dict[int, Unit]:
        """All enemies by id, including dead ones."""
        return {enemy: self._views.units.unit(self.n_agents + enemy) for enemy in range(self.n_enemies)}

    def get_unit_by_id(self, a_id: int) -> Unit:
        """The unit of an agent."""
        return self._views.units.unit(range(self.n_agents)[a_id])

    def unit_max_cooldown(self, unit: Unit) -> float:
        """The maximum of `energy/cooldown` in the state: energy for healers, seconds for others."""
        return unit.energy_max if unit.is_healer else unit.weapon_cooldown_max

    def unit_max_shield(self, unit: Unit) -> float:
        """Maximum shield of a unit."""
        return unit.shield_max

    def get_surrounding_pathing(self, unit: Unit) -> list[bool]:
        """Which squares around a unit of an agent are walkable or off the map, as in `obs_pathing_grid`."""
        around: list[bool] = self._views.walkable_around()[unit.tag, :N_PATHING].tolist()
        return around

    def get_surrounding_height(self, unit: Unit) -> list[float]:
        """Terrain heights around a unit of an agent, as in `obs_terrain_height`."""
        around: list[float] = self._views.heights_around()[unit.tag].tolist()
        return around

    @staticmethod
    def distance(x1: float, y1: float, x2: float, y2: float) -> float:
        """Distance between two points."""
        return math.hypot(x2 - x1, y2 - y1)
