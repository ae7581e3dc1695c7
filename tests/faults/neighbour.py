"""A pool that no fault reaches, and a learner that must not notice what others meet."""

from __future__ import annotations

import json
import os
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import smaclite_pool as sp

from .injection import LONGEST, PROGRAM

POOL = "faults"


class Neighbour:
    """A pool with the lanes `own` and `free`. A learner of `own` compares every batch with one of its own
    process. Commands attach to `free`, or follow `own`."""

    def __init__(self, pools: Path) -> None:
        pools.mkdir(mode=0o700)
        self.pools = pools
        self._ends = threading.Event()
        self._steps = 0
        self.longest = 0.0
        """The longest step in seconds."""
        self._error = ""
        # Of this process, because its own learner finds the pool by it.
        self._before = os.environ.get("SMACLITE_POOL_ROOT")
        os.environ["SMACLITE_POOL_ROOT"] = str(pools)
        lanes = ["own=3m:2", "free=3m:4"]
        self.pool = subprocess.Popen(
            [PROGRAM, "serve", *lanes, "--name", POOL, "--threads", "2"],
            stdout=subprocess.PIPE,
        )
        assert self.pool.stdout
        self.pool.stdout.readline()
        self._learner = threading.Thread(target=self._learn)
        self._learner.start()

    def _learn(self) -> None:
        try:
            with sp.connect(POOL, "own", timeout=LONGEST) as envs, sp.make("3m", 2) as twin:
                envs.reset(seed=1)
                twin.reset(seed=1)
                while not self._ends.is_set():
                    actions = twin.sample_actions()
                    begin = time.monotonic()
                    batch = envs.step(actions, timeout=LONGEST)
                    self.longest = max(self.longest, time.monotonic() - begin)
                    expected = twin.step(actions)
                    for name in envs.spec.fields:
                        np.testing.assert_array_equal(batch[name], expected[name], name)
                    self._steps += 1
                    time.sleep(0.002)
        except BaseException as error:
            # Its traceback would keep the batch, and with it what the pool has in /dev/shm.
            self._error = repr(error)

    def wrong(self) -> str | None:
        """What is wrong with the pool after a fault that others met."""
        begin = self._steps
        return self._wait(lambda: self._steps > begin + 2, "its neighbour makes no steps") or self._wait(
            self._is_free, "the pool holds a place for it"
        )

    def _is_free(self) -> bool:
        command: list[Path | str] = [PROGRAM, "status", POOL, "--json"]
        done = subprocess.run(command, capture_output=True, timeout=LONGEST, check=False)
        lanes = json.loads(done.stdout)["lanes"] if done.returncode == 0 else []
        return (
            bool(lanes) and lanes[1]["learner_pid"] is None and not any(lane["spectators"] for lane in lanes)
        )

    def _wait(self, is_so: Callable[[], bool], otherwise: str) -> str | None:
        end = time.monotonic() + LONGEST
        while True:
            if self._error:
                return f"its neighbour: {self._error}"
            if self.pool.poll() is not None:
                return "the pool ends"
            if is_so():
                return None
            if time.monotonic() > end:
                return otherwise
            time.sleep(0.005)

    def close(self) -> str | None:
        """Returns what is wrong at the end."""
        self._ends.set()
        self._learner.join()  # its steps end
        try:
            self.pool.terminate()
            status = self.pool.wait(LONGEST)
        finally:
            self.pool.kill()
            if self._before is None:
                del os.environ["SMACLITE_POOL_ROOT"]
            else:
                os.environ["SMACLITE_POOL_ROOT"] = self._before
        return f"exit status {status} of the pool" if status else None
