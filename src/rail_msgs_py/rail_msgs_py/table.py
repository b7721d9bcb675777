"""Labelled tables of numbers as ``std_msgs/Float64MultiArray``.

For values that have no standard type: ``layout.dim[0]`` carries the names of the rows,
``layout.dim[1]`` those of the columns, each joined by commas; ``data_offset`` 1: the leading
value is the stamp [s].
"""

from __future__ import annotations

import array
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from .stamps import NANOSECONDS, seconds_to_ns


@dataclass(frozen=True, eq=False)
class Table:
    """Rows by columns of values at one instant.

    Parameters
    ----------
    stamp_ns : int
        Simulated time.
    rows, columns : tuple of str
        Names; a column's name ends in its unit.
    values : array [row, column]
    """

    stamp_ns: int
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    values: NDArray[np.float64]

    def row(self, name: str) -> dict[str, float]:
        """Values of one row by column name."""
        values = self.values[self.rows.index(name)]
        return {column: float(x) for column, x in zip(self.columns, values, strict=True)}

    def to_msg(self) -> Float64MultiArray:
        """Message form."""
        message = Float64MultiArray()
        width = len(self.columns)
        message.layout.dim = [
            MultiArrayDimension(
                label=",".join(self.rows), size=len(self.rows), stride=len(self.rows) * width
            ),
            MultiArrayDimension(label=",".join(self.columns), size=width, stride=width),
        ]
        message.layout.data_offset = 1
        data = array.array("d", [self.stamp_ns / NANOSECONDS])
        data.frombytes(np.ascontiguousarray(self.values, dtype=np.float64).tobytes())
        message.data = data
        return message

    @classmethod
    def from_msg(cls, message: Any) -> Table:
        """View of a message.

        Raises
        ------
        ValueError
            If the layout is not that of a table.
        """
        if len(message.layout.dim) != 2 or message.layout.data_offset != 1:
            raise ValueError("not a table: two dimensions and a data offset of 1 expected")
        rows, columns = (_names(dim) for dim in message.layout.dim)
        data = np.frombuffer(message.data, dtype=np.float64)
        if data.size != 1 + len(rows) * len(columns):
            raise ValueError(f"not a table: {data.size} values for {len(rows)} x {len(columns)}")
        return cls(
            seconds_to_ns(float(data[0])), rows, columns, data[1:].reshape(len(rows), len(columns))
        )


def _names(dim: Any) -> tuple[str, ...]:
    names = tuple(dim.label.split(",")) if dim.label else ()
    if len(names) != dim.size:
        raise ValueError(f"not a table: {len(names)} names for {dim.size} entries")
    return names


class TableWriter:
    """Serialises the tables of one topic: only stamp and values change."""

    def __init__(self, rows: tuple[str, ...], columns: tuple[str, ...]) -> None:
        blank = Table(0, rows, columns, np.zeros((len(rows), len(columns))))
        raw = serialize_message(blank.to_msg())
        self._prefix = bytes(raw[: len(raw) - 8 * (1 + blank.values.size)])

    def write(self, stamp_ns: int, values: NDArray[np.float64]) -> bytes:
        """Serialised table; ``values`` [row, column] must be C-contiguous float64."""
        return b"".join((self._prefix, struct.pack("<d", stamp_ns / NANOSECONDS), values.tobytes()))


def values_from_cdr(raw: bytes, rows: int, columns: int) -> tuple[int, NDArray[np.float64]]:
    """Stamp [ns] and values [row, column] of a serialised table of known shape."""
    tail = np.frombuffer(raw, np.float64, 1 + rows * columns, len(raw) - 8 * (1 + rows * columns))
    return seconds_to_ns(float(tail[0])), tail[1:].reshape(rows, columns)
