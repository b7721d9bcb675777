"""Tables of one topic read from serialised messages; the names in them are unpacked once."""

from __future__ import annotations

import numpy as np
from rclpy.serialization import deserialize_message
from std_msgs.msg import Float64MultiArray

from rail_msgs_py.table import Table, values_from_cdr


class TableReader:
    """Reads the tables of one topic."""

    def __init__(self) -> None:
        self._prefix = b""
        self._length = -1
        self._last: Table | None = None

    def read(self, raw: bytes) -> Table:
        """View of a serialised table.

        Raises
        ------
        ValueError
            If it is not a table.
        """
        last = self._last
        if last is None or len(raw) != self._length or not raw.startswith(self._prefix):
            last = Table.from_msg(deserialize_message(raw, Float64MultiArray))
            self._last, self._length = last, len(raw)
            self._prefix = bytes(raw[: len(raw) - 8 * (1 + last.values.size)])
            return last
        stamp_ns, values = values_from_cdr(raw, len(last.rows), len(last.columns))
        return Table(stamp_ns, last.rows, last.columns, np.asarray(values))
