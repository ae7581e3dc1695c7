"""Trains teams against attack-move alone and against a mixture of opponents, and lets them play against every
opponent, for docs/results/opponents.csv. Rows that are there are skipped.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import smaclite_pool as sp

from . import data

SCENARIOS = ("3m", "8m", "2s3z", "3s5z", "MMM", "1c3s5z", "3s_vs_3z", "10m_vs_11m", "8m_vs_9m", "25m")
STEPS, EPISODES, SEEDS = 500_000, 200, (1, 2, 3)
MIXTURE = ",".join(f"{name}=1" for name in ("attack_move", "nearest", "focus_fire", "kite", "hold", "line"))
"""The others are met for the first time in the evaluation."""
OPTIONS = (
    "--algorithm mappo --last-actions 0 --minibatches 4 --entropy 0.01 --entropy-end 0.01 --lr-end 1 "
    "--advantage-floor 0"
)
"""Without last actions, annealing and a floor of the advantages."""
TRAINED = {"attack_move": "attack_move", "mixture": MIXTURE}


def main() -> int:
    argparse.ArgumentParser("results.opponents", description=__doc__).parse_args()
    file = data.FOLDER / "opponents.csv"
    rows = data.read(file)
    there = {(row["scenario"], row["trained"], row["seed"]) for row in rows}
    for scenario in SCENARIOS:
        for trained in TRAINED:
            for seed in SEEDS:
                if (scenario, trained, str(seed)) not in there:
                    rows += play(scenario, trained, seed)
                    data.write(file, rows)
    return 0


def play(scenario: str, trained: str, seed: int) -> list[data.Row]:
    """Trains a team, and evaluates it against every opponent with sampled actions."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        options = [
            "--steps",
            str(STEPS),
            "--seed",
            str(seed),
            "--opponent",
            TRAINED[trained],
            *OPTIONS.split(),
        ]
        run("train", scenario, *options, "--out", str(out))
        rows = []
        for opponent in sp.OPPONENTS[:-1]:  # all but "learner"
            options = ["--episodes", str(EPISODES), "--seed", "1", "--opponent", opponent]
            result = json.loads(run("evaluate", str(out), *options, "--json").splitlines()[-1])
            of_run = {"scenario": scenario, "trained": trained, "seed": str(seed), "opponent": opponent}
            numbers = {name: f"{result[name]:.4f}" for name in ("win_rate", "mean_return")}
            rows.append(of_run | numbers)
    print(scenario, trained, seed, [row["win_rate"] for row in rows], flush=True)
    return rows


def run(*arguments: str) -> str:
    return subprocess.run([data.PROGRAM, *arguments], check=True, capture_output=True, text=True).stdout


if __name__ == "__main__":
    sys.exit(main())
