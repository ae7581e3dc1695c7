"""The features of SMACv2's observations and state by name, in their order; sizes follow from them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..smac.views import N_HEIGHT, N_PATHING

__all__ = ["FeatureNames"]


class FeatureNames:
    """The names of the features of an environment.

    Args:
        scenario: the contents of the scenario file, with all options of `smacv2`.
        n_actions: actions of an agent.
    """

    def __init__(self, scenario: Mapping[str, Any], n_actions: int) -> None:
        options = scenario["smacv2"]
        self._options, self._n_actions = options, n_actions
        self._n_agents, self._n_enemies = scenario["num_allied_units"], scenario["num_enemy_units"]
        self._shields = {
            "ally": [*["shield"] * scenario["ally_has_shields"]],
            "enemy": [*["shield"] * scenario["enemy_has_shields"]],
        }
        types = scenario["num_unit_types"]
        self._bits = types if types > 1 else 0
        self._looks = ["fov_x", "fov_y"] if options["conic_fov"] else []
        self._attack = ["attack_prob"] if "attack" in options else []
        self._level = ["health_level"] if "health" in options else []

    # --- One unit each ---

    def moves(self) -> list[str]:
        """Of an observation: moves and terrain."""
        names = [f"move_action_{direction}" for direction in ("north", "south", "east", "west")]
        names += [f"pathing_grid_{point}" for point in range(N_PATHING * self._options["obs_pathing_grid"])]
        return names + [
            f"terrain_height_{point}" for point in range(N_HEIGHT * self._options["obs_terrain_height"])
        ]

    def seen_enemy(self, enemy: int) -> list[str]:
        """Of an observation: one enemy."""
        names = ["shootable", "distance", "relative_x", "relative_y", *self._health("enemy")]
        return [f"enemy_{name}_{enemy}" for name in names] + self._types(f"enemy_unit_type_{enemy}")

    def seen_ally(self, ally: int) -> list[str]:
        """Of an observation: one ally."""
        names = ["visible", "distance", "relative_x", "relative_y", *self._health("ally")]
        names += [*self._attack, *self._level]
        actions = self._n_actions if self._options["obs_last_action"] else 0
        return [
            *(f"ally_{name}_{ally}" for name in names),
            *self._types(f"ally_unit_type_{ally}"),
            *(f"ally_last_action_{ally}_action_{action}" for action in range(actions)),
        ]

    def own(self) -> list[str]:
        """Of an observation: the agent itself."""
        options = self._options
        has_health = options["obs_own_health"] or options["obs_all_health"]
        names = ["health", *self._shields["ally"]] if has_health else []
        names += [*self._attack, *self._level]
        names += ["pos_x", "pos_y"] if options["obs_own_pos"] else []
        return [f"own_{name}" for name in [*names, *self._looks]] + self._types("own_unit_type")

    def ally(self, ally: int) -> list[str]:
        """Of the state: one ally."""
        names = ["health", "cooldown", "relative_x", "relative_y", *self._shields["ally"]]
        names += [*self._attack, *self._level, *self._looks]
        return [f"ally_{name}_{ally}" for name in names] + self._types(f"ally_unit_type_{ally}")

    def enemy(self, enemy: int) -> list[str]:
        """Of the state: one enemy."""
        names = ["health", "relative_x", "relative_y", *self._shields["enemy"]]
        return [f"enemy_{name}_{enemy}" for name in names] + self._types(f"enemy_unit_type_{enemy}")

    def _health(self, side: str) -> list[str]:
        return ["health", *self._shields[side]] if self._options["obs_all_health"] else []

    def _types(self, prefix: str) -> list[str]:
        return [f"{prefix}_bit_{bit}" for bit in range(self._bits)]

    # --- All of them ---

    def observation(self) -> list[str]:
        """Of the observation of agent 0; the others have the same features about other allies."""
        names = self.moves()
        for enemy in range(self._n_enemies):
            names += self.seen_enemy(enemy)
        for ally in range(1, self._n_agents):
            names += self.seen_ally(ally)
        names = [*names, *self.own()] if self._options["obs_starcraft"] else []
        return [*names, *["timestep"] * self._options["obs_timestep_number"]]

    def state(self) -> list[str]:
        """Of the state, if it is not the observations."""
        agents, names = range(self._n_agents), []
        for ally in agents:
            names += self.ally(ally)
        for enemy in range(self._n_enemies):
            names += self.enemy(enemy)
        if self._options["state_last_action"]:
            actions = range(self._n_actions)
            names += [f"ally_last_action_{agent}_action_{action}" for agent in agents for action in actions]
        return [*names, *["timestep"] * self._options["state_timestep_number"]]

    def ally_attributes(self) -> list[str]:
        """`agent_features` of `get_env_info`. The state has the looks after the capabilities."""
        names = ["health", "energy/cooldown", "rel_x", "rel_y", *self._shields["ally"], *self._looks]
        names += ["attack_probability"] * len(self._attack) + ["total_health"] * len(self._level)
        return names + [f"type_{bit}" for bit in range(self._bits)]

    def enemy_attributes(self) -> list[str]:
        """`enemy_features` of `get_env_info`."""
        names = ["health", "rel_x", "rel_y", *self._shields["enemy"]]
        return names + [f"type_{bit}" for bit in range(self._bits)]
