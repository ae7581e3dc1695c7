"""Analysis of a difference: check for ties, shrink the scenario, and write files for debugging."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .battles import OpenBattle
from .episode import Episode, Outcome, play
from .recording import TICKS_PER_STEP, Recorded, first_disagreement
from .scenarios import Json, ScenarioFiles, with_groups

HASH_SEED = 0
"""The hash seed that every episode is played with."""
OTHER_HASH_SEEDS = range(1, 9)
"""Each takes the other one of two planes with a chance of a half: 1 tie in 256 stays unnoticed."""
SHRINK_SECONDS = 60.0

Record = Callable[[Episode, list[list[int]], int], Recorded]
"""Records an episode of the published environment with these actions and that hash seed."""


@dataclass(frozen=True)
class Published:
    """Access to the published environment; tests replace it."""

    open: OpenBattle
    record: Record


@dataclass(frozen=True)
class Finding:
    """The outcome of an episode, after a closer look."""

    episode: str
    kind: str
    """As in `Outcome`, or `tie`: the published environment contradicts itself."""
    what: str
    steps: int
    smaller: str = ""
    """The smallest scenario that still differs, in words."""


def examine(episode: Episode, published: Published, folder: Path) -> Finding:
    """Plays an episode; a difference is saved in a separate folder below `folder`, and shrunk."""
    outcome = play(episode, published.open)
    finding = Finding(episode.name, outcome.kind, outcome.what, len(outcome.actions))
    if outcome.kind != "different":
        return finding
    recorded = published.record(episode, outcome.actions, HASH_SEED)
    if len(recorded["actions"]) < len(outcome.actions):
        raise RuntimeError("the published environment did not repeat its own episode with the same hash seed")
    if tie := find_tie(episode, outcome, recorded, published.record):
        return replace(finding, kind="tie", what=tie)
    keep(episode, recorded, folder / episode.name)
    small, small_outcome = shrink(episode, outcome, published.open)
    if small is episode:
        return finding
    small_recorded = published.record(small, small_outcome.actions, HASH_SEED)
    if find_tie(small, small_outcome, small_recorded, published.record):
        return finding
    keep(small, small_recorded, folder / episode.name)
    sides = " against ".join(in_words(small.files.roster(faction)) for faction in ("ALLY", "ENEMY"))
    return replace(finding, smaller=f"{small.name}: {sides}: {small_outcome.what}")


def find_tie(episode: Episode, outcome: Outcome, recorded: Recorded, record: Record) -> str | None:
    """Says in which tick the published environment's run with another hash seed parts from this one, if that
    is before or in the step in which ours parts from it."""
    last_tick = max(len(outcome.actions), 1) * TICKS_PER_STEP - 1
    for hash_seed in OTHER_HASH_SEEDS:
        tick = first_disagreement(recorded, record(episode, outcome.actions, hash_seed))
        if tick is not None and tick <= last_tick:
            seeds = f"with PYTHONHASHSEED={HASH_SEED} and {hash_seed}"
            return f"the published environment contradicts itself in tick {tick} {seeds}; {outcome.what}"
    return None


def keep(episode: Episode, recorded: Recorded, folder: Path) -> None:
    """Writes scenario, unit files and recording."""
    folder.mkdir(parents=True, exist_ok=True)
    episode.files.write(folder)
    np.savez_compressed(folder / f"{episode.name}.npz", allow_pickle=False, **recorded)


def shrink(episode: Episode, outcome: Outcome, open_published: OpenBattle) -> tuple[Episode, Outcome]:
    """Takes units out of the scenario and blocked squares off its map for as long as something differs."""
    until = time.monotonic() + SHRINK_SECONDS
    name = f"{episode.files.name}_small"
    best, best_outcome = episode, outcome
    found = True
    while found:
        found = False
        for files in reductions(best.files, name):
            if time.monotonic() > until:
                return best, best_outcome
            candidate = replace(best, files=files, steps=min(episode.steps, len(outcome.actions) + 10))
            tried = play(candidate, open_published)
            if tried.kind == "different":
                best, best_outcome, found = candidate, tried, True
                break
    return best, best_outcome


def reductions(files: ScenarioFiles, name: str) -> Iterator[ScenarioFiles]:
    """Smaller scenarios, those that save most first."""
    groups: list[Json] = files.scenario["groups"]

    def without(index: int, units: dict[str, int]) -> ScenarioFiles:
        changed = [{**groups[index], "units": units}] if units else []
        return with_groups(files, [*groups[:index], *changed, *groups[index + 1 :]], name)

    for index, group in enumerate(groups):
        if [other["faction"] for other in groups].count(group["faction"]) > 1:
            yield without(index, {})
    for index, group in enumerate(groups):
        for unit in group["units"] if len(group["units"]) > 1 else []:
            yield without(index, {other: count for other, count in group["units"].items() if other != unit})
    for index, group in enumerate(groups):
        for unit, count in group["units"].items():
            for fewer in sorted({count // 2, count - 1} - {0, count}):
                yield without(index, {**group["units"], unit: fewer})
    if "X" in "".join(files.scenario.get("terrain", "X")):
        flat = with_groups(files, groups, name)
        flat.scenario.pop("terrain_preset", None)
        width, height = (files.scenario.get(side, 32) for side in ("width", "height"))
        flat.scenario["terrain"] = ["_" * width] * height
        yield flat


def in_words(roster: list[str]) -> str:
    return ", ".join(f"{len(list(units))} {unit}" for unit, units in itertools.groupby(roster))
