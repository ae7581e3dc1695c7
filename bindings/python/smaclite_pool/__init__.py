"""Batched SMAClite battles, stepped by native worker threads and read from shared memory without a copy.

    import smaclite_pool as sp

    with sp.make("2s3z", num_envs=64) as envs:      # a pool in this process
        batch = envs.reset(seed=1)
        for _ in range(1000):
            actions = envs.sample_actions()         # int32 [64, n_agents], available actions only
            batch = envs.step(actions)              # batch.obs, batch.avail_actions, batch.reward, ...

`smaclite-pool serve 2s3z:64 --name train` serves a pool in a separate process, and `sp.connect("train")`
attaches to it. Methods and results are the same, bit for bit.

Code written for a framework goes on as it is, by a module each: `gymnasium` (its ids, `smaclite_pool/2s3z-v0` and so
on, need only this import), `drop_in` (for `import smaclite`), `smac`, `epymarl`, `on_policy`, `pettingzoo`, `torchrl`,
`rllib`, `envpool`, `torch`, `jax` and `ray`. `help("smaclite_pool.smac")` and its like begin with an example.

Terms: an agent is a unit that the learner controls; a unit is any body in a battle. A step is one decision of
the agents. A lane is a set of environments with one learner. A batch holds the results of M environments, one
per slot.
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
