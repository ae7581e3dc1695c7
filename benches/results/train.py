"""Trains the teams of docs/results.md by the protocol of docs/how-to/benchmark.md, and reports them there.

What is complete is skipped, what was interrupted is resumed, and what is missing is trained, so Ctrl-C loses
nothing. Runs that are there with other options are an error.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import smaclite_pool as sp

from . import data, runs

EVALUATE_EVERY = 100_000

FLAT = ("--network", "flat")


def former(scenario: str) -> list[str]:
    """The defaults when the runs with flat networks were made, but for the networks."""
    told = sp.scenario(scenario)
    critic = ["--algorithm", "mappo" if data.sees_state(scenario) else "ippo"]
    last_actions = ["--last-actions", "4"] if told["teams_are_drawn"] else []
    return [*critic, *last_actions, "--entropy", str(0.3 / len(told["allies"]))]


def other_critic(scenario: str) -> list[str]:
    """The same with the critic that was not the default."""
    _, critic, *others = former(scenario)
    return ["--algorithm", "ippo" if critic == "mappo" else "mappo", *others]


GROUPS: dict[str, dict[str, list[str]]] = {
    "default": {scenario: [] for scenario in sp.scenarios(generated=False)},
    "flat": {scenario: [*FLAT, *former(scenario)] for scenario in sp.scenarios(generated=False)},
    "generated": {scenario: [] for scenario in sp.scenarios(generated=True)},
    "open-loop": {
        scenario: former(scenario) for scenario in ("protoss_5_vs_5", "terran_5_vs_5", "zerg_5_vs_5")
    },
    "other-critic": {
        scenario: [*FLAT, *other_critic(scenario)] for scenario in sp.scenarios(generated=False)
    },
    "paper-rules": {scenario: [*FLAT, *former(scenario), "--rules", "paper"] for scenario in ("MMM", "MMM2")},
    "starcraft": {scenario: ["--rules", "starcraft"] for scenario in sp.scenarios()},
}
"""What is trained for each report: scenarios, with options other than the defaults. In the group `open-loop`,
agents observe the time, their own number and their own last actions alone."""

KEPT = {
    "default": ("runs.csv", "curves-win_rate.svg", "curves-win_rate-dark.svg"),
    "flat": ("runs.csv", "curves-win_rate.svg", "curves-win_rate-dark.svg"),
    "generated": ("runs.csv",),
    "open-loop": ("runs.csv",),
    "other-critic": ("runs.csv",),
    "paper-rules": ("runs.csv",),
    "starcraft": ("runs.csv",),
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
                source = open_loop(folder, scenario) if group == "open-loop" else scenario
                train(folder / scenario, source, options, others)
        report(folder, options.out / group)
    return 0


def open_loop(folder: Path, scenario: str) -> str:
    """Writes a file of the scenario in which agents observe nothing but the time, and returns its path."""
    text = json.loads((data.REPOSITORY / "scenarios" / "data" / f"{scenario}.json").read_text())
    text["smacv2"] |= {"obs_starcraft": False, "obs_timestep_number": True}
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{scenario}.json"
    file.write_text(json.dumps(text))
    return str(file)


def train(folder: Path, scenario: str, options: argparse.Namespace, others: list[str]) -> None:
    """Trains the runs of a scenario, or completes those that are there."""
    wanted = ["--seeds", str(options.seeds), "--steps", options.steps]
    there = sorted(file.parent for file in folder.glob("*/run.json"))
    if there:
        check(there, runs.trained_with(scenario, others), options.seeds)
        run("train", "--resume", str(folder), *wanted)
    else:
        protocol = ["--seed", "1", "--evaluate-every", str(EVALUATE_EVERY)]
        run("train", scenario, *wanted, *protocol, *others, "--out", str(folder))


def check(there: list[Path], expected: runs.Description, seeds: int) -> None:
    """Exits if runs are not those that would be trained anew, but for how far they are."""
    expected = {**expected, "config.evaluate_every": EVALUATE_EVERY}
    for folder in there:
        wrong = runs.differences(folder, expected, {"config.seed", "config.steps"})
        seed = runs.description(folder)["config.seed"]
        if not wrong and not 1 <= seed <= seeds:
            wrong = f"its seed is {seed}, not between 1 and {seeds}, the number of seeds"
        if wrong:
            raise SystemExit(
                f"results.train: {folder}: {wrong}; remove it, or name another folder with --runs"
            )


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


if __name__ == "__main__":
    sys.exit(main())
