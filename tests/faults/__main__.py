"""The command line: `just faults --help`."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import faults
from faults.scenarios import SCENARIOS, test


def main() -> int:
    parser = argparse.ArgumentParser(
        "faults", description=faults.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenarios", nargs="*", metavar="SCENARIO", help=f"{', '.join(SCENARIOS)} (all)")
    parser.add_argument("--sample", type=int, metavar="N", help="N faults of each scenario (all)")
    options = parser.parse_args()
    if options.sample is not None and options.sample < 1:
        parser.error(f"--sample must be at least 1, got {options.sample}")
    if unknown := set(options.scenarios) - set(SCENARIOS):
        parser.error(f"unknown scenario {', '.join(sorted(unknown))}; there are {', '.join(SCENARIOS)}")
    with tempfile.TemporaryDirectory(prefix="faults") as folder:
        problems = sum(test(name, options.sample, Path(folder)) for name in options.scenarios or SCENARIOS)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
