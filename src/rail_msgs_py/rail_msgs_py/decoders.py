"""From serialised messages to stamp and item, as the input ports of a tick take them.

A decoder is made once per port, so that nothing is looked up per message.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rail_msgs_py.topics.topic import Topic

from .stamps import clock_from_cdr
from .table import values_from_cdr
from .waveform import Waveform, silent_stamp_ns

Item = TypeVar("Item")
#: Stamp [ns] and item of a serialised message.
Decoder = Callable[[bytes], tuple[int, Item]]


def bare_stamp(raw: bytes) -> tuple[int, None]:
    """Stamp of a ``rosgraph_msgs/Clock`` or ``std_msgs/Header``, which carry nothing else."""
    return clock_from_cdr(raw), None


def stamped(from_cdr: Callable[[bytes], Any]) -> Decoder[Any]:
    """Views that know their own ``stamp_ns``, such as `Waveform` and `Telegrams`."""

    def decode(raw: bytes) -> tuple[int, Any]:
        view = from_cdr(raw)
        return view.stamp_ns, view

    return decode


def samples(raw: bytes) -> tuple[int, NDArray[np.complex128] | None]:
    """Samples [antenna, sample] of a waveform, None if it is silent."""
    stamp_ns = silent_stamp_ns(raw)
    if stamp_ns is not None:
        return stamp_ns, None
    block = Waveform.from_cdr(raw)
    return block.stamp_ns, block.samples


def table(topic: Topic, rows: int) -> Decoder[NDArray[np.float64]]:
    """Values [row, column] of a table with a known number of rows."""
    columns = len(topic.columns)

    def decode(raw: bytes) -> tuple[int, NDArray[np.float64]]:
        return values_from_cdr(raw, rows, columns)

    return decode


def table_row(topic: Topic) -> Decoder[list[float]]:
    """Values [column] of a table with one row."""
    columns = len(topic.columns)

    def decode(raw: bytes) -> tuple[int, list[float]]:
        stamp_ns, values = values_from_cdr(raw, 1, columns)
        return stamp_ns, values[0].tolist()

    return decode
