"""Trains the teams of docs/results.md by the protocol of docs/how-to/benchmark.md, and reports them there.

What is complete is skipped, and what was interrupted is resumed, so Ctrl-C loses nothing.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import smaclite_pool as sp

from . import data

GROUPS: dict[str, dict[str, list[str]]] = {
    "default": {scenario: [] for scenario in sp.scenarios(generated=False)},
    "paper-rules": {"MMM": ["--rules", "paper"]},
}
"""What is trained for each report: scenarios, with options other than the defaults."""

KEPT = {
    "default": ("runs.csv", "curves-win_rate.svg", "curves-win_rate-dark.svg"),
    "paper-rules": ("runs.csv",),
}
"""Files of each report that the documentation keeps."""


def main(argv: list[str] | None = None) -> int:
    summary, explanation = (__doc__ or "").split("\n\n")
    parser = argparse.ArgumentParser("results.train", description=f"{summary} {explanation}")
    parser.add_argument("--seeds", help="runs per scenario (10)", type=int, default=10, metavar="N")
    parser.add_argument("--steps", help="of each run (2M)", default="2M", metavar="N")
    parser.add_argument("--group", help="only this report", choices=GROUPS, action="append")
    runs = data.REPOSITORY / "target" / "results"
    parser.add_argument("--runs", help=f"folder of the runs ({runs})", type=Path, default=runs)
    parser.add_argument("--report", help="only report what was trained", action="store_true")
    parser.add_argument(
        "--out", help=f"folder of the reports ({data.FOLDER})", type=Path, default=data.FOLDER
    )
    options = parser.parse_args(argv)
    for group in options.group or GROUPS:
        folder = options.runs / group
        if not options.report:
            for scenario, others in GROUPS[group].items():
                train(folder / scenario, scenario, options, others)
        report(folder, options.out / group)
    return 0


def train(folder: Path, scenario: str, options: argparse.Namespace, others: list[str]) -> None:
    protocol = ["--seeds", str(options.seeds), "--seed", "1", "--evaluate-every", "100k"]
    new = [scenario, *protocol, "--steps", options.steps, *others, "--out", str(folder)]
    run("train", *(["--resume", str(folder)] if folder.exists() else new))


def report(runs: Path, out: Path) -> None:
    """Writes the report of a group, named after its folder, and keeps some of its files."""
    with tempfile.TemporaryDirectory() as folder:
        run("report", str(runs), "--out", folder)
        out.mkdir(parents=True, exist_ok=True)
        for name in KEPT[runs.name]:
            shutil.copyfile(Path(folder) / name, out / name)
    rows = data.read(out / "runs.csv")
    # The folders are of this machine.
    data.write(out / "runs.csv", [{name: row[name] for name in row if name != "folder"} for row in rows])


def run(*arguments: str) -> None:
    subprocess.run([data.PROGRAM, *arguments], check=True)


def machine() -> str:
    """The processor and the number of cores."""
    cpus = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    model = re.search(r"^model name\s*: (.*)", cpus, re.MULTILINE)
    return f"{os.cpu_count()} cores of {model[1] if model else platform.machine()}"


if __name__ == "__main__":
    sys.exit(main())
