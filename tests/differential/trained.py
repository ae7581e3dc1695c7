"""Plays a trained team in the published environment and in the pool, and compares the episodes.

FOLDER is a run of `smaclite-pool train`. Each episode has a seed of its own, and is played once in each
environment, with the same random numbers for the actions. Weights and observations become actions in one
function, which knows nothing of the environment that it plays in. So both episodes must be equal in every
step: the same actions, and the same observations, available actions, rewards and ends, to the bit.

The interpreter needs the published environment (smaclite 0.0.1 and its C++ addon rvo2) and
smaclite_pool, built from this checkout by `python -m pip install .`; `just published` uses the
interpreter that the environment variable SMACLITE_PYTHON names.

Exit status: 0 if nothing differs, 1 if something does, 2 if nothing could be played.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

from .command import missing_package, natural, positive
from .scenarios import ScenarioFiles

if TYPE_CHECKING:
    from .battles import Battle, Frame
    from .examine import Published
    from .team import Team


@dataclass(frozen=True)
class Plan:
    """What is played: a team, in episodes with the seeds `seed`, `seed + 1` and so on."""

    files: ScenarioFiles
    team: Team
    episode_limit: int
    episodes: int
    seed: int
    greedy: bool


@dataclass
class Played:
    """An episode in one of the environments."""

    frames: list[Frame] = field(default_factory=list)
    actions: list[list[int]] = field(default_factory=list)
    stopped: str = ""
    """The known error with which the published environment stopped."""

    @property
    def result(self) -> Result:
        rewards = [float(frame.reward) for frame in self.frames]
        return Result(bool(self.frames[-1].battle_won), sum(rewards), len(self.actions))


@dataclass(frozen=True)
class Result:
    """How an episode ended."""

    won: bool
    episode_return: float
    steps: int


@dataclass(frozen=True)
class Comparison:
    """An episode in both environments."""

    seed: int
    kind: str
    """`same`, `different`, `tie` (the published environment contradicts itself), or `published stops`."""
    what: str
    published: Result
    pool: Result


def main(argv: list[str] | None = None) -> int:
    options = parse(argv)
    if problem := missing_package():
        print(f"error: {problem}", file=sys.stderr)
        return 2
    from .examine import Published  # only now: these import the packages
    from .published import PublishedBattle
    from .recording import record

    try:
        plan = read_plan(options.folder, options.episodes, options.seed, options.greedy)
    except (OSError, ValueError, KeyError) as error:
        print(f"error: {options.folder} holds no run that can be played: {error}", file=sys.stderr)
        return 2
    compared = list(play_all(plan, Published(PublishedBattle, record), options.jobs, options.json))
    report(plan, compared, options.json)
    return 1 if any(comparison.kind == "different" for comparison in compared) else 0


def parse(argv: list[str] | None) -> argparse.Namespace:
    summary, explanation, *requirements = (__doc__ or "").split("\n\n")
    parser = argparse.ArgumentParser(
        "differential.trained", description=f"{summary} {explanation}", epilog=" ".join(requirements)
    )
    parser.add_argument("folder", help="a run of `smaclite-pool train`", type=Path, metavar="FOLDER")
    number: dict[str, Any] = {"metavar": "N", "type": positive}
    parser.add_argument("--episodes", help="number of episodes (100)", default=100, **number)
    seed: dict[str, Any] = {"metavar": "N", "type": natural, "default": 1}
    parser.add_argument("--seed", help="seed of the first episode, others follow (1)", **seed)
    greedy = "take the most probable action, instead of drawing one by its probability"
    parser.add_argument("--greedy", help=greedy, action="store_true")
    parser.add_argument("--jobs", help="processes (one per core)", default=os.cpu_count(), **number)
    json_help = "print one JSON object per episode, and one with the result"
    parser.add_argument("--json", help=json_help, action="store_true")
    return parser.parse_args(argv)


def read_plan(folder: Path, episodes: int, seed: int, greedy: bool) -> Plan:
    """Reads the run in the folder.

    Raises:
        OSError, ValueError, KeyError: the folder holds no run, or none that the published environment plays.
    """
    from . import team

    run = json.loads((folder / "run.json").read_text())
    if run["rules"] != "smaclite":
        raise ValueError(f"the published environment has the rules `smaclite`, got `{run['rules']}`")
    files = team.scenario(run)
    return Plan(files, team.read(folder, run), run["episode_limit"], episodes, seed, greedy)


def play_all(plan: Plan, published: Published, jobs: int, as_json: bool) -> Iterator[Comparison]:
    """Plays all episodes, and prints those that are not the same, or each as JSON."""
    from .examine import HASH_SEED
    from .run import begin_worker

    # Of the processes; they are spawned, so each reads it.
    os.environ["PYTHONHASHSEED"] = str(HASH_SEED)
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=begin_worker) as workers:
        seeds = range(plan.seed, plan.seed + plan.episodes)
        futures = [workers.submit(compare, plan, seed, published) for seed in seeds]
        for future in futures:
            comparison = future.result()
            if as_json:
                print(json.dumps(asdict(comparison)), flush=True)
            elif comparison.kind != "same":
                print(f"{comparison.kind}: seed {comparison.seed}: {comparison.what}", flush=True)
            yield comparison


def compare(plan: Plan, seed: int, published: Published) -> Comparison:
    """Plays an episode in both environments."""
    from .battles import PoolBattle
    from .episode import Episode, Outcome
    from .examine import HASH_SEED, find_tie

    with tempfile.TemporaryDirectory(prefix="differential-") as folder:
        path = plan.files.write(Path(folder))
        theirs = play(plan, published.open(plan.files, path, seed), seed)
        ours = play(plan, PoolBattle(plan.files, path, seed), seed)
    kind, (steps, what) = "same", first_difference(theirs, ours)
    if theirs.stopped:
        kind, what = "published stops", theirs.stopped
    elif what:
        kind, what = "different", f"after {steps} steps, {what}"
        episode = Episode(plan.files, "trained", seed, plan.episode_limit)
        recorded = published.record(episode, theirs.actions[:steps], HASH_SEED)
        outcome = Outcome(kind, what, theirs.actions[:steps])
        if tie := find_tie(episode, outcome, recorded, published.record):
            kind, what = "tie", tie
    return Comparison(seed, kind, what, theirs.result, ours.result)


def play(plan: Plan, battle: Battle, seed: int) -> Played:
    """Plays the battle to its end or to the episode limit of the run; neither environment has one here."""
    from .battles import PublishedFailure

    played = Played()
    player = plan.team.player(seed, plan.greedy)
    try:
        played.frames.append(battle.reset())
        while len(played.actions) < plan.episode_limit and not played.frames[-1].terminated:
            actions = player.choose(played.frames[-1])
            played.actions.append(actions)
            played.frames.append(battle.step(actions))
    except PublishedFailure as error:
        played.stopped = str(error)
    finally:
        battle.close()
    return played


def first_difference(theirs: Played, ours: Played) -> tuple[int, str]:
    """After how many steps the episodes differ, and in what; that is empty if they are equal."""
    from .battles import difference

    for step, frames in enumerate(zip(theirs.frames, ours.frames, strict=False)):
        if what := difference(*frames):
            return step, what
        actions = theirs.actions[step : step + 1], ours.actions[step : step + 1]
        if actions[0] != actions[1]:
            return step, f"actions: published {actions[0]}, ours {actions[1]}"
    return len(theirs.actions), ""


def report(plan: Plan, compared: list[Comparison], as_json: bool) -> None:
    """Prints win rates and returns in both environments, and in how many episodes they agree."""
    finished = [comparison for comparison in compared if comparison.kind != "published stops"]
    kinds = [comparison.kind for comparison in compared]
    counts = {kind: kinds.count(kind) for kind in dict.fromkeys(["same", *kinds])}
    sides = {side: summary([getattr(row, side) for row in finished]) for side in ("published", "pool")}
    if as_json:
        played = {"scenario": plan.files.name, "seed": plan.seed, "greedy": plan.greedy}
        print(json.dumps({**played, "episodes": plan.episodes, "kinds": counts, **sides}))
        return
    choice = "most probable" if plan.greedy else "sampled"
    print(f"{plan.files.name}: {plan.episodes} episodes from seed {plan.seed}, {choice} actions")
    for side, values in sides.items():
        won, mean_return, steps = values["win_rate"], values["mean_return"], values["steps"]
        print(f"  {side:9}  {100 * won:5.1f} % won  return {mean_return:.4f}  {steps} steps")
    print(f"  {', '.join(f'{count} {kind}' for kind, count in counts.items())}")


def summary(results: list[Result]) -> dict[str, Any]:
    if not results:
        return {"win_rate": None, "mean_return": None, "steps": 0}
    return {
        "win_rate": fmean(result.won for result in results),
        "mean_return": fmean(result.episode_return for result in results),
        "steps": sum(result.steps for result in results),
    }


if __name__ == "__main__":
    sys.exit(main())
