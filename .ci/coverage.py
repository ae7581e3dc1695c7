"""Prints the coverage of each crate, as a table of Markdown, from a summary of `cargo llvm-cov --json`.

`just coverage` runs it; CONTRIBUTING.md has the table.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def crate_of(file: Path) -> str:
    """The folder of the crate that a source file is of."""
    return next(str(folder.relative_to(ROOT)) for folder in file.parents if (folder / "Cargo.toml").is_file())


def main() -> None:
    files = json.loads(Path(sys.argv[1]).read_text())["data"][0]["files"]
    counts: Counter[tuple[str, str, str]] = Counter()
    for file in files:
        crate = crate_of(Path(file["filename"]))
        for kind in ("lines", "regions"):
            for what in ("covered", "count"):
                counts[crate, kind, what] += file["summary"][kind][what]
    print("| crate | lines | covered (%) | regions covered (%) |\n| --- | ---: | ---: | ---: |")
    for crate in sorted({crate for crate, _, _ in counts}):
        kinds = ("lines", "regions")
        shares = [100 * counts[crate, kind, "covered"] / counts[crate, kind, "count"] for kind in kinds]
        lines = f"{counts[crate, 'lines', 'count']:,}"
        print(f"| {crate} | {lines} | {shares[0]:.1f} | {shares[1]:.1f} |")


if __name__ == "__main__":
    main()
