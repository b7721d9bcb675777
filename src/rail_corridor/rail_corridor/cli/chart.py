"""Curves as text: dots of Braille characters, two by four to a character."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from typing import Final

import numpy as np
from numpy.typing import NDArray
from rich.text import Text

from .series import Series, panels_of

#: Styles of the curves of one panel, in turn.
_STYLES: Final = ("cyan", "magenta", "yellow", "green", "red", "blue")
_BLANK: Final = 0x2800
#: Bit of each dot of a character, [row, column].
_BITS: Final = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
_LABEL: Final = 10
_LEAST_WIDTH, _LEAST_HEIGHT = 10, 3


def charts(series: Sequence[Series], span_s: tuple[float, float], width: int, height: int) -> Text:
    """One panel for each unit, one above the other, over one axis of time.

    Parameters
    ----------
    series : sequence of Series
    span_s : tuple of float
        First and last time of the axis [s].
    width, height : int
        Room [characters].
    """
    panels = panels_of(series)
    legends = sum(len(members) + 1 for members in panels.values())
    rows = max((height - legends - 2) // max(len(panels), 1), _LEAST_HEIGHT)
    columns = max(width - _LABEL - 2, _LEAST_WIDTH)
    lines: list[Text] = []
    for unit, members in panels.items():
        lines += _panel(unit, members, span_s, columns, rows)
    first, last = (f"{time_s:.1f} s" for time_s in span_s)
    lines.append(Text(f"{'':{_LABEL}}  {first}{last:>{max(columns - len(first), 1)}}", style="dim"))
    return Text("\n").join(lines)


def _panel(
    unit: str, members: Sequence[Series], span_s: tuple[float, float], columns: int, rows: int
) -> list[Text]:
    low, high = _limits([value for each in members for value in each.values])
    masks = np.zeros((rows, columns), dtype=int)
    owners = np.zeros((rows, columns), dtype=int)
    for number, each in enumerate(members):
        mine = dots(each.times_s, each.values, (*span_s, low, high), (4 * rows, 2 * columns))
        bits = (mine.reshape(rows, 4, columns, 2) * _BITS[None, :, None, :]).sum(axis=(1, 3))
        masks |= bits
        owners[bits > 0] = number
    lines = [Text(f"{'':{_LABEL}}  [{unit}]" if unit else "", style="bold")]
    for row in range(rows):
        value = {0: f"{high:.6g}", rows - 1: f"{low:.6g}"}.get(row, "")
        line = Text.assemble((f"{value:>{_LABEL}} │", "dim"))
        characters = zip(masks[row].tolist(), owners[row].tolist(), strict=True)
        for owner, run in groupby(characters, key=lambda pair: pair[1]):
            text = "".join(chr(_BLANK + mask) for mask, _ in run)
            line.append(text, style=_STYLES[owner % len(_STYLES)])
        lines.append(line)
    for number, each in enumerate(members):
        newest = each.values[-1] if each.values else math.nan
        text = f"{'':{_LABEL}}  ─ {each.label}  {newest:.6g} {unit}".rstrip()
        lines.append(Text(text, style=_STYLES[number % len(_STYLES)]))
    return lines


def _limits(values: Sequence[float]) -> tuple[float, float]:
    """Lowest and highest of some values, apart from each other."""
    finite = [value for value in values if math.isfinite(value)]
    if not finite:
        return 0.0, 1.0
    low, high = min(finite), max(finite)
    if low == high:
        margin = 0.05 * abs(low) or 1.0
        return low - margin, high + margin
    return low, high


def dots(
    times_s: Sequence[float],
    values: Sequence[float],
    window: tuple[float, float, float, float],
    shape: tuple[int, int],
) -> NDArray[np.bool_]:
    """Dots of a curve, straight between its points, and broken where a value is nan.

    Parameters
    ----------
    times_s, values : sequences of float
    window : tuple of float
        First and last time, lowest and highest value.
    shape : tuple of int
        Rows and columns of dots.

    Returns
    -------
    array of bool [row, column]
        The highest value is in the first row.
    """
    rows, columns = shape
    begin_s, end_s, low, high = window
    found = np.zeros(shape, dtype=bool)
    x = (np.asarray(times_s) - begin_s) / ((end_s - begin_s) or 1.0) * (columns - 1)
    y = (high - np.asarray(values)) / (high - low) * (rows - 1)
    before: tuple[float, float] | None = None
    for point in zip(x.tolist(), y.tolist(), strict=True):
        if not math.isfinite(point[1]):
            before = None
            continue
        first = before or point
        steps = math.ceil(max(abs(point[0] - first[0]), abs(point[1] - first[1]))) + 1
        along = np.rint(np.linspace(first, point, steps)).astype(int)
        inside = ((along >= 0) & (along < (columns, rows))).all(axis=1)
        found[along[inside, 1], along[inside, 0]] = True
        before = point
    return found
