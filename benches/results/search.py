"""Searches every standard scenario with smaclite_pool.examples.planning, for docs/results/search.csv.

A row has the best episode that beam searches found, with a million steps each and actions of several scripted
policies to vary. Scenarios that have a row are skipped.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys

import smaclite_pool as sp

from . import data

POLICIES = ("focus_fire", "kite", "random")
FOUND = re.compile(r"\S+: (won|lost) with return (\S+) in (\d+) steps, found in (\S+) s")


def main() -> int:
    argparse.ArgumentParser("results.search", description=__doc__).parse_args()
    rows = data.read(data.FOLDER / "search.csv")
    for scenario in sorted(set(sp.scenarios(generated=False)) - {row["scenario"] for row in rows}):
        found = [search(scenario, policy) for policy in POLICIES]
        best = max(found, key=lambda row: (row["won"], float(row["episode_return"])))
        print(best, flush=True)
        rows.append(best)
        data.write(data.FOLDER / "search.csv", rows)
    return 0


def search(scenario: str, policy: str) -> data.Row:
    """The best episode that a beam search finds."""
    argv = [sys.executable, "-m", "smaclite_pool.examples.planning", scenario, "--policy", policy]
    printed = subprocess.run(argv, capture_output=True, text=True, check=True).stdout
    found = FOUND.match(printed)
    assert found, printed
    outcome, episode_return, steps, _ = found.groups()
    won = "1" if outcome == "won" else "0"
    return {
        "scenario": scenario,
        "policy": policy,
        "won": won,
        "episode_return": episode_return,
        "steps": steps,
    }


if __name__ == "__main__":
    sys.exit(main())
