"""Batched SMAClite battles, stepped by native worker threads and read from shared memory without a copy.

    import smaclite_pool as sp

    with sp.make("2s3z", num_envs=64) as envs:      # a pool in this process
        batch = envs.reset(seed=1)
        for _ in range(1000):
            actions = envs.sample_actions()         # int32 [64, n_agents], available actions only
            batch = envs.step(actions)              # batch.obs, batch.avail_actions, batch.reward, ...

`smaclite-pool serve 2s3z:64 --name train` serves a pool in a separate process, and `sp.connect("train")`
attaches to it. Methods and results are the same, bit for bit.

Other interfaces are modules of this package:

- `errors`: all exceptions. `extras`: views of single agents, rows of units, rollouts, and a base class of
  wrappers.
- `integrations`: `gymnasium`, `pettingzoo`, `torchrl`, `rllib`, `envpool` (an EnvPool-compatible API),
  `torch`, `jax` and `ray`. Importing `smaclite_pool.integrations.gymnasium` registers Gymnasium's ids.
  `vault` and `minari` write datasets for other libraries.
- `marl`: `smac` (SMAC's interface), `smacv2`, `epymarl` and `on_policy`.
- `compat`: drop-in replacements for the packages `smaclite`, `smac` and `smacv2`.

None of them is imported with this package, and each docstring begins with an example:
`help("smaclite_pool.marl.smac")`.
"""

from . import _interrupts as _interrupts  # first, as the others take most of the time
from . import errors, extras
from ._evaluation import Evaluation, evaluate
from ._native import (
    DATASET_ARRAYS,
    OPPONENTS,
    ZOO,
    Batch,
    Dataset,
    Envs,
    Frame,
    Recorder,
    Renderer,
    ScriptedPolicy,
    Spectator,
    __version__,
    connect,
    make,
    pack_snapshot,
    pools,
    scenario,
    scenarios,
    snapshot_columns,
    status,
)
from ._team import Team, load_team
from ._training import train

__all__ = [
    "DATASET_ARRAYS",
    "OPPONENTS",
    "ZOO",
    "Batch",
    "Dataset",
    "Envs",
    "Evaluation",
    "Frame",
    "Recorder",
    "Renderer",
    "ScriptedPolicy",
    "Spectator",
    "Team",
    "__version__",
    "connect",
    "errors",
    "evaluate",
    "extras",
    "load_team",
    "make",
    "pack_snapshot",
    "pools",
    "scenario",
    "scenarios",
    "snapshot_columns",
    "status",
    "train",
]
