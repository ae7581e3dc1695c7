"""Draws the charts of docs/benchmarks.md and writes its tables, from the CSV files in docs/benchmarks.

The header of a CSV file is the header of its table: one column of names, then numbers, one bar each. Where
the page shows a part of a file, benches/README.md has the whole table. It also names machine and commands.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import data, tables

FOLDER = data.REPOSITORY / "docs" / "benchmarks"
PAGE = data.REPOSITORY / "docs" / "benchmarks.md"
DETAILS = data.REPOSITORY / "benches" / "README.md"
DETAILED = ["engine", "pool"]
"""The files with a table in benches/README.md."""


@dataclass(frozen=True)
class Benchmark:
    """A CSV file, its table, and its chart."""

    name: str
    axis: str
    """What the numbers are; they share one axis."""
    log: bool = False
    drawn: bool = True
    """Whether there is a chart."""
    columns: tuple[str, ...] = ()
    """The numbers that page and chart show; all if empty."""
    bars: tuple[str, ...] = ()
    """The rows that the chart shows; all if empty."""


BENCHMARKS = [
    Benchmark("peers", "environment steps per second", log=True, bars=("3m", "2s3z", "3s5z", "27m_vs_30m")),
    Benchmark(
        "pool",
        "environment steps per second",
        columns=("engine alone", "1 thread", "two engines", "2 threads"),
    ),
    Benchmark("cores", "environment steps per second", drawn=False),
    Benchmark("paper", "microseconds per step", log=True),
    Benchmark("epymarl", "environment steps per second"),
    Benchmark("many", "", drawn=False),
    Benchmark("asynchronous", "environment steps per second", drawn=False),
    Benchmark("transport", "microseconds per round trip", log=True),
]


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser("results.benchmarks", description=__doc__)
    parser.add_argument("--data", help="folder of the CSV files (docs/benchmarks)", type=Path, default=FOLDER)
    parser.add_argument("--page", help="the page (docs/benchmarks.md)", type=Path, default=PAGE)
    details = "whole tables (benches/README.md)"
    parser.add_argument("--details", help=details, type=Path, default=DETAILS)
    options = parser.parse_args(argv)
    options.page.write_text(page(options.page.read_text(), options.data))
    options.details.write_text(whole_tables(options.details.read_text(), options.data))
    for benchmark in BENCHMARKS:
        if benchmark.drawn:
            header, rows = shown(benchmark, options.data)
            rows = [row for row in rows if not benchmark.bars or row[0] in benchmark.bars]
            draw(benchmark, header, rows, options.data / f"{benchmark.name}.svg")
    return 0


def page(text: str, folder: Path = FOLDER) -> str:
    """docs/benchmarks.md with the tables of the files."""
    for benchmark in BENCHMARKS:
        text = insert(text, benchmark.name, *shown(benchmark, folder))
    return text


def whole_tables(text: str, folder: Path = FOLDER) -> str:
    """benches/README.md with the tables of the files."""
    for name in DETAILED:
        text = insert(text, name, *read(folder / f"{name}.csv"))
    return text


def insert(text: str, name: str, header: list[str], rows: list[list[str]]) -> str:
    return tables.insert(text, name, tables.markdown(header, [cells(row) for row in rows]))


def shown(benchmark: Benchmark, folder: Path) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a file, with the columns that the page shows."""
    header, rows = read(folder / f"{benchmark.name}.csv")
    columns = [0, *map(header.index, benchmark.columns or header[1:])]
    return [header[column] for column in columns], [[row[column] for column in columns] for row in rows]


def read(path: Path) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a CSV file."""
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    for row in rows:
        if len(row) != len(header):
            raise ValueError(f"{path}: {len(row)} cells instead of {len(header)} in {row}")
    return header, rows


def cells(row: list[str]) -> list[str]:
    """Numbers of four digits and more with commas; all others as they are."""
    return [f"{int(cell):,}" if cell.isdigit() and len(cell) > 3 else cell for cell in row]


def draw(benchmark: Benchmark, header: list[str], rows: list[list[str]], path: Path) -> None:
    """Writes the chart of these rows."""
    from . import charts  # needs matplotlib

    charts.write(lambda: figure(benchmark, header, rows), path)


def figure(benchmark: Benchmark, header: list[str], rows: list[list[str]]) -> Any:
    """Groups of horizontal bars, one group per row."""
    import matplotlib.pyplot as plt

    series = header[1:]
    thickness = 0.8 / len(series)
    height = 0.9 + 0.19 * len(rows) * (len(series) + 1)
    chart, axes = plt.subplots(figsize=(7.5, height), layout="constrained")
    for index, label in enumerate(series):
        values = [float(row[index + 1] or 0) for row in rows]
        places = [group + (index - (len(series) - 1) / 2) * thickness for group in range(len(rows))]
        bars = axes.barh(places, values, thickness, label=label)  # in the next colour of the palette
        labels = [cells(row)[index + 1] for row in rows]
        axes.bar_label(bars, labels, padding=3, fontsize=8)
    smallest = min(float(cell) for row in rows for cell in row[1:] if cell)
    decorate(axes, benchmark, [row[0] for row in rows], len(series), smallest)
    return chart


def decorate(axes: Any, benchmark: Benchmark, names: list[str], series: int, smallest: float) -> None:
    """Axes, grid and legend."""
    axes.margins(x=0.15)  # for the numbers
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set_xlabel(benchmark.axis)
    axes.grid(axis="y", visible=False)
    axes.grid(axis="x", visible=True)
    if benchmark.log:
        axes.set_xscale("log")
        axes.set_xlim(left=10 ** math.floor(math.log10(smallest)))
        axes.xaxis.set_minor_formatter("")
    axes.xaxis.set_major_formatter("{x:,.0f}")
    if series > 1:
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.0), ncols=series, fontsize=8, frameon=False)
        axes.set_ylim(len(names) - 0.5, -1.1)  # a row for the legend


if __name__ == "__main__":
    sys.exit(main())
