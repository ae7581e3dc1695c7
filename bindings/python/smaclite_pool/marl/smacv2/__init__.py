"""SMACv2's interface: code that was written for `smacv2` runs with these classes, on battles of this package.

    from smaclite_pool.marl.smacv2 import StarCraftCapabilityEnvWrapper

    env = StarCraftCapabilityEnvWrapper(
        map_name="10gen_terran",
        capability_config={
            "n_units": 5,
            "n_enemies": 5,
            "team_gen": {
                "dist_type": "weighted_teams",
                "unit_types": ["marine", "marauder", "medivac"],
                "weights": [0.45, 0.45, 0.1],
                "exception_unit_types": ["medivac"],
                "observe": True,
            },
            "start_positions": {"dist_type": "surrounded_and_reflect", "p": 0.5, "map_x": 32, "map_y": 32},
        },
        use_unit_ranges=True,
        obs_own_pos=True,
        seed=1,
    )
    obs, state = env.reset()
    terminated = False
    while not terminated:
        actions = [row.index(1) for row in env.get_avail_actions()]   # the first available ones
        reward, terminated, info = env.step(actions)
    print(info["battle_won"], env.get_stats())
    env.close()

Code that imports `smacv2` itself runs unchanged with `smaclite_pool.compat`:

    python -m smaclite_pool.compat src/main.py --config=qmix --env-config=sc2v2 with env_args...

Battles are SMAClite's, without StarCraft II. What SMACv2's Python code computes from the units (observations,
state, available actions, partial observability, capabilities, rewards and ends) is computed by its rules. Its
published code departs from its intended rules in places; `published=True` reproduces them. Unlike SMACv2,
`seed=` and `seed(n)` make episodes reproducible.

Each environment plays one battle. To train with many at once, use batches of the generated scenarios
(`smaclite_pool.make("terran_5_vs_5", 64)`).
"""

from ..smac.unavailable import Unavailable
from .base import CannotResetException, MultiAgentEnv, UnavailableAction
from .distributions import Distribution, get_distribution, register_distribution
from .env import StarCraft2Env
from .maps import SMACMap, get_map_params, get_smac_map_registry, map_param_registry
from .units import Unit
from .wrapper import StarCraftCapabilityEnvWrapper

__all__ = [
    "CannotResetException",
    "Distribution",
    "MultiAgentEnv",
    "SMACMap",
    "StarCraft2Env",
    "StarCraftCapabilityEnvWrapper",
    "Unavailable",
    "UnavailableAction",
    "Unit",
    "get_distribution",
    "get_map_params",
    "get_smac_map_registry",
    "map_param_registry",
    "register_distribution",
]
