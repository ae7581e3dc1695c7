"""Makes the zoo: copies the best team of every scenario from runs of `smaclite-pool train --evaluate-every`.

A team is in the zoo if its best weights win at least 90 % of the 320 greedy episodes of its final evaluation.
Of several seeds, the one is taken whose worse win rate, of greedy and of sampled actions, is highest. Runs
with another configuration, rules or opponent than the default are an error, as teams have scenarios' names.
"""

from __future__ import annotations

import argparse
import json
import shutil
from collections.abc import Iterator
from pathlib import Path

from . import data, runs

FOLDER = data.REPOSITORY / "bindings" / "learn" / "zoo"

WINS = 0.9
"""What a team must win, with its most probable actions."""

FREE = {"config.seed", "config.steps", "config.evaluate_every"}
"""In which its run may differ from one that names nothing but its scenario."""


def main(argv: list[str] | None = None) -> int:
    summary, explanation = (__doc__ or "").split("\n\n")
    parser = argparse.ArgumentParser("results.zoo", description=f"{summary} {explanation}")
    parser.add_argument("runs", help="folders with runs, at any depth", type=Path, nargs="+")
    parser.add_argument("--out", help=f"folder of the zoo ({FOLDER})", type=Path, default=FOLDER)
    options = parser.parse_args(argv)
    check(list(found(options.runs)))
    best: dict[str, tuple[float, Path]] = {}
    for run in found(options.runs):
        final = json.loads((run / "final.json").read_text())
        greedy, sampled = final["greedy"]["win_rate"], final["sampled"]["win_rate"]
        worse, name = min(greedy, sampled), scenario(run)
        if greedy >= WINS and worse > best.get(name, (0.0, run))[0]:
            best[name] = worse, run
    for name, (_, run) in sorted(best.items()):
        keep(run, options.out / name)
        print(f"{name}: {run}")
    return 0


def found(folders: list[Path]) -> Iterator[Path]:
    for folder in folders:
        for final in sorted(folder.rglob("final.json")):
            yield final.parent


def check(trained: list[Path]) -> None:
    """Exits if a run was not trained with the defaults: its team would have the name of one that was."""
    if not trained:
        raise SystemExit("results.zoo: the folders have no complete run with evaluations")
    defaults: dict[str, runs.Description] = {}
    wrong = []
    for run in trained:
        name = scenario(run)
        if name not in defaults:
            defaults[name] = runs.trained_with(name, [])
        differences = runs.differences(run, defaults[name], FREE)
        if differences:
            wrong.append(f"{run}: {differences}")
    if wrong:
        raise SystemExit(
            "results.zoo: runs must be those of the default configuration, rules and opponent; name folders "
            "without these:\n" + "\n".join(wrong)
        )


def scenario(run: Path) -> str:
    name: str = json.loads(json.loads((run / "run.json").read_text())["files"]["text"])["name"]
    return name


def keep(run: Path, folder: Path) -> None:
    """Writes the files of a team: its description, the weights of its actor, and a card."""
    final = json.loads((run / "final.json").read_text())
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(run / "run.json", folder / "run.json")
    shutil.copyfile(run / "evaluations" / f"{final['steps']:012}.safetensors", folder / "best.safetensors")
    config = json.loads((run / "run.json").read_text())["config"]
    card = {
        "scenario": scenario(run),
        "seed": config["seed"],
        **{name: final[name] for name in ("steps", "run_steps", "cpu_seconds", "greedy", "sampled")},
        "episodes": len(final["greedy_episodes"]),
    }
    (folder / "card.json").write_text(json.dumps(card, indent=2) + "\n")


if __name__ == "__main__":
    raise SystemExit(main())
