"""SMACv2's wrapper, which learners use: an environment whose every episode is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, SupportsInt

import numpy as np
from numpy.typing import NDArray

from ..._layout import Floats
from .base import MultiAgentEnv
from .env import StarCraft2Env

__all__ = ["StarCraftCapabilityEnvWrapper"]


class StarCraftCapabilityEnvWrapper(MultiAgentEnv):
    """An environment with `capability_config`. Reading an attribute that it lacks reads that of `env`.

    Args:
        arguments: those of `StarCraft2Env`.
    """

    env: StarCraft2Env

    def __init__(self, **arguments: Any) -> None:
        self.env = StarCraft2Env(**arguments)

    def __getattr__(self, name: str) -> Any:
        if name == "env":  # a copy that has no attributes yet
            raise AttributeError(name)
        return getattr(self.env, name)

    def reset(self) -> tuple[list[NDArray[Any]], Floats]:
        """As `StarCraft2Env.reset`."""
        return self.env.reset()

    def step(self, actions: Sequence[SupportsInt] | NDArray[Any]) -> tuple[float, bool, dict[str, Any]]:
        """As `StarCraft2Env.step`."""
        return self.env.step(actions)

    def get_obs(self) -> list[NDArray[Any]]:
        """As `StarCraft2Env.get_obs`."""
        return self.env.get_obs()

    def get_obs_agent(self, agent_id: int) -> NDArray[Any]:
        """As `StarCraft2Env.get_obs_agent`."""
        return self.env.get_obs_agent(agent_id)

    def get_obs_size(self) -> int:
        """As `StarCraft2Env.get_obs_size`."""
        return self.env.get_obs_size()

    def get_obs_feature_names(self) -> list[str]:
        """As `StarCraft2Env.get_obs_feature_names`."""
        return self.env.get_obs_feature_names()

    def get_state(self) -> Floats:
        """As `StarCraft2Env.get_state`."""
        return self.env.get_state()

    def get_state_size(self) -> int:
        """As `StarCraft2Env.get_state_size`."""
        return self.env.get_state_size()

    def get_state_feature_names(self) -> list[str]:
        """As `StarCraft2Env.get_state_feature_names`."""
        return self.env.get_state_feature_names()

    def get_capabilities(self) -> Floats:
        """As `StarCraft2Env.get_capabilities`."""
        return self.env.get_capabilities()

    def get_capabilities_agent(self, agent_id: int) -> Floats:
        """As `StarCraft2Env.get_capabilities_agent`."""
        return self.env.get_capabilities_agent(agent_id)

    def get_cap_size(self) -> int:
        """As `StarCraft2Env.get_cap_size`."""
        return self.env.get_cap_size()

    def get_avail_actions(self) -> list[list[int]]:
        """As `StarCraft2Env.get_avail_actions`."""
        return self.env.get_avail_actions()

    def get_avail_agent_actions(self, agent_id: int) -> list[int]:
        """As `StarCraft2Env.get_avail_agent_actions`."""
        return self.env.get_avail_agent_actions(agent_id)

    def get_total_actions(self) -> int:
        """As `StarCraft2Env.get_total_actions`."""
        return self.env.get_total_actions()

    def get_env_info(self) -> dict[str, Any]:
        """As `StarCraft2Env.get_env_info`."""
        return self.env.get_env_info()

    def get_stats(self) -> dict[str, float]:
        """As `StarCraft2Env.get_stats`."""
        return self.env.get_stats()

    def seed(self, seed: int | None = None) -> int:
        """As `StarCraft2Env.seed`."""
        return self.env.seed(seed)

    def render(self, mode: str = "human") -> NDArray[np.uint8] | bool:
        """As `StarCraft2Env.render`."""
        return self.env.render(mode)

    def save_replay(self) -> Any:
        """As `StarCraft2Env.save_replay`."""
        return self.env.save_replay()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.env!r}>"

    def close(self) -> None:
        """As `StarCraft2Env.close`."""
        self.env.close()
