"""The module of the environment in the published package."""

from smaclite_pool.compat.smaclite import SMACliteEnv

__all__ = ["SMACliteEnv"]
