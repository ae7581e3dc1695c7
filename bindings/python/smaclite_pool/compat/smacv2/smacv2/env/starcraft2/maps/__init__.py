"""The maps."""

from smaclite_pool.marl.smacv2 import get_map_params

__all__ = ["get_map_params"]
