"""Plays battles on smaclite_pool and on the published environment side by side, and reports every
difference.

Played are random scenarios, the standard scenarios, and scenario files. Observations, state, available
actions, rewards and ends must be equal to the bit in every step. A difference is recorded tick by tick,
with its scenario and unit files, and so is a smaller scenario that differs too; then the Rust tests name
the first tick and quantity.

The interpreter needs the published environment (smaclite 0.0.1 and its C++ addon rvo2) and
smaclite_pool, built from this checkout by `python -m pip install .`; `just differential` uses the
interpreter that the environment variable SMACLITE_PYTHON names.

Exit status: 0 if nothing differs, 1 if something does, 2 if nothing could be played, 130 after Ctrl-C.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import generator, scenarios
from .command import missing_package, natural, positive

if TYPE_CHECKING:
    from .episode import Episode

POLICIES = ["random", "nearest", "focus"]
UNLIMITED_STEPS = 50
"""Length of an episode whose scenario has no step limit."""


def main(argv: list[str] | None = None) -> int:
    options = parse(argv)
    if problem := missing_package():
        print(f"error: {problem}", file=sys.stderr)
        return 2
    from .examine import Published  # only now: these import the packages
    from .published import PublishedBattle
    from .recording import record
    from .run import name_ticks, run

    try:
        episodes = list(planned(options))
    except (OSError, ValueError, KeyError) as error:
        print(f"error: {error!r}", file=sys.stderr)
        return 2
    if not episodes:
        print("error: expected episodes to play, got COUNT 0, --standard 0 and no --file", file=sys.stderr)
        return 2
    print(f"{len(episodes)} episodes, --first {options.first}, {options.jobs} processes", flush=True)
    published = Published(PublishedBattle, record)
    progress = run(episodes, published, options.folder, options.jobs, options.stop_after)
    if progress.tally["different"]:
        name_ticks(options.folder)
    if progress.interrupted:
        return 130  # as shells have it for SIGINT
    return 1 if progress.faults() else 0


def parse(argv: list[str] | None) -> argparse.Namespace:
    summary, played, *requirements = (__doc__ or "").split("\n\n")
    parser = argparse.ArgumentParser(
        "differential", description=f"{summary} {played}", epilog=" ".join(requirements), allow_abbrev=False
    )
    seed = int(time.time()) % 10**6

    def option(name: str, text: str, **settings: Any) -> None:
        parser.add_argument(name, help=text, **{"type": natural, "metavar": "N", **settings})

    option("random", "random scenarios (100)", nargs="?", default=100, metavar="COUNT")
    option("--standard", "episodes of the standard scenarios in turn (one of each)")
    file = {"type": Path, "metavar": "SCENARIO.json"}
    option("--file", "a scenario file; may be repeated", action="append", default=[], **file)
    option("--file-episodes", "episodes of each file (3, one for each policy)", default=len(POLICIES))
    option("--first", "first seed, others follow (another one in every run)", default=seed)
    option("--steps", f"most steps of an episode (the scenario's limit, or {UNLIMITED_STEPS})")
    option("--jobs", "processes (one per core)", type=positive, default=os.cpu_count())
    option("--stop-after", "stop after this number of faults (20)", type=positive, default=20)
    folder = {"type": Path, "metavar": "FOLDER"}
    option("--folder", "for what differs; new or empty (target/differential/TIME)", **folder)
    options = parser.parse_args(argv)
    now = time.strftime("%Y%m%d-%H%M%S")
    options.folder = (options.folder or scenarios.REPOSITORY / "target" / "differential" / now).absolute()
    if options.folder.exists() and any(options.folder.iterdir()):
        parser.error(f"--folder must be new or empty, and {options.folder} is not")
    return options


def planned(options: argparse.Namespace) -> Iterator[Episode]:
    """All episodes that the options ask for. Policies take turns, and every round of policies has a new seed.

    Raises:
        OSError, ValueError, KeyError: a scenario file that cannot be used.
    """
    from .episode import Episode

    def episode(files: scenarios.ScenarioFiles, turn: int, seed: int) -> Episode:
        steps = options.steps if options.steps is not None else files.episode_limit or UNLIMITED_STEPS
        return Episode(files, POLICIES[turn % len(POLICIES)], seed, steps)

    for path in options.file:
        files = scenarios.read(path.absolute())
        for turn in range(options.file_episodes):
            yield episode(files, turn, options.first + turn // len(POLICIES))
    standard = [scenarios.standard(name) for name in scenarios.standard_names()]
    for i in range(len(standard) if options.standard is None else options.standard):
        turn = i // len(standard)
        yield episode(standard[i % len(standard)], turn, options.first + turn // len(POLICIES))
    for seed in range(options.first, options.first + options.random):
        yield episode(generator.random_scenario(seed), seed, seed)


if __name__ == "__main__":
    sys.exit(main())
