"""Trains and evaluates the teams of docs/results.md, and writes what was measured to docs/results.

A run that has its row in runs.csv, with the same steps and options, is skipped, and one that was interrupted
is resumed; so Ctrl-C loses nothing. The table of the runs is benches/results/runs.py.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import sys
import zlib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

from . import data
from .data import Row
from .learners import LEARNERS
from .runs import RUNS, Runs


@dataclass(frozen=True)
class Run:
    """One run."""

    runs: Runs
    seed: int
    budget: int

    @property
    def name(self) -> str:
        return self.runs.name(self.seed)

    @property
    def key(self) -> Row:
        return {
            "name": self.name,
            "group": self.runs.group,
            "scenario": self.runs.scenario,
            "variant": self.runs.variant,
            "seed": str(self.seed),
            "budget": str(self.budget),
            "learner": self.runs.learner,
            "options": self.runs.options,
        }

    def is_row(self, row: Row) -> bool:
        return all(row[name] == value for name, value in self.key.items())


def planned(steps: int | None = None) -> list[Run]:
    """All runs in the order of the table, with another number of steps if that is given."""
    return [Run(runs, seed, steps or runs.steps) for runs in RUNS for seed in range(1, runs.seeds + 1)]


def main(argv: list[str] | None = None) -> int:
    options = parse(argv)
    every = planned(options.steps)
    chosen = [run for run in every if re.search(options.only, run.name)]
    table = Table(options.data, every)
    missing = [run for run in chosen if not table.has(run)]
    print(f"{len(chosen)} runs, {len(missing)} of them to train", flush=True)
    if options.list:
        for run in missing:
            print(f"{run.name}: {run.budget} steps, {run.runs.learner} {run.runs.options}")
        return 0
    threads = max((os.cpu_count() or 1) // options.jobs, 1)
    workers = ThreadPoolExecutor(options.jobs)
    futures = [workers.submit(train, run, options, threads, table) for run in missing]
    try:
        errors = [(run, future.exception()) for run, future in zip(missing, futures, strict=True)]
    except KeyboardInterrupt:  # the programs have got the signal too, and write their checkpoints
        workers.shutdown(cancel_futures=True)
        print("interrupted; the same command goes on from here")
        return 130
    failed = [(run, error) for run, error in errors if error]
    for run, error in failed:
        print(f"error: {run.name}: {error}", file=sys.stderr)
    return 1 if failed else 0


def parse(argv: list[str] | None) -> argparse.Namespace:
    summary, explanation = (__doc__ or "").split("\n\n")
    parser = argparse.ArgumentParser("results.train", description=f"{summary} {explanation}")
    parser.add_argument("--only", help="runs whose name matches this regular expression", default="")
    parser.add_argument("--list", help="print what would be trained", action="store_true")
    parser.add_argument("--jobs", help="runs at a time (1)", type=int, default=1, metavar="N")
    steps = "steps of every run, instead of those of the table; for trials"
    parser.add_argument("--steps", help=steps, type=int, metavar="N")
    folder = "folder of the CSV files (docs/results)"
    parser.add_argument("--data", help=folder, type=Path, default=data.FOLDER)
    runs = data.REPOSITORY / "target" / "results"
    parser.add_argument("--runs", help="folder of the runs (target/results)", type=Path, default=runs)
    return parser.parse_args(argv)


class Table:
    """The file `runs.csv`: a row per run, in the order of the plan. Other rows stay at the end."""

    def __init__(self, folder: Path, plan: list[Run]) -> None:
        self.folder = folder
        self.plan = plan
        self.path = folder / "runs.csv"
        self.rows = data.read(self.path)
        self.lock = Lock()

    def has(self, run: Run) -> bool:
        return any(run.is_row(row) for row in self.rows)

    def add(self, run: Run, row: Row, curve: list[Row]) -> None:
        """Adds or replaces what is known of a run."""
        names = [other.name for other in self.plan]

        def position(row: Row) -> int:
            return names.index(row["name"]) if row["name"] in names else len(names)

        with self.lock:
            data.write(self.folder / "curves" / f"{run.name}.csv", curve)
            self.rows = [other for other in self.rows if other["name"] != run.name]
            self.rows = sorted([*self.rows, row], key=position)
            data.write(self.path, self.rows)


def train(run: Run, options: argparse.Namespace, threads: int, table: Table) -> None:
    """Trains a team or goes on with it, evaluates it, and adds it to the table.

    Raises:
        RuntimeError: the learner failed.
    """
    runs = run.runs
    # Runs with other steps or options have another folder.
    plan = zlib.crc32(f"{run.budget} {runs.learner} {runs.options}".encode())
    folder = options.runs / f"{run.name}-{plan:08x}"
    log, evaluated = LEARNERS[runs.learner](runs, run.seed, run.budget, folder, threads)
    reached = data.first_reached(log) or {}
    row = {
        **run.key,
        "steps": log[-1]["steps"],
        "episodes": log[-1]["episodes"],
        "steps_at_90": reached.get("steps", ""),
        "cpu_seconds_at_90": data.rounded(reached["cpu_seconds"]) if reached else "",
        **evaluated,
        "seconds": data.rounded(log[-1]["seconds"]),
        "cpu_seconds": data.rounded(log[-1]["cpu_seconds"]),
        "threads": str(threads),
        "jobs": str(options.jobs),
        "machine": machine(),
    }
    table.add(run, row, data.thinned(log))
    results = (f"{name} {row[name]}" for name in row if name.endswith(("win_rate", "mean_return")))
    print(f"{run.name}: {', '.join(results)}, {row['cpu_seconds']} CPU-seconds", flush=True)


def machine() -> str:
    """The processor and the number of cores."""
    cpus = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    model = re.search(r"^model name\s*: (.*)", cpus, re.MULTILINE)
    return f"{os.cpu_count()} cores of {model[1] if model else platform.machine()}"


if __name__ == "__main__":
    sys.exit(main())
