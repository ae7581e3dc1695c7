"""The curves of docs/results.md, as SVG. A line is the median over the seeds, a band is their range.

The pictures have a white background, so that they can be read on dark pages too, and equal data gives equal
files.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from . import data
from .runs import PAPER, RUNS, Runs

mpl.use("svg")
mpl.rcParams.update({
    "svg.hashsalt": "smaclite-pool",  # otherwise ids are random
    "svg.fonttype": "none",  # text stays text, which is smaller
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "path.simplify_threshold": 0.5,
})  # fmt: skip

POINTS = 81
"""Of a curve."""
COLOURS = {"smaclite": "#0060a8", "paper": "#c04000"}
"""Of the rules; they differ in brightness too."""
REFERENCE = "#555555"

Panel = Callable[[Any], None]


def draw(folder: Path) -> None:
    """Draws all charts from the curves in the folder, into it."""

    def runs(group: str) -> list[Runs]:
        return [runs for runs in RUNS if runs.group == group and curves(folder, runs)]

    def panel(runs: Runs, column: str) -> Panel:
        return lambda axes: draw_panel(axes, folder, runs, column)

    def rules_panel(runs: Runs, column: str) -> Panel:
        return lambda axes: draw_rules(axes, folder, runs, column)

    for name, column in (("paper", "mean_return"), ("paper-wins", "win_rate")):
        save(folder / f"{name}.svg", [panel(found, column) for found in runs("paper")], 3)
    for group in ("default", "others"):
        save(folder / f"{group}.svg", [panel(found, "win_rate") for found in runs(group)], 4)
    both = [rules_panel(found, column) for found in runs("rules") for column in ("win_rate", "mean_return")]
    save(folder / "rules.svg", both, 2)


def curves(folder: Path, runs: Runs) -> list[list[data.Row]]:
    """The curves of these runs that there are."""
    names = (f"{runs.group}-{runs.scenario}-{seed}.csv" for seed in range(1, runs.seeds + 1))
    return [rows for rows in (data.read(folder / "curves" / name) for name in names) if rows]


def save(path: Path, panels: list[Panel], columns: int) -> None:
    """Draws the panels in rows of `columns`. Without panels, there is no picture."""
    if not panels:
        return
    import matplotlib.pyplot as plt

    columns = min(columns, len(panels))
    lines = -(-len(panels) // columns)
    width = 9.0 / max(columns, 2)
    figure, grid = plt.subplots(
        lines, columns, figsize=(width * columns, 2.3 * lines), squeeze=False, layout="constrained"
    )
    for axes, panel in zip(grid.flat, panels):
        panel(axes)
    for axes in grid.flat[len(panels) :]:
        axes.set_visible(False)
    figure.savefig(path, facecolor="white", metadata={"Date": None, "Creator": None})
    plt.close(figure)


def draw_panel(axes: Any, folder: Path, runs: Runs, column: str) -> None:
    """One scenario."""
    plot(axes, curves(folder, runs), column, "smaclite", f"{runs.seeds} seeds")
    if column == "mean_return" and runs.scenario in PAPER:
        theirs = PAPER[runs.scenario]
        label = f"paper, {theirs.algorithm}"
        axes.axhline(theirs.test_return, color=REFERENCE, linestyle="--", linewidth=1.2, label=label)
    if runs.group == "default":
        axes.axhline(100 * data.REACHED, color=REFERENCE, linestyle="--", linewidth=1, label="90 %")
    finish(axes, runs.scenario, column)


def draw_rules(axes: Any, folder: Path, runs: Runs, column: str) -> None:
    """One scenario with both rule sets."""
    default = next(other for other in RUNS if (other.group, other.scenario) == ("default", runs.scenario))
    for rules, found in (("smaclite", default), ("paper", runs)):
        plot(axes, curves(folder, found), column, rules, f"rules {rules}")
    finish(axes, runs.scenario, column)


def plot(axes: Any, found: list[list[data.Row]], column: str, colour: str, label: str) -> None:
    if not found:
        return
    steps, values = on_one_grid(found, column)
    scale = 100.0 if column == "win_rate" else 1.0
    low, mid, high = (scale * values.min(0), scale * np.median(values, 0), scale * values.max(0))
    axes.fill_between(steps, low, high, color=COLOURS[colour], alpha=0.25, linewidth=0)
    axes.plot(steps, mid, color=COLOURS[colour], linewidth=1.6, label=label)


def on_one_grid(found: list[list[data.Row]], column: str) -> tuple[NDArray[Any], NDArray[Any]]:
    """Millions of steps that all curves have, and the values there, `[curves, POINTS]`."""
    steps = [np.array([float(row["steps"]) for row in rows]) / 1e6 for rows in found]
    values = [np.array([float(row[column]) for row in rows]) for rows in found]
    grid = np.linspace(max(xs[0] for xs in steps), min(xs[-1] for xs in steps), POINTS)
    return grid, np.array([np.interp(grid, xs, ys) for xs, ys in zip(steps, values)])


def finish(axes: Any, title: str, column: str) -> None:
    axes.set_title(title)
    axes.set_xlim(left=0)
    axes.set_xlabel("million steps")
    axes.set_ylabel("won episodes (%)" if column == "win_rate" else "return")
    axes.set_ylim((-3, 103) if column == "win_rate" else (0, None))
    if title in PAPER and column == "mean_return":  # above the dashed line there is room
        axes.set_ylim(0, max(22, 1.08 * PAPER[title].test_return))
    axes.legend(loc="lower right", fontsize=8, framealpha=0.8)
