"""Makes the zoo: copies the best team of every scenario from runs of `smaclite-pool train --evaluate-every`.

A team is in the zoo if its best weights win at least 90 % of the 320 greedy episodes of its final evaluation.
Of several seeds, the one is taken whose worse win rate, of greedy and of sampled actions, is highest. Runs
with another configuration, rules or opponent than the default, but with flat networks, are an error, as teams
have scenarios' names.
A run on several maps (`train --maps`), which has no evaluations, becomes the team `all-maps`: it plays 320
greedy and 320 sampled episodes on each map of SMAC.
"""

from __future__ import annotations

import argparse
import csv
import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

from . import data, runs

Summary = dict[str, float]
"""Win rate, mean return and mean length of episodes."""

FOLDER = data.REPOSITORY / "bindings" / "learn" / "zoo"

WINS = 0.9
"""What a team must win, with its most probable actions."""

ALL_MAPS = "all-maps"
"""The team that plays every map."""

EPISODES = 320
"""Of each kind that a team on several maps plays per map: as many as in a final evaluation."""

FREE = {"config.seed", "config.steps", "config.evaluate_every"}
"""In which its run may differ from one that names nothing but its scenario."""


def main(argv: list[str] | None = None) -> int:
    summary, explanation = (__doc__ or "").split("\n\n")
    parser = argparse.ArgumentParser("results.zoo", description=f"{summary} {explanation}")
    parser.add_argument("runs", help="folders with runs, at any depth", type=Path, nargs="+")
    parser.add_argument("--out", help=f"folder of the zoo ({FOLDER})", type=Path, default=FOLDER)
    options = parser.parse_args(argv)
    universal = [run for run in options.runs if is_universal(run)]
    for run in universal:
        keep_universal(run, options.out / ALL_MAPS)
        print(f"{ALL_MAPS}: {run}")
    if universal:
        return 0
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
            defaults[name] = runs.trained_with(name, ["--network", "flat"])
        differences = runs.differences(run, defaults[name], FREE)
        if differences:
            wrong.append(f"{run}: {differences}")
    if wrong:
        raise SystemExit(
            "results.zoo: runs must be those of the default configuration with --network flat, rules and "
            "opponent; name folders without these:\n" + "\n".join(wrong)
        )


def scenario(run: Path) -> str:
    name: str = json.loads(json.loads((run / "run.json").read_text())["files"]["text"])["name"]
    return name


def keep(run: Path, folder: Path) -> None:
    """Writes the files of a team: its description, the weights of its actor, and a card."""
    final = json.loads((run / "final.json").read_text())
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(run / "run.json", folder / "run.json")
    weights = (run / "evaluations" / f"{final['steps']:012}.safetensors").read_bytes()
    (folder / "best.safetensors").write_bytes(actor(weights))
    config = json.loads((run / "run.json").read_text())["config"]
    card = {
        "scenario": scenario(run),
        "seed": config["seed"],
        **{name: final[name] for name in ("steps", "run_steps", "cpu_seconds", "greedy", "sampled")},
        "episodes": len(final["greedy_episodes"]),
    }
    (folder / "card.json").write_text(json.dumps(card, indent=2) + "\n")


def is_universal(run: Path) -> bool:
    file = run / "run.json"
    return file.exists() and "other_maps" in json.loads(file.read_text())


def keep_universal(run: Path, folder: Path) -> None:
    """The same of a run on several maps: its last weights, and what it wins on each map of SMAC."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(run / "run.json", folder / "run.json")
    (folder / "best.safetensors").write_bytes(actor((run / "weights.safetensors").read_bytes()))
    config = json.loads((run / "run.json").read_text())["config"]
    with (run / "log.csv").open(newline="") as file:
        *_, last = csv.DictReader(file)
    maps = {
        name: {"greedy": evaluated(run, name, ["--greedy"]), "sampled": evaluated(run, name, [])}
        for name in smac_maps()
    }
    card = {
        "scenario": ALL_MAPS,
        "seed": config["seed"],
        "steps": int(last["steps"]),
        "run_steps": int(last["steps"]),
        "cpu_seconds": float(last["cpu_seconds"]),
        **{kind: mean([results[kind] for results in maps.values()]) for kind in ("greedy", "sampled")},
        "episodes": EPISODES,
        "maps": maps,
    }
    (folder / "card.json").write_text(json.dumps(card, indent=2) + "\n")


def smac_maps() -> list[str]:
    import smaclite_pool as sp  # which not all tools need

    return list(sp.scenarios(generated=False))


def evaluated(run: Path, name: str, options: list[str]) -> Summary:
    argv = [
        "evaluate",
        str(run),
        "--map",
        name,
        "--episodes",
        str(EPISODES),
        "--seed",
        "1",
        "--json",
        *options,
    ]
    done = subprocess.run([str(data.PROGRAM), *argv], capture_output=True, text=True, check=True)
    episodes = [json.loads(line) for line in done.stdout.splitlines()]
    ended = [episode for episode in episodes if "env_id" in episode]
    return {
        "win_rate": sum(episode["won"] for episode in ended) / len(ended),
        "mean_return": sum(episode["episode_return"] for episode in ended) / len(ended),
        "mean_length": sum(episode["length"] for episode in ended) / len(ended),
    }


def mean(summaries: list[Summary]) -> Summary:
    return {key: sum(summary[key] for summary in summaries) / len(summaries) for key in summaries[0]}


def actor(weights: bytes) -> bytes:
    """The tensors of the actor in a file of weights (safetensors)."""
    start = 8 + int.from_bytes(weights[:8], "little")
    tensors = json.loads(weights[8:start])
    header, values = {}, b""
    for name, tensor in tensors.items():
        if name.startswith("actor."):
            begin, end = tensor["data_offsets"]
            header[name] = {**tensor, "data_offsets": [len(values), len(values) + end - begin]}
            values += weights[start + begin : start + end]
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)  # values begin at a multiple of 8
    return len(text).to_bytes(8, "little") + text + values


if __name__ == "__main__":
    raise SystemExit(main())
