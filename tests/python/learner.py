"""A learner without learning: `learner.py POOL LANE STEPS_PER_SECOND` plays with a pool until Ctrl-C.

An agent attacks the nearest enemy within range and else waits; one action in eight is random.
"""

from __future__ import annotations

import signal
import sys
import time
from contextlib import suppress

import numpy as np
import smaclite_pool as sp

signal.signal(signal.SIGINT, signal.default_int_handler)  # SIGINT is ignored in background jobs of a script


def main(pool: str, lane: str, steps_per_s: str) -> None:
    with sp.connect(pool, lane) as envs:
        hold = sp.ScriptedPolicy("hold", envs)
        batch = envs.reset(seed=1)
        print("playing", flush=True)
        places = np.arange(envs.spec.num_envs * envs.spec.n_agents).reshape(
            envs.spec.num_envs, envs.spec.n_agents
        )
        for step in range(10**9):
            begin = time.monotonic()
            is_random = (places + step) % 8 == 0
            batch = envs.step(np.where(is_random, envs.sample_actions(), hold(batch)))
            time.sleep(max(0.0, begin + 1 / float(steps_per_s) - time.monotonic()))


with suppress(KeyboardInterrupt):
    main(*sys.argv[1:])
