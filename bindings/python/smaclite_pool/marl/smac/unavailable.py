"""The error of options of SMAC that do not exist here."""

from __future__ import annotations

from ...errors import PoolError

__all__ = ["Unavailable"]


class Unavailable(PoolError, NotImplementedError):
    """An option of SMAC that has no meaning here or needs data that the pool does not have.

    The message gives the reason.
    """
