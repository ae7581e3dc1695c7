"""Writes the numbers that the documentation quotes, from the CSV files below docs.

A number stands in its page behind a mark, so that it can be read where marks are not replaced:

    <!-- value: FILE; ROW; COLUMN; FORMAT -->7<!-- end -->

FILE is a CSV file below docs and ROW what its first column has there; a ROW that ends in `*` stands for all
rows that begin so, and the number for their median. COLUMN is a column of its header; or, for a ratio, two of
them (`COLUMN / COLUMN`); or `different COLUMN`, for how many different values these rows have in it. FORMAT,
which may be omitted, is a format of Python, or -3 for thousands.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
from pathlib import Path
from statistics import median

from . import data

PAGES = [
    *(data.REPOSITORY / name for name in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    data.REPOSITORY / "benches" / "README.md",
    *sorted((data.REPOSITORY / "docs").rglob("*.md")),
]
MARK = re.compile(r"(?P<mark><!-- value: (?P<key>.*?) -->)[^<]*(?P<end><!-- end -->)?", re.DOTALL)

BEGIN = re.compile(r"[\s>*+-]*(\d+[.)]\s*)?")
"""Of a line: indentation, and the marks of quotes and lists."""


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser("results.values", description=(__doc__ or "").split("\n\n")[0])
    parser.parse_args(argv)
    for page in PAGES:
        page.write_text(filled(page.read_text(), page))
    return 0


def filled(text: str, page: Path, folder: Path = data.REPOSITORY / "docs") -> str:
    """The text of a page with the numbers that the files have now.

    Raises:
        ValueError: a mark has no such file, row or column, no end, or is where Markdown does not allow it.
    """

    def number(found: re.Match[str]) -> str:
        place = f"{page}:{text.count(chr(10), 0, found.start()) + 1}"
        line_start = text.rfind("\n", 0, found.start()) + 1
        if BEGIN.fullmatch(text[line_start : found.start()]):
            raise ValueError(f"{place}: a mark begins the line, which Markdown then takes for HTML")
        if not found["end"]:
            raise ValueError(f"{place}: no <!-- end --> after the number")
        try:
            return found["mark"] + value(" ".join(found["key"].split()), folder) + found["end"]
        except ValueError as error:
            raise ValueError(f"{place}: {error}") from error

    return MARK.sub(number, text)


def value(key: str, folder: Path) -> str:
    """The number of a mark, as text."""
    parts = key.split("; ")
    if len(parts) not in {3, 4}:
        raise ValueError(f"expected FILE; ROW; COLUMN or FILE; ROW; COLUMN; FORMAT, got {key!r}")
    name, row, columns, *form = parts
    rows = data.read(folder / name)
    if not rows:
        raise ValueError(f"there is no file docs/{name} with rows")
    first = next(iter(rows[0]))
    chosen = [each for each in rows if matches(each[first], row)]
    if not chosen:
        raise ValueError(f"docs/{name} has no row {row!r}")
    terms = []
    for term in columns.split(" / "):
        column = term.removeprefix("different ")
        if column not in rows[0]:
            raise ValueError(f"docs/{name} has no column {column!r}, but {', '.join(rows[0])}")
        if not all(each[column] for each in chosen):
            raise ValueError(f"docs/{name} has no number in column {column!r} of row {row!r}")
        cells = [each[column] for each in chosen]
        terms.append(float(len(set(cells))) if column != term else median(map(float, cells)))
    return formatted(terms[0] / math.prod(terms[1:]), *form)


def matches(name: str, pattern: str) -> bool:
    return name.startswith(pattern[:-1]) if pattern.endswith("*") else name == pattern


def formatted(number: float, form: str = "") -> str:
    """By default whole numbers with commas, and all others as they are."""
    if re.fullmatch(r"-\d", form):
        return f"{round(number, int(form)):,.0f}"
    form = form or (",.0f" if number.is_integer() else "")
    return format(number, form).replace("%", " %")


if __name__ == "__main__":
    sys.exit(main())
