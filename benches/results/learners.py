"""The learners of docs/results.md: how each is run, and what its teams are measured by."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from . import data
from .data import Row
from .runs import Runs

PROGRAM = data.REPOSITORY / "target" / "release" / "smaclite-pool"
VALUE_DECOMPOSITION = "smaclite_pool.examples.value_decomposition"
EPISODES = 200
CHOICES = ("sampled", "greedy")
VALUES = ("win_rate", "mean_return", "mean_length")

Measured = tuple[list[Row], Row]
"""The log of a run, and the evaluations: for each of `CHOICES` each of `VALUES`, as `sampled_win_rate`; empty
for a choice that the learner does not have."""


def program(runs: Runs, seed: int, budget: int, folder: Path, threads: int) -> Measured:
    """`smaclite-pool train`. A run that was interrupted goes on."""
    command = ["--resume", str(folder)]
    if not (folder / "checkpoint.safetensors").exists():
        new = ["--seed", str(seed), "--steps", str(budget), *shlex.split(runs.options)]
        command = [runs.scenario, *new, "--out", str(folder)]
    output_of(PROGRAM, "train", *command, "--threads", str(threads))
    log = data.read(folder / "log.csv")
    if int(log[-1]["steps"]) < budget:
        raise RuntimeError("training was interrupted")
    evaluated: Row = {}
    for choice in CHOICES:
        how = ["--episodes", str(EPISODES), "--seed", "1", *(["--greedy"] if choice == "greedy" else [])]
        lines = output_of(PROGRAM, "evaluate", folder, *how, "--json", "--threads", str(threads)).splitlines()
        evaluated |= {f"{choice}_{name}": f"{json.loads(lines[-1])[name]:.4f}" for name in VALUES}
    return log, evaluated


def value_decomposition(runs: Runs, seed: int, budget: int, folder: Path, threads: int) -> Measured:
    """The example in PyTorch, which this interpreter must have. It does not resume, and evaluates without
    random actions."""
    shutil.rmtree(folder, ignore_errors=True)
    options = shlex.split(runs.options)
    numbers = ["--seed", str(seed), "--steps", str(budget), "--evaluate-episodes", str(EPISODES)]
    argv: list[str | Path] = ["-m", VALUE_DECOMPOSITION, runs.scenario, *numbers, "--out", folder, *options]
    output = output_of(sys.executable, *argv)
    found = re.search(r"won ([\d.]+)%, return ([\d.]+), ([\d.]+) steps$", output.strip())
    if not found:
        got = output[-200:]
        raise RuntimeError(f"expected the evaluation in the last line of {VALUE_DECOMPOSITION}, got {got!r}")
    [log] = folder.glob("*/log.csv")
    values = [f"{float(found[1]) / 100:.4f}", found[2], found[3]]
    evaluated = {f"{choice}_{name}": "" for choice in CHOICES for name in VALUES}
    return data.read(log), evaluated | {
        f"greedy_{name}": value for name, value in zip(VALUES, values, strict=True)
    }


LEARNERS: dict[str, Callable[[Runs, int, int, Path, int], Measured]] = {
    "smaclite-pool train": program,
    "value_decomposition.py": value_decomposition,
}


def output_of(*command: str | Path) -> str:
    """Runs a program and returns what it printed.

    Raises:
        RuntimeError: it failed; with the last line of its errors.
    """
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        why = (done.stderr.strip() or "no error message").splitlines()[-1]
        raise RuntimeError(f"{shlex.join(map(str, command))}: {why}")
    return done.stdout
