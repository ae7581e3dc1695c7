"""The command: reads recordings, measures rule sets, prints tables and writes CSV files."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import smaclite_pool as sp

from . import recordings, rows, runs, tables
from .recordings import Battle, RecordingError


def main(argv: list[str] | None = None) -> int:
    options = arguments(argv)
    try:
        return measure(options)
    except (RecordingError, ValueError, OSError, sp.errors.PoolError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1


def measure(options: argparse.Namespace) -> int:
    needs_recordings = set(options.measures) & set(runs.OF_RECORDINGS)
    maps = recordings.read(options.folder) if needs_recordings else {}
    maps = {name: half(battles, options.half) for name, battles in maps.items()}
    chosen = known(options.maps or [], {*maps, *sp.scenarios()})
    maps = {name: each for name, each in maps.items() if each and (not chosen or name in chosen)}
    measured = []
    failed = False
    for rules in options.rules:
        begin = time.perf_counter()
        scenarios = dict(options.scenario)
        run = runs.Run(
            rules, maps, chosen, options.measures, options.seeds, options.episodes, scenarios, options.threads
        )
        measured.append(run.tables())
        for name, found in measured[-1].items():
            print(tables.text(name, rules, found))
        print(f"{rules}: {time.perf_counter() - begin:.0f} s\n", flush=True)
        failed |= run.failed
    if options.csv:
        runs.write(options.csv, measured)
    return int(failed)


def arguments(argv: list[str] | None) -> argparse.Namespace:
    about = "How far rule sets are from recorded battles of SMAC. benches/realism/README.md has the method."
    parser = argparse.ArgumentParser("realism", description=about)
    add = parser.add_argument
    folder = "recordings, *.json.gz (default: those of this repository)"
    add("folder", nargs="?", type=Path, default=recordings.FOLDER, help=folder)
    a_rule_set = "rule sets, or smax if JaxMARL is there (default: smaclite paper)"
    add("--rules", nargs="+", default=["smaclite", "paper"], help=a_rule_set)
    add("--measures", nargs="+", default=list(runs.MEASURES), choices=runs.MEASURES, help="default: all")
    add("--maps", nargs="+", help="only these maps")
    add("--seeds", type=count, default=20, help="how often each battle is played (default: 20)")
    halves = "tune: battles with even numbers; report: the others (default: both)"
    add("--half", choices=["both", "tune", "report"], default="both", help=halves)
    scenarios = "scenarios in place of maps"
    add("--scenario", nargs="+", type=assignment, default=[], metavar="MAP=FILE", help=scenarios)
    episodes = "of random play, and a fifth of it of each script (default: 500)"
    add("--episodes", type=count, default=500, help=episodes)
    add("--threads", type=count, help="threads of the pool (default: as many as there are cores)")
    add("--csv", type=Path, metavar="FOLDER", help="writes a file with all numbers of each measure")
    return parser.parse_args(argv)


def count(text: str) -> int:
    if not text.isdigit() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"must be a whole number above 0, got {text!r}")
    return int(text)


def assignment(text: str) -> tuple[str, str]:
    name, equals, scenario = text.partition("=")
    if not (name and equals and scenario):
        raise argparse.ArgumentTypeError(f"must be MAP=FILE, got {text!r}")
    return name, scenario


def known(names: list[str], maps: set[str]) -> set[str]:
    """The names, which must be of these maps."""
    for name in names:
        if name not in maps:
            raise ValueError(f"there is no map {name!r}, but {', '.join(sorted(maps))}")
    return set(names)


def half(battles: list[Battle], name: str) -> list[Battle]:
    chosen = rows.half_of(battles, "" if name == "both" else name)
    return [battles[i] for i in chosen.nonzero()[0]]


if __name__ == "__main__":
    sys.exit(main())
