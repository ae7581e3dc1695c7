"""Plays many episodes in several processes, shows progress, and reports what was found."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import time
import warnings
from collections import Counter
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from pathlib import Path

from .episode import Episode
from .examine import HASH_SEED, Finding, Published, examine
from .scenarios import REPOSITORY

FAULTS = ("different", "refused", "error")
"""Kinds of findings that make the run fail."""
REPORT_SECONDS = 30.0
"""Between two lines of progress where there is no terminal."""


def run(episodes: list[Episode], published: Published, folder: Path, jobs: int, stop_after: int) -> Progress:
    """Plays all episodes, or as many as it takes to find `stop_after` faults."""
    # Of the processes; they are spawned, so each reads it.
    os.environ["PYTHONHASHSEED"] = str(HASH_SEED)
    progress = Progress(len(episodes))
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=begin_worker) as workers:
        futures: dict[Future[Finding], Episode] = {}
        try:
            for episode in episodes:
                futures[workers.submit(examine, episode, published, folder)] = episode
            for future in as_completed(futures):
                progress.add(result(future, futures[future]))
                if progress.faults() >= stop_after:
                    progress.say(f"stopped after {progress.faults()} faults")
                    break
        except KeyboardInterrupt:
            progress.interrupted = True
            progress.say("interrupted; episodes that have begun are played to their end")
        workers.shutdown(wait=True, cancel_futures=True)
    progress.end()
    return progress


def begin_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that hands out the episodes
    warnings.simplefilter("ignore")  # the published environment divides by zero and says so


def result(future: Future[Finding], episode: Episode) -> Finding:
    try:
        return future.result()
    except Exception as error:
        return Finding(episode.name, "error", f"{type(error).__name__}: {error}", 0)


class Progress:
    """Counts findings, and prints those that are worth reading."""

    def __init__(self, total: int) -> None:
        self.total = total
        self.tally: Counter[str] = Counter()
        self.stops: Counter[str] = Counter()
        """What stopped the published environment, and how often."""
        self.steps = 0
        self.interrupted = False
        self.begin = self.reported = time.monotonic()

    def faults(self) -> int:
        return sum(self.tally[kind] for kind in FAULTS)

    def add(self, finding: Finding) -> None:
        self.tally[finding.kind] += 1
        self.steps += finding.steps
        if finding.kind == "published stops":
            self.stops[finding.what] += 1
        elif finding.kind != "same":
            self.say(f"{finding.kind}: {finding.episode}: {finding.what}")
        if finding.smaller:
            self.say(f"    smaller: {finding.smaller}")
        if sys.stdout.isatty():
            print(f"\r{self.line()}", end="", flush=True)
        elif time.monotonic() - self.reported > REPORT_SECONDS:
            self.reported = time.monotonic()
            print(self.line(), flush=True)

    def line(self) -> str:
        found = ", ".join(f"{count} {kind}" for kind, count in self.tally.most_common())
        speed = self.steps / (time.monotonic() - self.begin)
        played = f"{self.tally.total()} of {self.total} episodes: {found}"
        return f"{played}; {self.steps} steps, {speed:.0f} per second"

    def say(self, text: str) -> None:
        clear = "\r\x1b[K" if sys.stdout.isatty() else ""
        print(f"{clear}{text}", flush=True)

    def end(self) -> None:
        self.say(self.line())
        for what, count in self.stops.most_common():
            print(f"    the published environment stops: {what} ({count} episodes)")


def name_ticks(folder: Path) -> None:
    """Lets the Rust tests name the first tick and quantity in which the engine parts from each recording."""
    command = ["cargo", "test", "--release", "-p", "smaclite-tests", "--test", "ticks", "--", "--nocapture"]
    print(f"recordings and scenarios: {folder}\nSMACLITE_TRACES={folder} {' '.join(command)}", flush=True)
    if not shutil.which("cargo"):
        return
    environment = {**os.environ, "SMACLITE_TRACES": str(folder), "RUST_BACKTRACE": "0"}
    done = subprocess.run(
        command, cwd=REPOSITORY, env=environment, capture_output=True, text=True, check=False
    )
    names = [path.stem for path in folder.rglob("*.npz")]
    output = (done.stdout + done.stderr).splitlines()
    named = [line for line in output if any(name in line for name in names)]
    if done.returncode == 0:
        print("no tick differs from its recording: only observations, state or masks do,")
        print("or the installed smaclite_pool was not built from this checkout")
    else:
        print("\n".join(named or output))
