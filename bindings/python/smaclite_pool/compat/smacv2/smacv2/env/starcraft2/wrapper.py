"""The module of the wrapper in the published package."""

from smaclite_pool.marl.smacv2 import (
    MultiAgentEnv,
    StarCraft2Env,
    StarCraftCapabilityEnvWrapper,
    get_distribution,
)

__all__ = ["MultiAgentEnv", "StarCraft2Env", "StarCraftCapabilityEnvWrapper", "get_distribution"]
