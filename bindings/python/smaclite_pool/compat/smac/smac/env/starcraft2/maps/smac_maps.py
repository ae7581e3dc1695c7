"""The module of the map table in the published package."""

from smaclite_pool.marl.smac import get_map_params

__all__ = ["get_map_params"]
