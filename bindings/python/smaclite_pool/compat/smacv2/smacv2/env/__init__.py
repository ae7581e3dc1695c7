"""The environments."""

from smaclite_pool.marl.smacv2 import MultiAgentEnv, StarCraft2Env, StarCraftCapabilityEnvWrapper

__all__ = ["MultiAgentEnv", "StarCraft2Env", "StarCraftCapabilityEnvWrapper"]
