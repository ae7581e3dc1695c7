"""Columns of many snapshots as arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import smaclite_pool as sp
from numpy.typing import NDArray


class Columns:
    """Reads and writes columns of many snapshots at once."""

    def __init__(self, snapshot: NDArray[np.uint8]) -> None:
        """The columns follow each other without gaps."""
        self.parts: dict[str, tuple[slice, NDArray[Any]]] = {}
        end = 0
        for name, column in sp.snapshot_columns(snapshot).items():
            begin, end = end, end + column.nbytes
            self.parts[name] = slice(begin, end), column

    def read(self, snapshots: NDArray[np.uint8], name: str) -> NDArray[Any]:
        """A column, [snapshots, *shape], as a copy."""
        part, like = self.parts[name]
        values = snapshots[:, part].copy().view(like.dtype)
        return values.reshape(len(snapshots), *like.shape)

    def write(self, snapshots: NDArray[np.uint8], name: str, values: NDArray[Any]) -> None:
        """Writes a column and the checksum: for what `pack_snapshot` has nothing to derive from."""
        part, like = self.parts[name]
        values = np.ascontiguousarray(values, like.dtype).reshape(len(snapshots), like.size)
        snapshots[:, part] = values.view(np.uint8)
        part, _ = self.parts["checksum"]
        sums = crc32c(snapshots[:, part.stop :]).astype("<u4")
        snapshots[:, part] = sums[:, None].view(np.uint8)


def crc_table() -> NDArray[np.uint32]:
    """The remainders of CRC-32C (Castagnoli's polynomial, reflected) of two bytes at once."""
    table = np.arange(1 << 16, dtype=np.uint32)
    for _ in range(16):
        table = np.where(table & 1, table >> np.uint32(1) ^ np.uint32(0x82F63B78), table >> np.uint32(1))
    return table.astype(np.uint32)


CRC_TABLE = crc_table()


def crc32c(rows: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """The checksum of each row, whose length is even."""
    words = np.ascontiguousarray(np.ascontiguousarray(rows).view("<u2").T).astype(np.uint32)
    sums = np.full(rows.shape[0], 0xFFFFFFFF, np.uint32)
    for word in words:
        sums = CRC_TABLE[(sums ^ word) & np.uint32(0xFFFF)] ^ (sums >> np.uint32(16))
    return ~sums
