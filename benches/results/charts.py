"""The curves of docs/results.md, as SVG. A line is the median over the seeds, a band is their range.

Every chart is drawn twice, for light and for dark pages, with a transparent background. Equal data gives
equal files.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.rcsetup import cycler
from numpy.typing import NDArray

from . import data
from .runs import PAPER, RUNS, Runs, default

mpl.use("svg")
mpl.rcParams.update({
    "svg.hashsalt": "smaclite-pool",  # otherwise ids are random
    "svg.fonttype": "none",  # text stays text, which is smaller
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.grid.axis": "y",
    "path.simplify_threshold": 0.5,
})  # fmt: skip

POINTS = 41
"""Of a curve."""
REFERENCE = {"color": "C4", "linestyle": "--", "linewidth": 1.2}
"""The style of lines that are not curves."""


def palette(text: str, grid: str, series: list[str]) -> Any:
    """Settings for the colours of text and axes, of the grid, and of bars and curves by their order."""
    names = ["text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"]
    return {"axes.prop_cycle": cycler(color=series), "grid.color": grid, **dict.fromkeys(names, text)}


PALETTES = {
    "": palette("#24292f", "#dddddd", ["#0060a8", "#d9730d", "#208040", "#8a3fa0", "#808080"]),
    "-dark": palette("#d8dae0", "#434853", ["#58a6f0", "#f0984c", "#58b878", "#c490e4", "#9a9da6"]),
}
"""By what they add to the name of a file."""

Lines = list[tuple[str, Runs]]
"""The curves of a panel, with their names."""
Panel = tuple[Lines, str]
"""What is in a panel, and the column that is drawn."""


def draw(folder: Path) -> None:
    """Draws all charts from the curves in the folder, into it."""
    found = [runs for runs in RUNS if curves(folder, runs)]

    def panels(group: str, *columns: str) -> list[Panel]:
        of_group = [runs for runs in found if runs.group == group]
        scenarios = dict.fromkeys(runs.scenario for runs in of_group)
        lines = [named([runs for runs in of_group if runs.scenario == scenario]) for scenario in scenarios]
        return [(line, column) for line in lines for column in columns]

    save(folder, "paper", panels("paper", "mean_return"), 3)
    save(folder, "paper-wins", panels("paper", "win_rate"), 3)
    save(folder, "default", panels("default", "win_rate"), 4)
    save(folder, "others", panels("others", "win_rate"), 4)
    save(folder, "rules", panels("rules", "win_rate", "mean_return"), 2)
    ratings(folder)


def ratings(folder: Path) -> None:
    """Draws the ratings of teams over their training, a panel per scenario."""
    rows = data.read(folder / "elo.csv")
    scenarios = list(dict.fromkeys(row["scenario"] for row in rows))

    def figure() -> Any:
        import matplotlib.pyplot as plt

        figure, grid = plt.subplots(1, len(scenarios), figsize=(9, 2.5), squeeze=False, layout="constrained")
        for axes, scenario in zip(grid.flat, scenarios, strict=True):
            draw_ratings(axes, [row for row in rows if row["scenario"] == scenario])
        grid.flat[0].set_ylabel("Elo")
        grid.flat[-1].legend(loc="lower right", fontsize=8, frameon=False)
        return figure

    if rows:
        write(figure, folder / "elo.svg")


def draw_ratings(axes: Any, rows: list[data.Row]) -> None:
    """One scenario: the teams by what they were trained against, and the best script."""
    teams = [row for row in rows if row["steps"]]
    steps = sorted({int(row["steps"]) for row in teams})
    for index, trained in enumerate(dict.fromkeys(row["trained"] for row in teams)):
        of_kind = [row for row in teams if row["trained"] == trained]
        at = [[float(row["elo"]) for row in of_kind if int(row["steps"]) == step] for step in steps]
        xs = [step / 1e6 for step in steps]
        low, high = [min(values) for values in at], [max(values) for values in at]
        axes.fill_between(xs, low, high, color=f"C{index}", alpha=0.25, linewidth=0)
        axes.plot(xs, [np.median(values) for values in at], color=f"C{index}", linewidth=1.6, label=trained)
    best = max(float(row["elo"]) for row in rows if not row["steps"])
    axes.axhline(best, label="best script", **REFERENCE)
    axes.set(title=rows[0]["scenario"], xlabel="million steps", xlim=(0, None))


def named(several: list[Runs]) -> Lines:
    """Names the configurations of a scenario."""
    if several[0].group == "rules":
        return [("rules smaclite", default(several[0].scenario)), ("rules paper", several[0])]
    if len(several) == 1:
        return [(f"{several[0].seeds} seeds", several[0])]
    return [(runs.variant or "default", runs) for runs in several]


def curves(folder: Path, runs: Runs) -> list[list[data.Row]]:
    """The curves of these runs that there are."""
    names = (f"{runs.name(seed)}.csv" for seed in range(1, runs.seeds + 1))
    return [rows for rows in (data.read(folder / "curves" / name) for name in names) if rows]


def save(folder: Path, name: str, panels: list[Panel], columns: int) -> None:
    """Draws the panels in rows of `columns`. Without panels, there is no picture."""
    if not panels:
        return
    columns = min(columns, len(panels))
    write(lambda: drawn(folder, panels, columns), folder / f"{name}.svg")


def drawn(folder: Path, panels: list[Panel], columns: int) -> Any:
    """A figure of these panels."""
    import matplotlib.pyplot as plt

    rows = -(-len(panels) // columns)
    width = 9.0 / max(columns, 2)
    figure, grid = plt.subplots(
        rows, columns, figsize=(width * columns, 2.3 * rows), squeeze=False, layout="constrained"
    )
    legend: list[str] = []
    for axes, (lines, column) in zip(grid.flat, panels, strict=False):
        draw_panel(axes, folder, lines, column)
        if legend != (legend := axes.get_legend_handles_labels()[1]):  # or it is that of the panel before
            axes.legend(loc="lower right", fontsize=8, frameon=False)
    for axes in grid.flat[len(panels) :]:
        axes.set_visible(False)
    return figure


def write(draw_figure: Callable[[], Any], path: Path) -> None:
    """Writes what the function draws as small SVG files, one per palette: NAME.svg and NAME-dark.svg."""
    import matplotlib.pyplot as plt

    for suffix, colours in PALETTES.items():
        with mpl.rc_context(colours):
            figure, svg = draw_figure(), io.StringIO()
            figure.savefig(svg, transparent=True, metadata={"Date": None, "Creator": None})
            plt.close(figure)
        path.with_stem(path.stem + suffix).write_text(compact(svg.getvalue()))


def compact(svg: str) -> str:
    """The picture with a tenth of a point as the resolution of lines, without what has no effect: it is a
    third of the size."""
    svg = re.sub(r"(\.\d\d)\d+", r"\1", svg)
    svg = re.sub(r' transform="rotate\(-0 [^"]*"| id="\w+_\d+"', "", svg)

    def path(found: re.Match[str]) -> str:
        return re.sub(r"(\.\d)\d", r"\1", " ".join(found[0].split()))

    lines = re.sub(r'(?<= d=")[^"]*', path, svg).splitlines()
    return "\n".join(line.strip() for line in lines) + "\n"


def draw_panel(axes: Any, folder: Path, lines: Lines, column: str) -> None:
    """One scenario."""
    scale = 100.0 if column == "win_rate" else 1.0
    for index, (label, runs) in enumerate(lines):
        colour = f"C{index}"
        if found := curves(folder, runs):
            steps, values = on_one_grid(found, column)
            low, mid, high = scale * values.min(0), scale * np.median(values, 0), scale * values.max(0)
            axes.fill_between(steps, low, high, color=colour, alpha=0.25, linewidth=0)
            axes.plot(steps, mid, color=colour, linewidth=1.6, label=label)
    (_, runs), title = lines[-1], lines[-1][1].scenario
    if runs.group == "default":
        axes.axhline(100 * data.REACHED, label="90 %", **REFERENCE)
    if column == "win_rate":
        axes.set(ylim=(-3, 103), yticks=(0, 50, 100), ylabel="won episodes (%)")
    else:
        if runs.group == "paper":
            theirs = PAPER[title]
            axes.axhline(theirs.test_return, label=f"paper, {theirs.algorithm}", **REFERENCE)
        axes.set(ylim=(0, max(22, axes.get_ylim()[1])), ylabel="return")
    axes.locator_params(axis="x", nbins=4)
    axes.set(title=title, xlabel="million steps", xlim=(0, None))


def on_one_grid(found: list[list[data.Row]], column: str) -> tuple[NDArray[Any], NDArray[Any]]:
    """Millions of steps that all curves have, and the values there, `[curves, POINTS]`."""
    steps = [np.array([float(row["steps"]) for row in rows]) / 1e6 for rows in found]
    values = [np.array([float(row[column]) for row in rows]) for rows in found]
    grid = np.linspace(max(xs[0] for xs in steps), min(xs[-1] for xs in steps), POINTS)
    return grid, np.array([np.interp(grid, xs, ys) for xs, ys in zip(steps, values, strict=True)])
