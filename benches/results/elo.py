"""Rates teams during their training, for docs/results/elo.csv: copies of each team at several steps, and all
scripts, play one tournament per scenario. Copies that are there are not trained again.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from pathlib import Path

import smaclite_pool as sp

from . import data
from .opponents import MIXTURE, OPTIONS

SCENARIOS = ("3m", "8m", "2s3z")
STEPS, SEEDS, EPISODES = (100_000, 200_000, 300_000, 400_000, 500_000), (1, 2, 3, 4, 5), 30
TRAINED = {"attack_move": "attack_move", "mixture": MIXTURE, "self": "self"}
"""The option `--opponent` of each kind of training."""
SCRIPTS = [name for name in sp.OPPONENTS if name != "learner"]


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser("results.elo", description=__doc__)
    runs = data.REPOSITORY / "target" / "elo"
    parser.add_argument("--runs", help="folder of the runs (target/elo)", type=Path, default=runs)
    parser.add_argument(
        "--only", help="kinds of training (all)", nargs="*", choices=TRAINED, default=[*TRAINED]
    )
    parser.add_argument("--train", help="train only", action="store_true")
    options = parser.parse_args(argv)
    rows = []
    for scenario in SCENARIOS:
        teams: dict[str, tuple[str, int, int]] = {}
        for trained in options.only:
            for seed in SEEDS:
                copies = train(options.runs / scenario, scenario, trained, seed)
                teams |= {str(copy): (trained, seed, steps) for copy, steps in copies.items()}
        if not options.train:
            rows += rate(scenario, teams)
            data.write(data.FOLDER / "elo.csv", rows)
    return 0


def train(folder: Path, scenario: str, trained: str, seed: int) -> dict[Path, int]:
    """Trains a team in stages. Returns the folders of its copies, and their steps."""
    run = folder / f"{trained}-{seed}"
    copies = {folder / f"{run.name}-{steps}": steps for steps in STEPS}
    if all(copy.exists() for copy in copies):
        return copies
    shutil.rmtree(run, ignore_errors=True)
    for copy, steps in copies.items():
        new = [scenario, "--seed", str(seed), "--opponent", TRAINED[trained]]
        new += [*OPTIONS.split(), "--out", str(run)]
        program("train", *(["--resume", str(run)] if run.exists() else new), "--steps", str(steps))
        shutil.copytree(run, copy, dirs_exist_ok=True)
    print(scenario, trained, seed, flush=True)
    return copies


def rate(scenario: str, teams: dict[str, tuple[str, int, int]]) -> list[data.Row]:
    """Lets all teams, given by folder, and all scripts play against each other."""
    options = ["--scenario", scenario, "--episodes", str(EPISODES), "--seed", "1", "--json"]
    result = json.loads(program("tournament", *SCRIPTS, *teams, *options))
    rows = []
    for player in result["players"]:
        trained, seed, steps = teams.get(player["player"], (player["player"], "", ""))
        of_player = {"scenario": scenario, "trained": trained, "seed": str(seed), "steps": str(steps)}
        rows.append(
            of_player | {name: f"{player[name]:.4f}" for name in ("elo", "elo_low", "elo_high", "points")}
        )
    return rows


def program(*arguments: str) -> str:
    return subprocess.run([data.PROGRAM, *arguments], check=True, capture_output=True, text=True).stdout


if __name__ == "__main__":
    sys.exit(main())
