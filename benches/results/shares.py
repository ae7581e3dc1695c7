"""Measures where the time of training goes in the scenarios of the paper; writes docs/results/shares.csv.

The environments run in a process of their own, with one worker that sleeps while it has nothing to do. So its
processor time is that of the environments and of their side of the transport. The learner has one thread, and
its log says which part of its time it waits and which part the gradient steps take; the rest is inference and
copying. The time that it waits is not counted, because it does nothing then, and neither is time in which
other programs had its core.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from . import data
from .data import Row
from .tables import PAPER
from .train import machine

STEPS = 200_000


def main(argv: list[str] | None = None) -> int:
    summary, explanation = (__doc__ or "").split("\n\n")
    parser = argparse.ArgumentParser("results.shares", description=f"{summary} {explanation}")
    steps = f"environment steps per scenario ({STEPS})"
    parser.add_argument("--steps", help=steps, type=int, default=STEPS, metavar="N")
    folder = "folder of the CSV files (docs/results)"
    parser.add_argument("--data", help=folder, type=Path, default=data.FOLDER)
    options = parser.parse_args(argv)
    rows = []
    for scenario in PAPER:
        rows.append(measure(scenario, options.steps))
        print(", ".join(f"{name} {value}" for name, value in rows[-1].items()), flush=True)
    data.write(options.data / "shares.csv", rows)
    return 0


def measure(scenario: str, steps: int) -> Row:
    """Trains a team for some steps on a pool in another process. Times are CPU-seconds."""
    with tempfile.TemporaryDirectory(prefix="sp-", dir="/tmp") as folder:  # short, as it contains sockets
        environment = {**os.environ, "SMACLITE_POOL_ROOT": folder}
        lanes = [f"{lane}={scenario}:32" for lane in ("first", "second")]
        serve = ["serve", *lanes, "--name", "train", "--threads", "1", "--wait", "block"]
        pool = subprocess.Popen([data.PROGRAM, *serve], stdout=subprocess.PIPE, text=True, env=environment)
        assert pool.stdout is not None
        for line in pool.stdout:
            if line.startswith("connect with"):
                break
        attach = ["--pool", "train", "--lane", "first", "--lane", "second", "--threads", "1"]
        train = ["train", scenario, *attach, "--steps", str(steps), "--seed", "1", "--out", f"{folder}/run"]
        try:
            learner = subprocess.Popen([data.PROGRAM, *train], stdout=subprocess.DEVNULL, env=environment)
            had_core = core_share(learner)
            if learner.returncode:
                raise RuntimeError(f"smaclite-pool {shlex.join(train)} failed")
        finally:
            pool.send_signal(signal.SIGTERM)
            pool.stdout.close()
            _, status, usage = os.wait4(pool.pid, 0)
            pool.returncode = os.waitstatus_to_exitcode(status)
        log = data.read(Path(folder) / "run" / "log.csv")
    seconds = float(log[-1]["seconds"]) * had_core
    wait, learn = data.time_share(log, "wait_share"), data.time_share(log, "learn_share")
    return {
        "scenario": scenario,
        "steps": log[-1]["steps"],
        "environment": f"{usage.ru_utime + usage.ru_stime:.3f}",
        "inference": f"{seconds * (1 - wait - learn):.3f}",
        "learning": f"{seconds * learn:.3f}",
        "machine": machine(),
    }


def core_share(process: subprocess.Popen[bytes]) -> float:
    """Waits for the end of the process. Returns which part of the time in which its first thread could run it
    did run; the kernel tells the time that it ran, and the time that it waited for a core."""
    ran, delayed = 1, 0
    while process.poll() is None:
        with contextlib.suppress(OSError, ValueError):  # the process ended, or the kernel does not count
            ran, delayed, _ = map(int, Path(f"/proc/{process.pid}/schedstat").read_text().split())
        time.sleep(0.05)
    return ran / (ran + delayed)


if __name__ == "__main__":
    sys.exit(main())
