"""The base class of SMACv2's environments, and the errors of this package."""

from __future__ import annotations

from typing import Any

from ...errors import IllegalAction

__all__ = ["CannotResetException", "MultiAgentEnv", "UnavailableAction"]


class CannotResetException(Exception):
    """SMACv2 raises it where StarCraft II creates no units. It never happens here."""


class UnavailableAction(IllegalAction, AssertionError):
    """An action is not available to its agent. Nothing was stepped.

    An AssertionError as in SMACv2, whose message libraries compare, with the attributes of IllegalAction.
    """


class MultiAgentEnv:
    """What SMACv2's environments have in common; each method raises NotImplementedError."""

    n_agents: int
    episode_limit: int

    def step(self, actions: Any) -> tuple[float, bool, dict[str, Any]]:
        """The reward, whether the episode ended, and `info`."""
        raise NotImplementedError

    def get_obs(self) -> list[Any]:
        """The observations of all agents."""
        raise NotImplementedError

    def get_obs_agent(self, agent_id: int) -> Any:
        """The observation of one agent."""
        raise NotImplementedError

    def get_obs_size(self) -> int:
        """The size of an observation."""
        raise NotImplementedError

    def get_capabilities(self) -> Any:
        """The capabilities of all agents."""
        raise NotImplementedError

    def get_capabilities_agent(self, agent_id: int) -> Any:
        """The capabilities of one agent."""
        raise NotImplementedError

    def get_cap_size(self) -> int:
        """The number of capabilities of an agent."""
        raise NotImplementedError

    def get_state(self) -> Any:
        """The state."""
        raise NotImplementedError

    def get_state_size(self) -> int:
        """The size of the state."""
        raise NotImplementedError

    def get_avail_actions(self) -> list[list[int]]:
        """The available actions of all agents."""
        raise NotImplementedError

    def get_avail_agent_actions(self, agent_id: int) -> list[int]:
        """The available actions of one agent."""
        raise NotImplementedError

    def get_total_actions(self) -> int:
        """The number of actions of an agent."""
        raise NotImplementedError

    def reset(self) -> Any:
        """Begin an episode; observations and state."""
        raise NotImplementedError

    def render(self, mode: str = "human") -> Any:
        """Show the battle."""
        raise NotImplementedError

    def close(self) -> None:
        """End the battle."""
        raise NotImplementedError

    def seed(self, seed: int | None = None) -> Any:
        """Set the seed."""
        raise NotImplementedError

    def save_replay(self) -> Any:
        """Write a replay."""
        raise NotImplementedError

    def get_env_info(self) -> dict[str, Any]:
        """The sizes of the environment."""
        return {
            "state_shape": self.get_state_size(),
            "obs_shape": self.get_obs_size(),
            "cap_shape": self.get_cap_size(),
            "n_actions": self.get_total_actions(),
            "n_agents": self.n_agents,
            "episode_limit": self.episode_limit,
        }
