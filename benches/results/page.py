"""Writes the tables of docs/results.md, from the CSV files in docs/results.

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
    options.page.write_text(with_tables(options.page.read_text(), options.data))
    return 0


def with_tables(text: str, folder: Path) -> str:
    """The page with the tables of these files."""
    reports = {group: data.read(folder / group / "runs.csv") for group in data.GROUPS}
    searches = data.read(folder / "search.csv")
    scripts = (data.REPOSITORY / "docs" / "reference" / "policies.md").read_text()
    for name, table in tables.tables(reports, searches, scripts).items():
        text = tables.insert(text, name, table)
    return text


if __name__ == "__main__":
    sys.exit(main())
