"""Battles of SMAClite, many at once, stepped by native worker threads and read in place from shared memory.

    import smaclite_pool as sp

    with sp.make("2s3z", num_envs=64) as envs:      # a pool within this process
        batch = envs.reset(seed=1)
        for _ in range(1000):
            actions = envs.sample_actions()         # int32 [64, n_agents], legal
            batch = envs.step(actions)              # batch.obs, batch.state, batch.avail_actions, batch.reward, ...

A pool in a process of its own is served by `smaclite-pool serve 2s3z:64 --name train` and attached to by
`sp.connect("train")`: the same methods, the same bits.

Code written for a framework goes on as it is, by a module each: `gymnasium` (its ids, `smaclite_pool/2s3z-v0` and so
on, need only this import), `drop_in` (for `import smaclite`), `smac`, `epymarl`, `on_policy`, `pettingzoo`, `torchrl`,
`rllib`, `envpool`, `torch`, `jax` and `ray`. `help("smaclite_pool.smac")` and its like begin with an example.

Words: an agent is a learner's slot, a unit any body. A step is one decision. A lane is a set of environments with one
learner. A batch has M slots, one environment each.
"""

from ._native import Batch, Envs, Frame, __version__, connect, make, pools, scenario, scenarios, status
from ._registration import register_when_imported
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

register_when_imported()
