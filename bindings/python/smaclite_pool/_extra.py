"""Names the extra of this package to install where another package is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def extra(name: str) -> Iterator[None]:
    """Names the extra to install if an import in this block fails for a missing package."""
    try:
        yield
    except ModuleNotFoundError as error:
        install = f"install it with: pip install 'smaclite-pool[{name}]'"
        raise ModuleNotFoundError(f"{error.msg}; {install}", name=error.name, path=error.path) from None
