"""The methods of SMACv2's environment that read it between two steps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._layout import Bools, Floats
from ..._native import NORTH, CapabilityBattle
from ...errors import InvalidRequest
from ..smac.details import Direction
from .base import MultiAgentEnv
from .names import FeatureNames
from .units import LEARNER_IDS, Unit, all_units

__all__ = ["Queries"]


class Queries(MultiAgentEnv):
    """The part of `StarCraft2Env` that changes nothing. Arrays are copies that you can keep and change."""

    n_agents: int
    n_enemies: int
    n_actions: int
    episode_limit: int
    n_actions_no_attack: int
    """The first action that has a target."""
    n_actions_move = 4
    _battle: CapabilityBattle
    _names: FeatureNames
    _options: dict[str, Any]
    _has_begun: bool
    _before: dict[str, NDArray[Any]]
    _last_actions: list[int] | None

    baneling_id = LEARNER_IDS["BANELING"]
    colossus_id = LEARNER_IDS["COLOSSUS"]
    hydralisk_id = LEARNER_IDS["HYDRALISK"]
    marauder_id = LEARNER_IDS["MARAUDER"]
    marine_id = LEARNER_IDS["MARINE"]
    medivac_id = LEARNER_IDS["MEDIVAC"]
    stalker_id = LEARNER_IDS["STALKER"]
    zealot_id = LEARNER_IDS["ZEALOT"]
    zergling_id = LEARNER_IDS["ZERGLING"]

    def __getattr__(self, name: str) -> Any:
        """The options of SMACv2 by their names, such as `obs_own_pos`."""
        if name.startswith("_") or name not in self._options:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return self._options[name]

    # --- State, actions, capabilities ---

    def get_state(self) -> Floats:
        """The state: float32 [get_state_size()]; zeros before the first reset."""
        if not self._has_begun:
            return np.zeros(self.get_state_size(), np.float32)
        return self._battle.state()

    def get_state_dict(self) -> dict[str, Floats]:
        """The parts of the state by name, float32.

        `allies` [A, features], `enemies` [E, features] and, if the options include them, `last_action` [A, N]
        and `timestep` [].
        """
        state, begin = self.get_state(), 0
        parts: dict[str, Floats] = {}
        shapes: dict[str, tuple[int, ...]] = {
            "allies": (self.n_agents, self.get_ally_num_attributes()),
            "enemies": (self.n_enemies, self.get_enemy_num_attributes()),
        }
        if self._options["state_last_action"]:
            shapes["last_action"] = (self.n_agents, self.n_actions)
        if self._options["state_timestep_number"]:
            shapes["timestep"] = ()
        for name, shape in shapes.items():
            parts[name] = state[begin : begin + math.prod(shape)].reshape(shape)
            begin += math.prod(shape)
        return parts

    def get_avail_actions(self) -> list[list[int]]:
        """Which actions are available in the next step: per agent, a list of 0 or 1 per action."""
        self._require_episode()
        available: list[list[int]] = self._battle.avail().astype(int).tolist()
        return available

    def get_avail_agent_actions(self, agent_id: int) -> list[int]:
        """Which actions of one agent are available in the next step: 0 or 1 per action."""
        return self.get_avail_actions()[agent_id]

    def get_capabilities(self) -> Floats:
        """The capabilities of all agents: float32 [A * get_cap_size()].

        Per agent the probability that its attacks succeed, the share of its health below which it dies (both
        if the capability is there), and the one-hot of its type.
        """
        self._require_episode()
        return self._battle.capabilities().reshape(-1)

    def get_capabilities_agent(self, agent_id: int) -> Floats:
        """The capabilities of one agent: float32 [get_cap_size()]."""
        self._require_episode()
        own: Floats = self._battle.capabilities()[agent_id]
        return own

    def get_visibility_matrix(self) -> Bools:
        """bool [A, A + E]: which units each agent sees; False for itself, and for dead agents."""
        self._require_episode()
        return self._battle.visibility().astype(np.bool_)

    # --- Sizes and names ---

    def get_obs_size(self) -> int:
        """Number of features of an observation."""
        return self._battle.obs_size

    def get_state_size(self) -> int:
        """Number of features of the state."""
        return self._battle.state_size

    def get_cap_size(self) -> int:
        """Number of capabilities of an agent."""
        return self._battle.cap_size

    def get_total_actions(self) -> int:
        """Number of actions of an agent."""
        return self.n_actions

    def get_obs_move_feats_size(self) -> int:
        """Number of features of an observation about moves and terrain."""
        return len(self._names.moves())

    def get_obs_enemy_feats_size(self) -> tuple[int, int]:
        """Number of enemies in an observation, and number of features per enemy."""
        return self.n_enemies, len(self._names.seen_enemy(0))

    def get_obs_ally_feats_size(self) -> tuple[int, int]:
        """Number of allies in an observation, and number of features per ally."""
        return self.n_agents - 1, len(self._names.seen_ally(0))

    def get_obs_own_feats_size(self) -> int:
        """Number of features of an observation about the agent itself."""
        return len(self._names.own())

    def get_ally_num_attributes(self) -> int:
        """Number of features of an ally in the state."""
        return len(self.ally_state_attr_names)

    def get_enemy_num_attributes(self) -> int:
        """Number of features of an enemy in the state."""
        return len(self.enemy_state_attr_names)

    @property
    def ally_state_attr_names(self) -> list[str]:
        """The features of an ally in the state; `get_state_feature_names` has their order."""
        return self._names.ally_attributes()

    @property
    def enemy_state_attr_names(self) -> list[str]:
        """Names of the features of an enemy in the state."""
        return self._names.enemy_attributes()

    def get_obs_feature_names(self) -> list[str]:
        """Names of the features of the observation of agent 0."""
        return self._names.observation()

    def get_state_feature_names(self) -> list[str]:
        """Names of the features of the state."""
        if self._options["obs_instead_of_state"]:
            return self._names.observation() * self.n_agents
        return self._names.state()

    def get_env_info(self) -> dict[str, Any]:
        """Sizes, the episode limit, and the names of the features of allies and enemies in the state."""
        return {
            **super().get_env_info(),
            "agent_features": self.ally_state_attr_names,
            "enemy_features": self.enemy_state_attr_names,
        }

    # --- Units ---

    @property
    def agents(self) -> dict[int, Unit]:
        """All allies by agent, including dead ones; empty before the first reset."""
        return self._sides(self._now())[0]

    @property
    def enemies(self) -> dict[int, Unit]:
        """All enemies by id, including dead ones; empty before the first reset."""
        return self._sides(self._now())[1]

    @property
    def previous_ally_units(self) -> dict[int, Unit]:
        """`agents` before the last step; those of now after a reset."""
        return self._sides(self._before if self._has_begun else None)[0]

    @property
    def previous_enemy_units(self) -> dict[int, Unit]:
        """`enemies` before the last step; those of now after a reset."""
        return self._sides(self._before if self._has_begun else None)[1]

    def _now(self) -> dict[str, NDArray[Any]] | None:
        return self._battle.units() if self._has_begun else None

    def _sides(self, columns: dict[str, NDArray[Any]] | None) -> tuple[dict[int, Unit], dict[int, Unit]]:
        """The units of both sides by id; none if there are no columns."""
        units = [] if columns is None else all_units(columns, self._battle.type_names, self.n_agents)
        return dict(enumerate(units[: self.n_agents])), dict(enumerate(units[self.n_agents :]))

    def get_unit_by_id(self, a_id: int) -> Unit:
        """The unit of an agent."""
        return self.agents[a_id]

    def get_unit_types(self) -> list[int]:
        """The `unit_type` of each ally, then of each enemy; empty before the first reset."""
        allies, enemies = self._sides(self._now())
        return [unit.unit_type for unit in [*allies.values(), *enemies.values()]]

    @property
    def last_action(self) -> NDArray[np.float64]:
        """float64 [A, N]: the last action of each agent, one-hot; zeros after a reset."""
        chosen = np.zeros((self.n_agents, self.n_actions))
        if self._last_actions is not None:
            chosen[range(self.n_agents), self._last_actions] = 1
        return chosen

    @property
    def death_tracker_ally(self) -> NDArray[np.float64]:
        """float64 [A]: 1 for agents that died in this episode, else 0."""
        dead = [unit.health == 0 for unit in self.agents.values()] or [False] * self.n_agents
        return np.array(dead, np.float64)

    @property
    def death_tracker_enemy(self) -> NDArray[np.float64]:
        """float64 [E]: 1 for enemies that died in this episode, else 0."""
        dead = [unit.health == 0 for unit in self.enemies.values()] or [False] * self.n_enemies
        return np.array(dead, np.float64)

    def can_move(self, unit: Unit, direction: int) -> bool:
        """Whether a unit of an agent can move to the north (0), south (1), east (2) or west (3).

        Raises InvalidRequest for an enemy.
        """
        if unit.owner != 1:
            raise InvalidRequest("can_move needs a unit of an agent; the battle moves enemies")
        return bool(self.get_avail_agent_actions(unit.tag)[NORTH + Direction(direction)])

    @property
    def max_reward(self) -> float:
        """The unscaled return that is scaled to `reward_scale_rate`; of the enemies of this episode."""
        return self._battle.max_reward()

    @staticmethod
    def distance(x1: float, y1: float, x2: float, y2: float) -> float:
        """Distance between two points."""
        return math.hypot(x2 - x1, y2 - y1)

    def _require_episode(self) -> None:
        raise NotImplementedError

    def _observations(self) -> list[NDArray[Any]]:
        obs = self._battle.obs()
        options = self._options
        if not (options["published"] and options["obs_timestep_number"] and options["obs_starcraft"]):
            return list(obs)
        # The published code appends the time in double precision, which makes all of it double.
        wide: NDArray[np.float64] = obs.astype(np.float64)
        wide[:, -1] = self._battle.time()
        return list(wide)
