"""Builds the extension module and the tests from nothing, and prints what takes longest to compile.

`just build-times` runs it; CONTRIBUTING.md has the table. It builds in a folder of its own, which is
deleted first, unless `--keep` is given.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

TARGET = Path(__file__).resolve().parents[1] / "target" / "build-times"
BUILDS = (
    ("build", "--package", "smaclite-bindings", "--lib"),
    ("test", "--no-run"),
)


def units(arguments: tuple[str, ...]) -> list[tuple[float, str]]:
    """Builds, and returns the seconds of every unit by cargo's own report."""
    options = ("--release", "--locked", "--timings", "--target-dir", str(TARGET))
    subprocess.run(["cargo", *arguments, *options], check=True)
    report = (TARGET / "cargo-timings" / "cargo-timing.html").read_text()
    found = re.search(r"const UNIT_DATA = (\[.*?\]);\n", report, re.DOTALL)
    if not found:
        raise SystemExit("error: cargo's report of timings has no UNIT_DATA, as that of cargo 1.95 does")
    return [(unit["duration"], f"{unit['name']}{unit['target']}") for unit in json.loads(found[1])]


def main() -> None:
    if sys.argv[1:] != ["--keep"]:
        shutil.rmtree(TARGET, ignore_errors=True)
    times = [time for arguments in BUILDS for time in units(arguments)]
    # cargo adds words to the name of what is not the library of a crate: programs, tests, build scripts.
    libraries = [unit for unit in times if " " not in unit[1]]
    programs = [unit for unit in times if " " in unit[1] and "build-script" not in unit[1]]
    for heading, chosen in (("crate", libraries), ("program", programs)):
        print(f"\n| {heading} | seconds |\n| --- | --- |")
        for seconds, name in sorted(chosen, reverse=True)[:10]:
            print(f"| `{name.strip()}` | {seconds:.0f} |")


if __name__ == "__main__":
    main()
