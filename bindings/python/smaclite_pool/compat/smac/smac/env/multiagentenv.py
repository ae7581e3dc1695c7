"""The base class in the published package."""

from smaclite_pool.marl.smac import MultiAgentEnv

__all__ = ["MultiAgentEnv"]
