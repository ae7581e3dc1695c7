"""The module of the environment in the published package."""

from smaclite_pool.marl.smac import Direction, MultiAgentEnv, StarCraft2Env

__all__ = ["Direction", "MultiAgentEnv", "StarCraft2Env"]
