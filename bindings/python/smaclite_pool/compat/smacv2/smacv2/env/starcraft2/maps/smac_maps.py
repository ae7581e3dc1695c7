"""The module of the map table in the published package."""

from smaclite_pool.marl.smacv2 import SMACMap, get_map_params, get_smac_map_registry, map_param_registry

__all__ = ["SMACMap", "get_map_params", "get_smac_map_registry", "map_param_registry"]
