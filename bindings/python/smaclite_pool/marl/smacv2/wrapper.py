"""SMACv2's wrapper, which learners use: an environment whose every episode is drawn."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .base import MultiAgentEnv
from .env import StarCraft2Env

__all__ = ["StarCraftCapabilityEnvWrapper"]


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


def _of_env(name: str) -> Callable[..., Any]:
    def method(self: StarCraftCapabilityEnvWrapper, *args: Any, **kwargs: Any) -> Any:
        return getattr(self.env, name)(*args, **kwargs)

    method.__name__, method.__doc__ = name, f"As `StarCraft2Env.{name}`."
    return method


# `__getattr__` is not asked for what the base class has.
for _name in [name for name in vars(MultiAgentEnv) if not name.startswith("_")]:
    setattr(StarCraftCapabilityEnvWrapper, _name, _of_env(_name))
