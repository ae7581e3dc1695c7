"""Shared by the exports of datasets: their command line, and arrays that do not need memory."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from .._native import Dataset, __version__
from ..errors import PoolError

Arrays = dict[str, NDArray[Any]]


@contextmanager
def expanded(dataset: Dataset, folder: Path) -> Iterator[Arrays]:
    """All arrays of a dataset, mapped from files in `folder`, which are removed afterwards.

    A million steps can be larger than the memory.
    """
    with tempfile.TemporaryDirectory(prefix=".expanded-", dir=folder) as temporary:
        yield dataset.expand(Path(temporary) / "arrays")


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
    try:
        export(*sys.argv[1:])
    except (PoolError, ModuleNotFoundError, OSError) as error:
        raise SystemExit(f"{name}: {error}") from None
    except KeyboardInterrupt:
        raise SystemExit(f"{name}: interrupted; nothing was written") from None
