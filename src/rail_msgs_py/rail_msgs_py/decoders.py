"""From serialised messages to stamp and item, as the input ports of a tick take them.

A decoder is made once per port, so that nothing is looked up per message.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rail_msgs_py.topics.topic import Topic

from .delivery import Decoder, ViewDecoder
from .stamps import clock_from_cdr
from .table import values_from_cdr
from .waveform import Waveform, WaveformView, silent_stamp_ns


def bare_stamp(raw: bytes) -> tuple[int, None]:
    """Stamp of a ``rosgraph_msgs/Clock`` or ``std_msgs/Header``, which carry nothing else."""
    return clock_from_cdr(raw), None


def stamped(from_cdr: Callable[[bytes], Any]) -> ViewDecoder[Any]:
    """Views that know their own ``stamp_ns``, such as `Telegrams`."""

    def of_view(view: Any) -> tuple[int, Any]:
        return view.stamp_ns, view

    return ViewDecoder(lambda raw: of_view(from_cdr(raw)), of_view)


def _block_of_raw(raw: bytes) -> tuple[int, Waveform | None]:
    stamp_ns = silent_stamp_ns(raw)
    if stamp_ns is not None:
        return stamp_ns, None
    block = Waveform.from_cdr(raw)
    return block.stamp_ns, block


def _block_of_view(view: WaveformView) -> tuple[int, Waveform | None]:
    return view.stamp_ns, None if view.first.silent else view.first


def _samples_of_raw(raw: bytes) -> tuple[int, NDArray[np.complex128] | None]:
    stamp_ns, block = _block_of_raw(raw)
    return stamp_ns, None if block is None else block.samples


def _samples_of_view(view: WaveformView) -> tuple[int, NDArray[np.complex128] | None]:
    return view.stamp_ns, None if view.first.silent else view.first.samples


def _waveform_of_raw(raw: bytes) -> tuple[int, Waveform]:
    view = Waveform.from_cdr(raw)
    return view.stamp_ns, view


#: A waveform, silent or not. Of a block that is sent again the stamp is that of the first.
waveform: Final = ViewDecoder(_waveform_of_raw, lambda view: (view.stamp_ns, view.first))
#: A waveform, None if it is silent. Of a block that is sent again the stamp is that of the first.
block: Final = ViewDecoder(_block_of_raw, _block_of_view)
#: Samples [antenna, sample] of a waveform, None if it is silent.
samples: Final = ViewDecoder(_samples_of_raw, _samples_of_view)


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
