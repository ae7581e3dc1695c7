"""SMACv2's wrapper, which learners use: an environment whose every episode is drawn."""

from __future__ import annotations

from collections.abc import Callable
from functools import update_wrapper
from typing import Any, Concatenate, ParamSpec, TypeVar

from .base import MultiAgentEnv
from .env import StarCraft2Env

__all__ = ["StarCraftCapabilityEnvWrapper"]

Given = ParamSpec("Given")
Result = TypeVar("Result")


def _of_env(
    method: Callable[Concatenate[StarCraft2Env, Given], Result],
) -> Callable[Concatenate[StarCraftCapabilityEnvWrapper, Given], Result]:
    """The method of the wrapper that calls this one of its environment."""
    name = method.__name__

    def call(self: StarCraftCapabilityEnvWrapper, /, *args: Given.args, **kwargs: Given.kwargs) -> Result:
        result: Result = getattr(self.env, name)(*args, **kwargs)
        return result

    update_wrapper(call, method)  # the signature
    call.__module__, call.__qualname__ = __name__, f"StarCraftCapabilityEnvWrapper.{name}"
    call.__doc__ = f"As `StarCraft2Env.{name}`."
    return call


class StarCraftCapabilityEnvWrapper(MultiAgentEnv):
    """An environment with `capability_config`. Its methods and attributes are those of `env`.

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

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.env!r}>"

    # `__getattr__` is not asked for what the base class has.
    reset = _of_env(StarCraft2Env.reset)
    step = _of_env(StarCraft2Env.step)
    get_obs = _of_env(StarCraft2Env.get_obs)
    get_obs_agent = _of_env(StarCraft2Env.get_obs_agent)
    get_obs_size = _of_env(StarCraft2Env.get_obs_size)
    get_obs_feature_names = _of_env(StarCraft2Env.get_obs_feature_names)
    get_state = _of_env(StarCraft2Env.get_state)
    get_state_size = _of_env(StarCraft2Env.get_state_size)
    get_state_feature_names = _of_env(StarCraft2Env.get_state_feature_names)
    get_capabilities = _of_env(StarCraft2Env.get_capabilities)
    get_capabilities_agent = _of_env(StarCraft2Env.get_capabilities_agent)
    get_cap_size = _of_env(StarCraft2Env.get_cap_size)
    get_avail_actions = _of_env(StarCraft2Env.get_avail_actions)
    get_avail_agent_actions = _of_env(StarCraft2Env.get_avail_agent_actions)
    get_total_actions = _of_env(StarCraft2Env.get_total_actions)
    get_env_info = _of_env(StarCraft2Env.get_env_info)
    get_stats = _of_env(StarCraft2Env.get_stats)
    seed = _of_env(StarCraft2Env.seed)
    render = _of_env(StarCraft2Env.render)
    save_replay = _of_env(StarCraft2Env.save_replay)
    close = _of_env(StarCraft2Env.close)
