"""The base class in the published package."""

from smaclite_pool.marl.smacv2 import MultiAgentEnv

__all__ = ["MultiAgentEnv"]
