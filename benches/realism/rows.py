"""What is measured of a rule set, as rows of tables. The first column of each names the row."""

from __future__ import annotations

import csv
import math
import warnings
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import measures, play
from .measures import Values
from .recordings import Battle
from .restarted import Pairs, Walks
from .stands import Stands

Row = dict[str, str | int | float]
HERE = Path(__file__).parent
HALVES = {"": None, "tune": 0, "report": 1}
"""Remainder by 2 of the numbers of their battles: tune on those with even numbers, report the others."""

INTERVALS = ("winner", "enemies", "agents", "death", "fate", "end")
MEDIANS = ("death", "end")


def name_of(*parts: str) -> str:
    return " ".join(part for part in parts if part)


def half_of(battles: Sequence[Battle], half: str) -> NDArray[np.bool_]:
    numbers = np.array([each.number for each in battles])
    remainder = HALVES[half]
    return np.ones(len(numbers), bool) if remainder is None else numbers % 2 == remainder


class BattleRows:
    """Of battles that are played from their starts, a row per map and half, and their means over maps."""

    def __init__(self, rules: str) -> None:
        self.rules = rules
        self.rows: list[Row] = []
        self.maps: dict[str, list[Values]] = defaultdict(list)
        self.of_maps: dict[str, list[Row]] = defaultdict(list)

    def add(self, name: str, battles: Sequence[Battle], values: Values) -> None:
        for half in HALVES:
            chosen = half_of(battles, half)
            if chosen.any():
                part = {key: each[chosen] for key, each in values.items()}
                row = self.row(name, half, [part])
                for key in MEDIANS:
                    row[f"{key}_median"] = float(np.median(part[key]))
                self.maps[half].append(part)
                self.of_maps[half].append(row)
                self.rows.append(row)

    def finish(self) -> list[Row]:
        """All rows."""
        for half, maps in self.maps.items():
            row = self.row("mean", half, maps)
            for key in MEDIANS:
                of_maps = [float(each[f"{key}_median"]) for each in self.of_maps[half]]
                row[f"{key}_median"] = float(np.mean(of_maps))
            self.rows.append(row)
        return self.rows

    def row(self, name: str, half: str, maps: list[Values]) -> Row:
        row: Row = {
            "row": name_of(self.rules, name, half),
            "battles": sum(len(each["winner"]) for each in maps),
        }
        for key in maps[0]:
            row[key] = mean_of([each[key] for each in maps])
            if key in INTERVALS:
                row[f"{key}_low"], row[f"{key}_high"] = measures.interval([each[key] for each in maps])
        return row


def mean_of(maps: list[NDArray[np.float64]]) -> float:
    """The mean over maps of means over battles and copies, of those that have a number."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # none has
        return float(np.nanmean([np.nanmean(each) for each in maps]))


def walk_rows(rules: str, name: str, battles: Sequence[Battle], walks: Walks, only_far: bool) -> list[Row]:
    """A row per side, type and number of steps."""
    rows: list[Row] = []
    for (side, species, steps), pairs in walks.items():
        for half in HALVES:
            chosen = half_of(battles, half)[pairs.battle]
            row: Row = {"row": name_of(rules, name, side, species.lower(), str(steps), half), "map": name}
            if only_far:
                row |= distances(pairs, chosen & pairs.far(), np.median, "")
            row |= distances(pairs, chosen, np.mean, "mean_")
            row["median_error"] = median(pairs.error[chosen])
            if chosen.any():
                rows.append(row)
    return rows


def distances(pairs: Pairs, chosen: NDArray[np.bool_], of: Callable[..., Any], name: str) -> Row:
    """How far units went, really and here, and the distance between."""
    row: Row = {f"{name}pairs": int(chosen.sum())}
    for key in ("real", "ours", "error"):
        values = getattr(pairs, key)[chosen]
        row[f"{name}{key}"] = float(of(values)) if len(values) else math.nan
    return row


def median(values: NDArray[np.float64]) -> float:
    return float(np.median(values)) if len(values) else math.nan


def stand_rows(rules: str, name: str, real: dict[str, Stands], ours: dict[str, Stands]) -> list[Row]:
    rows: list[Row] = []
    for species, each in real.items():
        row: Row = {"row": name_of(rules, name, species.lower()), "map": name}
        for key, of in (("real", each), ("ours", ours.get(species))):
            for column in ("distance", "loop"):
                values = getattr(of, column) if of else np.array([np.nan])
                for quantile in (0.25, 0.5, 0.75):
                    row[f"{column}_{key}_{round(100 * quantile)}"] = float(np.quantile(values, quantile))
            row[f"number_{key}"] = len(of.loop) if of else 0
        rows.append(row)
    return rows


WITHIN = 0.15
"""Of the real number."""


def random_row(rules: str, name: str, result: play.Result) -> Row:
    """Random play, beside that of SMAC: `random`, and `almost`, where up to a fifth of the actions is not
    random. One episode alone is not compared."""
    row: Row = {"row": name_of(rules, name), "return": result.episode_return, "length": result.length}
    row["won"] = result.won
    for kind, policy in (("random", "random"), ("almost", "almost random")):
        real = real_play(name, policy)
        row[f"{kind}_episodes"] = real.episodes
        for column in ("episode_return", "length", "won"):
            row[f"{kind}_{column.removeprefix('episode_')}"] = getattr(real, column)
        ratios = result.episode_return / real.episode_return, result.length / real.length
        is_near = all(abs(ratio - 1) <= WITHIN for ratio in ratios)
        row[f"within_{kind}"] = int(is_near) if real.episodes > 1 else ""
    return row


def real_play(name: str, policy: str) -> play.Result:
    """The mean of all logs, by their episodes."""
    with (HERE / "random_play.csv").open(newline="") as file:
        logs = [row for row in csv.DictReader(file) if (row["map"], row["policy"]) == (name, policy)]
    episodes = sum(int(row["episodes"]) for row in logs)

    def mean(column: str) -> float:
        return sum(int(row["episodes"]) * float(row[column]) for row in logs) / episodes

    return play.Result(episodes, mean("mean_return"), mean("mean_length"), mean("win_rate"))


def maps_of_random_play() -> list[str]:
    with (HERE / "random_play.csv").open(newline="") as file:
        return list(dict.fromkeys(row["map"] for row in csv.DictReader(file)))


def near_row(rules: str, rows: list[Row]) -> Row:
    """On how many maps return and length are within 15 % of the real ones."""
    row: Row = dict.fromkeys(rows[0], "")
    row["row"] = name_of(rules, "near")
    for kind in ("random", "almost"):
        compared = [each[f"within_{kind}"] for each in rows if each[f"within_{kind}"] != ""]
        row[f"within_{kind}"] = sum(map(int, compared))
        row[f"{kind}_episodes"] = len(compared)
    return row


def real_scripts() -> dict[str, dict[str, float]]:
    """Shares of won battles, by map and script."""
    with (HERE / "scripts.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {
        row["map"]: {
            key: int(row[key]) / int(row["episodes"]) for key in row if key not in ("map", "episodes")
        }
        for row in rows
    }


def script_row(rules: str, name: str, won: dict[str, float], real: dict[str, float]) -> Row:
    """Ours beside the real game's; the policy `nearest` is compared with the script `attack_closest`."""
    row: Row = {"row": name_of(rules, name)}
    for script, share in won.items():
        row[f"{script}_real"] = real[REAL_SCRIPT.get(script, script)]
        row[script] = share
        row[f"{script}_difference"] = abs(share - real[REAL_SCRIPT.get(script, script)])
    return row


REAL_SCRIPT = {"nearest": "attack_closest"}


def mean_row(name: str, rows: list[Row]) -> Row:
    """The means of all numbers."""
    keys = [key for key in rows[0] if key not in ("row", "map")]
    return {"row": name} | {key: float(np.mean([float(row[key]) for row in rows])) for key in keys}


def write(path: Path, rows: list[Row]) -> None:
    """A CSV file; numbers with four digits."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({key: cell(value) for key, value in row.items()})


def cell(value: str | int | float) -> str:
    if not isinstance(value, float):
        return str(value)
    return "" if np.isnan(value) else f"{value:.4g}"
