"""Messages as a person reads them: decoded where the corridor knows how, plain otherwise."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from typing import Any

import numpy as np

from rail_msgs_py.table import Table
from rail_msgs_py.waveform import Waveform

from .topic_kinds import kind_of

_LEVELS = {b"\x00": "ok", b"\x01": "warn", b"\x02": "error", b"\x03": "stale"}
_SAMPLES_SHOWN = 4


def decode(topic: str, message: Any) -> str:
    """One message as text: one line where it can be said in one."""
    kind = kind_of(topic)
    if kind is not None and kind.view is not None:
        try:
            view = kind.view.from_msg(message)
        except ValueError as error:
            return f"({error})\n{raw_text(message)}"
        return _text(view)
    if hasattr(message, "status") and isinstance(message.status, list):
        return "\n".join(_status(status) for status in message.status)
    if hasattr(message, "level") and hasattr(message, "hardware_id"):
        return _status(message)
    return raw_text(message)


def _text(view: Any) -> str:
    """A view in words: its own where it has some."""
    if isinstance(view, Waveform):
        return _waveform(view)
    if isinstance(view, Table):
        return _table(view)
    if hasattr(view, "describe"):
        return f"{_time(view.stamp_ns)}  {view.describe()}"
    return str(view)


def _time(stamp_ns: int) -> str:
    return f"{stamp_ns * 1e-9:10.3f} s"


def _waveform(block: Waveform) -> str:
    channel = f"CH{block.channel}" if block.channel else "no channel"
    line = f"{_time(block.stamp_ns)}  {channel:5} {block.carrier_hz * 1e-6:.1f} MHz  "
    if block.silent:
        return line + "silent"
    antennas, count = block.samples.shape
    first = ", ".join(f"{x.real:+.2e}{x.imag:+.2e}j" for x in block.samples[0, :_SAMPLES_SHOWN])
    return (
        f"{line}{antennas} x {count} samples at {block.sample_rate_hz * 1e-6:g} MS/s, "
        f"{block.power_dbm:.1f} dBm: {first}, ..."
    )


def _table(table: Table) -> str:
    lines = []
    for name, values in zip(table.rows, table.values, strict=True):
        pairs = zip(table.columns, values.tolist(), strict=True)
        lines.append(values_line(table.stamp_ns * 1e-9, name, pairs))
    return "\n".join(lines)


def values_line(stamp_s: float | None, row: str | None, pairs: Iterable[tuple[str, Any]]) -> str:
    """Time, row and values by name in one line; time and row are left out where there is none."""
    cells = "  ".join(
        f"{name} {value:.6g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in pairs
    )
    head = "" if stamp_s is None else f"{stamp_s:10.3f} s  "
    return f"{head}{row}: {cells}" if row is not None else head + cells


def _status(status: Any) -> str:
    values = ", ".join(f"{pair.key}: {pair.value}" for pair in status.values if pair.value)
    detail = f" ({values})" if values else ""
    return f"{_LEVELS.get(status.level, '?'):5} {status.name}: {status.message}{detail}"


def raw_text(message: Any, indent: int = 0) -> str:
    """A message field by field, as ``ros2 topic echo`` prints it; every value of an array."""
    pad = "  " * indent
    lines = []
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        if hasattr(value, "get_fields_and_field_types"):
            lines.append(f"{pad}{name}:\n{raw_text(value, indent + 1)}")
        elif isinstance(value, list) and value and hasattr(value[0], "SLOT_TYPES"):
            items = "\n".join(f"{pad}-\n{raw_text(item, indent + 1)}" for item in value)
            lines.append(f"{pad}{name}:\n{items}")
        elif isinstance(value, array | np.ndarray | list):
            lines.append(f"{pad}{name}: [{', '.join(str(item) for item in value)}]")
        else:
            lines.append(f"{pad}{name}: {value!r}")
    return "\n".join(lines)
