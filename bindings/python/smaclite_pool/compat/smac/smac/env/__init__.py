"""The environments."""

from smaclite_pool.marl.smac import MultiAgentEnv, StarCraft2Env

__all__ = ["MultiAgentEnv", "StarCraft2Env"]
