"""SMAC's interface: code that was written for `smac.env.StarCraft2Env` runs with this class unchanged.

    from smaclite_pool.marl.smac import MultiAgentEnv

    env = MultiAgentEnv(map_name="2s3z", seed=1)
    obs, state = env.reset()
    terminated = False
    while not terminated:
        actions = [row.index(1) for row in env.get_avail_actions()]   # the first available ones
        reward, terminated, info = env.step(actions)
    print(info["battle_won"], env.get_stats())
    env.close()

Code that imports `smac` itself runs unchanged with `smaclite_pool.compat`:

    python -m smaclite_pool.compat src/main.py --config=qmix --env-config=sc2 with env_args.map_name=MMM2

Each environment is a separate pool and returns arrays that you can keep and change. To train with many
environments at once use batches: `smaclite_pool.make`, or `smaclite_pool.marl.epymarl` for EPyMARL and
PyMARL.
"""

from ..._units import Unit
from .details import Direction
from .env import MultiAgentEnv, get_map_params
from .unavailable import Unavailable

__all__ = ["Direction", "MultiAgentEnv", "StarCraft2Env", "Unavailable", "Unit", "get_map_params"]

StarCraft2Env = MultiAgentEnv
