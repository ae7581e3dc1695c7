"""Where the published package has its environment."""

from smaclite_pool.drop_in import SMACliteEnv

__all__ = ["SMACliteEnv"]
