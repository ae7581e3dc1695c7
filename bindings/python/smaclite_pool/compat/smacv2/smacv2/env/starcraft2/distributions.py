"""The module of the distributions in the published package."""

from smaclite_pool.marl.smacv2 import Distribution, get_distribution, register_distribution

__all__ = ["Distribution", "get_distribution", "register_distribution"]
