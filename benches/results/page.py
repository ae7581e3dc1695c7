"""Draws the curves of docs/results.md and writes its tables, from the CSV files in docs/results.

What is between the marks `<!-- table: NAME -->` and `<!-- end -->` of the page is replaced; the text around
it is written by hand.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from . import data, tables


def main(argv: list[str] | None = None) -> int:
    summary, explanation = (__doc__ or "").split("\n\n")
    parser = argparse.ArgumentParser("results.page", description=f"{summary} {explanation}")
    folder = "folder of the CSV files (docs/results)"
    parser.add_argument("--data", help=folder, type=Path, default=data.FOLDER)
    page = data.REPOSITORY / "docs" / "results.md"
    parser.add_argument("--page", help="the page (docs/results.md)", type=Path, default=page)
    options = parser.parse_args(argv)
    from . import charts  # needs matplotlib, which `--help` does not

    text = options.page.read_text()
    rows, shares = data.read(options.data / "runs.csv"), data.read(options.data / "shares.csv")
    for name, table in tables.tables(rows, shares).items():
        text = tables.insert(text, name, table)
    options.page.write_text(text)
    charts.draw(options.data)
    return 0


if __name__ == "__main__":
    sys.exit(main())
