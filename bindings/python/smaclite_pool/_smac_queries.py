"""SMAC's questions: everything that can be asked of an environment between two steps."""

from __future__ import annotations

import math
from typing import Any

from ._layout import REACH, SIGHT, Bools, Floats
from ._smac_units import FIRST_TARGET, Unit
from ._smac_views import N_HEIGHT, N_PATHING, Views


class Queries:
    """The part of `MultiAgentEnv` that changes nothing. Arrays are the caller's own."""

    n_agents: int
    n_enemies: int
    n_actions: int
    episode_limit: int | None
    """Steps after which an episode ends; None for no limit."""
    n_actions_no_attack = FIRST_TARGET
    n_actions_move = 4
    n_obs_pathing = N_PATHING
    n_obs_height = N_HEIGHT
    _views: Views
    _avail: Bools

    # --- Observations, state, actions ---

    def get_obs(self) -> list[Floats]:
        """What each agent sees: a list of float32 [get_obs_size()]."""
        return list(self._views.observations())

    def get_obs_agent(self, agent_id: int) -> Floats:
        """What one agent sees: float32 [get_obs_size()]."""
        return self.get_obs()[agent_id]

    def get_state(self) -> Floats:
        """The state: float32 [get_state_size()]; for training only."""
        return self._views.state()

    def get_state_dict(self) -> dict[str, Floats]:
        """The state by what it speaks of: `allies` [A, figures], `enemies` [E, figures] and, if they are in the state,
        `last_action` [A, N] and `timestep`. The figures' names are in `get_env_info()`.
        """
        return self._views.state_dict()

    def get_avail_actions(self) -> list[list[int]]:
        """1 for each action that is legal in the next step, by agent."""
        legal: list[list[int]] = self._avail.astype(int).tolist()
        return legal

    def get_avail_agent_actions(self, agent_id: int) -> list[int]:
        """1 for each action that is legal for one agent in the next step."""
        return self.get_avail_actions()[agent_id]

    def get_visibility_matrix(self) -> Bools:
        """bool [A, A + E]: which allies and enemies each agent sees; nobody sees itself, the dead see nobody."""
        return self._views.visibility()

    # --- Sizes ---

    def get_obs_size(self) -> int:
        """Figures of an observation."""
        enemies, enemy = self.get_obs_enemy_feats_size()
        allies, ally = self.get_obs_ally_feats_size()
        return self.get_obs_move_feats_size() + enemies * enemy + allies * ally + self.get_obs_own_feats_size()

    def get_obs_move_feats_size(self) -> int:
        """Figures of an observation about moves and the ground around."""
        return self._views.move_features()

    def get_obs_enemy_feats_size(self) -> tuple[int, int]:
        """How many enemies an observation has, and figures of each."""
        return self._views.enemy_features()

    def get_obs_ally_feats_size(self) -> tuple[int, int]:
        """How many allies an observation has, and figures of each."""
        return self._views.ally_features(self.n_actions)

    def get_obs_own_feats_size(self) -> int:
        """Figures of an observation about the agent itself."""
        return self._views.own_features()

    def get_state_size(self) -> int:
        """Figures of the state."""
        if self._views.options.instead_of_state:
            return self.n_agents * self.get_obs_size()
        return self._views.state_size(self.n_actions)

    def get_total_actions(self) -> int:
        """How many actions there are."""
        return self.n_actions

    def get_ally_num_attributes(self) -> int:
        """Figures of an ally in the state."""
        return len(self.ally_state_attr_names)

    def get_enemy_num_attributes(self) -> int:
        """Figures of an enemy in the state."""
        return len(self.enemy_state_attr_names)

    def get_env_info(self) -> dict[str, Any]:
        """Sizes, the episode limit, and the names of the state's figures of an ally and of an enemy."""
        return {
            "state_shape": self.get_state_size(),
            "obs_shape": self.get_obs_size(),
            "n_actions": self.get_total_actions(),
            "n_agents": self.n_agents,
            "episode_limit": self.episode_limit,
            "agent_features": self.ally_state_attr_names,
            "enemy_features": self.enemy_state_attr_names,
        }

    # --- The scenario ---

    @property
    def unit_type_bits(self) -> int:
        """Length of the type one-hot; 0 for none."""
        return self._views.layout.type_bits

    @property
    def shield_bits_ally(self) -> int:
        """1 if observations and state have the shields of allies."""
        return self._views.layout.shield_bits_ally

    @property
    def shield_bits_enemy(self) -> int:
        """1 if observations and state have the shields of enemies."""
        return self._views.layout.shield_bits_enemy

    @property
    def ally_state_attr_names(self) -> list[str]:
        """Names of an ally's figures in the state."""
        return ["health", "energy/cooldown", "rel_x", "rel_y", *self._views.layout.tail_names(self.shield_bits_ally)]

    @property
    def enemy_state_attr_names(self) -> list[str]:
        """Names of an enemy's figures in the state."""
        return ["health", "rel_x", "rel_y", *self._views.layout.tail_names(self.shield_bits_enemy)]

    @property
    def map_x(self) -> int:
        """Width of the map in squares."""
        return int(self._views.layout.map_size[0])

    @property
    def map_y(self) -> int:
        """Height of the map in squares."""
        return int(self._views.layout.map_size[1])

    def get_unit_types(self) -> list[int]:
        """The type of each ally and then each enemy: its place in the type one-hot, 0 where there is none."""
        layout = self._views.layout
        return [unit["type_id"] for unit in layout.ally_figures + layout.enemy_figures]

    def unit_sight_range(self, agent_id: int) -> float:
        """How far an agent sees, in squares."""
        return SIGHT

    def unit_shoot_range(self, agent_id: int) -> float:
        """How far an agent may choose targets, in squares."""
        return REACH

    # --- Units ---

    @property
    def agents(self) -> dict[int, Unit]:
        """Every ally by agent, as it stands; the dead too."""
        return {agent: self.get_unit_by_id(agent) for agent in range(self.n_agents)}

    @property
    def enemies(self) -> dict[int, Unit]:
        """Every enemy by id, as it stands; the dead too."""
        return {enemy: self._views.field.unit(self.n_agents + enemy) for enemy in range(self.n_enemies)}

    def get_unit_by_id(self, a_id: int) -> Unit:
        """The unit of an agent."""
        return self._views.field.unit(range(self.n_agents)[a_id])

    def unit_max_cooldown(self, unit: Unit) -> float:
        """What `energy/cooldown` in the state is a fraction of: energy of healers, seconds of others."""
        return unit.energy_max if unit.is_healer else unit.weapon_cooldown_max

    def unit_max_shield(self, unit: Unit) -> float:
        """A unit's greatest shield."""
        return unit.shield_max

    def get_surrounding_pathing(self, unit: Unit) -> list[bool]:
        """Which squares around an agent's unit are walkable, or off the map; as `obs_pathing_grid` has them."""
        around: list[bool] = self._views.walkable_around()[unit.tag, :N_PATHING].tolist()
        return around

    def get_surrounding_height(self, unit: Unit) -> list[float]:
        """The heights around an agent's unit, as `obs_terrain_height` has them."""
        around: list[float] = self._views.heights_around()[unit.tag].tolist()
        return around

    @staticmethod
    def distance(x1: float, y1: float, x2: float, y2: float) -> float:
        """How far two points are from each other."""
        return math.hypot(x2 - x1, y2 - y1)
