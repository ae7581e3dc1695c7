"""How charts of the documentation look, as SVG. Curves of training are those of `smaclite-pool report`.

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
from matplotlib.rcsetup import cycler

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


def palette(text: str, grid: str, series: list[str]) -> Any:
    """Settings for the colours of text and axes, of the grid, and of bars and curves by their order."""
    names = ["text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"]
    return {"axes.prop_cycle": cycler(color=series), "grid.color": grid, **dict.fromkeys(names, text)}


PALETTES = {
    "": palette("#24292f", "#dddddd", ["#0060a8", "#d9730d", "#208040", "#8a3fa0", "#808080"]),
    "-dark": palette("#d8dae0", "#434853", ["#58a6f0", "#f0984c", "#58b878", "#c490e4", "#9a9da6"]),
}
"""By what they add to the name of a file."""


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
