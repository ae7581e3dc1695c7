"""The CSV files in docs/results: `runs.csv` with a row per run, `curves/` with a file per run, and
`shares.csv` with a row per scenario."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
FOLDER = REPOSITORY / "docs" / "results"
CURVE_ROWS = 100
CURVE_COLUMNS = ("steps", "mean_return", "win_rate", "cpu_seconds")
REACHED = 0.9
"""The win rate whose first appearance is noted."""

Row = dict[str, str]


def read(path: Path) -> list[Row]:
    """The rows of a file; none if there is no such file."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def write(path: Path, rows: Iterable[Row]) -> None:
    """Replaces the file by a complete one."""
    rows = list(rows)
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_suffix(".new")
    with new.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    new.replace(path)


def thinned(log: list[Row]) -> list[Row]:
    """At most `CURVE_ROWS` rows of a learner's log, evenly spread, with the columns of a curve. The first
    rows, in which no episode has ended, are left out."""
    log = [row for row in log if row["mean_return"]]
    last = len(log) - 1
    kept = sorted({round(i * last / (CURVE_ROWS - 1)) for i in range(CURVE_ROWS)}) if log else []
    return [{name: rounded(log[i][name]) for name in CURVE_COLUMNS} for i in kept]


def rounded(value: str) -> str:
    """Four significant digits after the point are more than a picture shows."""
    return value if value.isdigit() else f"{float(value):.3f}"


def first_reached(log: list[Row]) -> Row | None:
    """The first row of the log whose newest 200 episodes have the win rate."""
    full = (row for row in log if row["win_rate"] and int(row["episodes"]) >= 200)
    return next((row for row in full if float(row["win_rate"]) >= REACHED), None)


def time_share(log: list[Row], column: str) -> float:
    """The mean of a share of the updates' times, weighted by these times."""
    seconds = [float(row["seconds"]) for row in log]
    times = [now - before for now, before in zip(seconds, [0.0, *seconds], strict=False)]
    shares = sum(time * float(row[column]) for time, row in zip(times, log, strict=True))
    return shares / max(sum(times), 1e-9)
