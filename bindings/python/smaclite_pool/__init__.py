"""Battles of SMAClite, many at once, stepped by native worker threads and read in place from shared memory.

    import smaclite_pool as sp

    with sp.make("2s3z", num_envs=64) as envs:      # a pool within this process
        batch = envs.reset(seed=1)
        for _ in range(1000):
            actions = envs.sample_actions()         # int32 [64, n_agents], legal
            batch = envs.step(actions)              # batch.obs, batch.state, batch.avail_actions, batch.reward, ...

A pool in a process of its own is served by `smaclite-pool serve 2s3z:64 --name train` and attached to by
`sp.connect("train")`: the same methods, the same bits.

Other interfaces are modules of this package:

- `integrations`: `gymnasium`, `pettingzoo`, `torchrl`, `rllib`, `envpool` (an EnvPool-compatible API),
  `torch`, `jax` and `ray`. Importing `smaclite_pool.integrations.gymnasium` registers Gymnasium's ids.
- `marl`: `smac` (SMAC's interface), `epymarl` and `on_policy`.
- `compat`: drop-in replacements for the packages `smaclite` and `smac`.

None of them is imported with this package, and each docstring begins with an example:
`help("smaclite_pool.marl.smac")`.

Words: an agent is a learner's slot, a unit any body. A step is one decision. A lane is a set of environments with one
learner. A batch has M slots, one environment each.
"""

from ._native import Batch, Envs, Frame, __version__, connect, make, pools, scenario, scenarios, status
from .errors import (
    Busy,
    Closed,
    ConnectError,
    Forked,
    IllegalAction,
    InvalidRequest,
    LaneFailed,
    LaneTaken,
    NoSuchPool,
    PoolDied,
    PoolError,
    ScenarioError,
    StartError,
    Timeout,
    TooLittleMemory,
    TooManyBatchesHeld,
)

__all__ = [
    "Batch",
    "Busy",
    "Closed",
    "ConnectError",
    "Envs",
    "Forked",
    "Frame",
    "IllegalAction",
    "InvalidRequest",
    "LaneFailed",
    "LaneTaken",
    "NoSuchPool",
    "PoolDied",
    "PoolError",
    "ScenarioError",
    "StartError",
    "Timeout",
    "TooLittleMemory",
    "TooManyBatchesHeld",
    "__version__",
    "connect",
    "make",
    "pools",
    "scenario",
    "scenarios",
    "status",
]
