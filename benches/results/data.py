"""The CSV files in docs/results, and where the program is."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
FOLDER = REPOSITORY / "docs" / "results"
PROGRAM = REPOSITORY / "target" / "release" / "smaclite-pool"

GROUPS = (
    "default",
    "flat",
    "generated",
    "open-loop",
    "other-critic",
    "paper-rules",
    "starcraft",
)
"""What `results.train` reports, in a folder each."""

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


def sees_state(scenario: str) -> bool:
    """Whether the critic of flat networks of the page does: of six agents or more, the default of then."""
    import smaclite_pool as sp  # which not all tools need

    told = sp.scenario(scenario)
    return told["teams_are_drawn"] or len(told["allies"]) >= 6
