"""Charts of docs/results.md, as SVG: ratings. Curves of training are those of `smaclite-pool report`.

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

from . import data

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
