"""Training of a team by `smaclite-pool train`, in a process of its own."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from ._team import Team, load_team
from .errors import InvalidRequest, PoolError

LINE_INTERVAL = 2.0
"""Seconds between two lines of progress."""

OF_THE_PROGRAM = ("seeds", "resume", "json", "maps")
"""Options of `smaclite-pool train` that `train` has not."""

# The program is apart from this one, so that Ctrl-C in a terminal reaches it once and from here: at a second
# signal it ends at once, without a checkpoint.
if sys.platform == "win32":
    APART: dict[str, Any] = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
else:
    APART: dict[str, Any] = {"start_new_session": True}


def train(
    scenario: str | PathLike[str],
    out: str | PathLike[str],
    *,
    steps: int | None = None,
    seed: int = 0,
    opponent: str | PathLike[str] | Mapping[str, float] | Team | None = None,
    on_update: Callable[[dict[str, Any]], object] | None = None,
    **options: object,
) -> Team:
    """Train a team, as `smaclite-pool train` in another process, and return it.

        import smaclite_pool as sp

        team = sp.train("3m", "runs/3m", steps=200_000, seed=1)

    Args:
        scenario: a standard scenario or the path of a scenario file.
        out: the folder of the run, which must not hold one.
        steps: environment steps; by default as many as the program makes.
        seed: of weights, environments, actions and minibatches.
        opponent: who plays the enemies, as in `make`, but no mixture with a team; or another team, as
            `load_team` returns it or by the folder of its run; `"self"` or `"league"`. None for the map's own
            opponent, and on a running pool (`pool="NAME"`), which has its own.
        on_update: called with the record of every update, the columns of `log.csv`; by default a line with
            steps, return and win rate is printed every two seconds, and at the end.
        options: other options of the program, such as `num_envs=128`, `hidden=[32, 32]`, `zero_sum=True` or
            `pool="train", lane=["one", "two"]`; but not `seeds`, `resume` or `maps`, which do not train one
            new team on one map, or `json`, which is always given.

    Ctrl-C, or another exception, as one of `on_update`, ends the training after its last update, which is
    saved, and passes on: `smaclite-pool train --resume OUT` continues it. On Windows the update or evaluation
    in progress is its last.

    Raises InvalidRequest with the program's message if it fails, and PoolError if the program was ended by a
    signal.
    """
    refused = [name for name in options if name in OF_THE_PROGRAM]
    if refused:
        raise InvalidRequest(
            f"`{refused[0]}` is no option of `train`, which trains one new team on one map: run "
            f"`smaclite-pool train --{refused[0]}`"
        )
    # What is not given is left to the program: it refuses some options beside others, such as `pool`.
    enemies = None if opponent is None else opponent_text(opponent)
    given = {"out": fspath(out), "seed": seed, "opponent": enemies, "steps": steps, **options}
    arguments = [text for name, value in given.items() for text in option(name, value)]
    # The scenario comes last: it may begin with a hyphen.
    argv = [sys.executable, "-m", "smaclite_pool", "train", "--json", *arguments, "--", fspath(scenario)]
    progress = Progress(Path(out))
    run_program(argv, progress.show if on_update is None else on_update, Path(out))
    if on_update is None:
        progress.end()
    return load_team(out)


def opponent_text(opponent: str | PathLike[str] | Mapping[str, float] | Team) -> str:
    """As the program reads it."""
    if isinstance(opponent, Mapping):
        return ",".join(f"{name}={weight}" for name, weight in opponent.items())
    if not isinstance(opponent, Team):
        return fspath(opponent)
    if opponent.weights is not None or opponent.greedy:
        raise InvalidRequest(
            "opponent must be a team with default weights and sampled actions, as it plays in a training: "
            f"load_team({opponent.folder!r})"
        )
    # A folder without a slash may have the name of a script.
    is_name = opponent.folder.startswith("zoo:") or Path(opponent.folder).name != opponent.folder
    return opponent.folder if is_name else f"./{opponent.folder}"


def option(name: str, value: object) -> list[str]:
    """An argument of this function as one of the program; none if it is None or False."""
    flag = f"--{name.replace('_', '-')}"
    if value is None or value is False:
        return []
    if value is True:
        return [flag]
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        if name == "lane":  # a name may have no comma, and the program takes one at a time
            return [f"{flag}={lane}" for lane in value]
        value = ",".join(map(str, value))
    return [f"{flag}={value}"]


def run_program(argv: list[str], on_update: Callable[[dict[str, Any]], object], out: Path) -> None:
    """Trains and calls `on_update`. Its messages go to a file: nothing reads them until the program ends, and
    a pipe that is full would stop it."""
    with (
        tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as messages,
        subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=messages, encoding="utf-8", **APART) as process,
    ):
        assert process.stdout is not None
        try:
            for line in process.stdout:
                on_update(json.loads(line))
            status = process.wait()
        except BaseException:
            # When nobody reads its output it writes a checkpoint after its update and ends. A signal ends the
            # update, too.
            process.stdout.close()
            if sys.platform != "win32":
                process.send_signal(signal.SIGINT)
            process.wait()
            raise
        messages.seek(0)
        text = messages.read().strip()
    if status > 128 or status < 0:
        number = status - 128 if status > 128 else -status
        # Windows has no signals: there a status says what ended a program.
        cause = f"signal {number}" if number <= 128 else f"status {status:#x}"
        raise PoolError(
            f"{cause} ended the training; `smaclite-pool train --resume {out}` continues it from its last "
            "checkpoint"
        )
    if status != 0:
        raise InvalidRequest(in_python(text))
    if text:
        print(text, file=sys.stderr)  # warnings, and what `SMACLITE_POOL_LOG` asks for


def in_python(message: str) -> str:
    """A message of the program with the names of keywords instead of options, without how the program is
    used."""
    message = message.removeprefix("smaclite-pool: ").removeprefix("error: ")
    message = re.split(r"\n\n(?:Usage:|For more information)", message)[0]
    option = r"'--([a-z][a-z-]*)(?: <[^>]*>)?'|(?<![\w-])--([a-z][a-z-]*)"
    # What is between backticks is typed as it is: commands, and options of other commands.
    parts = message.split("`")
    parts[::2] = [re.sub(option, lambda at: f"`{keyword(at[1] or at[2])}`", part) for part in parts[::2]]
    message = "`".join(parts)
    return re.sub(r"\s*\n\s*", "; ", message.strip()).replace("unexpected argument", "unknown keyword")


def keyword(name: str) -> str:
    """The keyword for an option of the program, if `train` has it."""
    return f"smaclite-pool train --{name}" if name in OF_THE_PROGRAM else name.replace("-", "_")


class Progress:
    """Prints how far a training is, as the program does."""

    def __init__(self, out: Path) -> None:
        self.out = out
        self.steps: int | None = None
        self.printed = -LINE_INTERVAL
        self.last: str | None = None

    def show(self, record: dict[str, Any]) -> None:
        """Prints a line about an update, unless one was printed just before."""
        if self.steps is None:
            self.steps = json.loads((self.out / "run.json").read_bytes())["config"]["steps"]
        self.last = progress_line(record, self.steps)
        now = time.monotonic()
        if now - self.printed > LINE_INTERVAL:
            print(self.last, flush=True)
            self.printed, self.last = now, None

    def end(self) -> None:
        """Prints the last update, if it was not printed, and that the training is complete."""
        if self.last is not None:
            print(self.last)
        print("complete", flush=True)


def progress_line(record: dict[str, Any], steps: int) -> str:
    """A line about an update."""
    if record["episodes"] == 0:
        return f"{record['steps']} of {steps} steps"
    wins = f"return {record['mean_return']:.2f}, wins {100 * record['win_rate']:.1f} %"
    return f"{record['steps']} of {steps} steps, {wins}"
