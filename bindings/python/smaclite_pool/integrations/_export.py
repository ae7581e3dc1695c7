"""Shared by the exports of datasets: their command line, and arrays that do not need memory."""

from __future__ import annotations

import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from .._native import Dataset, __version__
from ..errors import InvalidRequest, PoolError

Arrays = dict[str, NDArray[Any]]


@contextmanager
def expanded(dataset: Dataset, folder: Path) -> Iterator[tuple[Arrays, Path]]:
    """All arrays of a dataset, mapped from files in `folder`, and an empty folder in it.

    Both are removed afterwards. A million steps can be larger than the memory.
    """
    with tempfile.TemporaryDirectory(prefix=".export-", dir=folder) as temporary:
        partial = Path(temporary) / "partial"
        partial.mkdir()
        yield dataset.expand(Path(temporary) / "arrays"), partial


def complete(partial: Path, folder: Path) -> None:
    """Give a dataset that was written whole its name, which another program may have taken meanwhile."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    try:
        partial.rename(folder)
    except OSError as error:
        if not folder.exists():
            raise
        raise InvalidRequest(f"`{folder}` exists: another program wrote it meanwhile") from error


def description(dataset: Dataset) -> dict[str, Any]:
    """What a dataset is, for the metadata of another format: its card, and what made it."""
    return {
        **dataset.card,
        "hash": dataset.hash,
        "recorded_by": dataset.program,
        "exported_by": f"smaclite-pool {__version__}",
    }


def run(name: str, export: Callable[[str, str, str], object]) -> None:
    """The command line `python -m smaclite_pool.integrations.NAME FILE OUT UID`."""
    if len(sys.argv) != 4:
        raise SystemExit(f"usage: python -m smaclite_pool.integrations.{name} FILE OUT UID")
    for number in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _stop)
    try:
        export(*sys.argv[1:])
    except (PoolError, ModuleNotFoundError, OSError) as error:
        raise SystemExit(f"{name}: {error}") from None
    except Stopped as stopped:
        print(f"{name}: interrupted; nothing was written", file=sys.stderr)
        raise SystemExit(128 + stopped.args[0]) from None


class Stopped(BaseException):
    """A signal asks the program to end; its number. Temporary files are removed first."""


def _stop(number: int, _frame: object) -> None:
    signal.signal(number, signal.SIG_DFL)  # the second one ends it at once
    raise Stopped(number)
