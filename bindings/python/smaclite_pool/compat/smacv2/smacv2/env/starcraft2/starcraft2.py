"""The module of the environment in the published package."""

from smaclite_pool.marl.smacv2 import CannotResetException, MultiAgentEnv, StarCraft2Env

__all__ = ["CannotResetException", "MultiAgentEnv", "StarCraft2Env"]
