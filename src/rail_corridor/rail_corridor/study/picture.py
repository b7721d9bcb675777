"""The picture of a study: figures over the first column of its summary, with their intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
from matplotlib.figure import Figure as Canvas

from rail_corridor.plotting import COLOURS, STYLE

from .figures import Figure
from .model import Study
from .summary import Group

_WIDE: Final = 3
#: Beyond so many times the least value a diagram of rates is logarithmic.
_DECADES: Final = 30.0


def draw_study(path: Path, study: Study, groups: Sequence[Group], names: Sequence[str]) -> None:
    """Draw one small diagram for each figure, and in it as a dashed line what is beside it.

    What is the same in all groups is left out, unless there is nothing else.
    """
    names = [name for name in names if _differs(name, groups)] or list(names)
    wide = min(_WIDE, len(names))
    high = math.ceil(len(names) / wide)
    style: Any = STYLE
    with mpl.rc_context(style):
        canvas = Canvas(figsize=(4.6 * wide, 3.4 * high + 0.5), layout="constrained")
        canvas.suptitle(study.name.replace("_", " "))
        every = canvas.subplots(high, wide, squeeze=False).flat
        for axes, name in zip(every, names, strict=False):
            _draw(axes, name, groups, study.columns, study.figures)
        for axes in canvas.axes[len(names) :]:
            axes.set_visible(False)
        handles, labels = canvas.axes[0].get_legend_handles_labels()
        if len(labels) > 1:
            canvas.legend(handles, labels, loc="outside lower center", ncols=min(5, len(labels)))
        canvas.savefig(path, metadata={"Software": None})


def _draw(
    axes: Any,
    name: str,
    groups: Sequence[Group],
    by: Sequence[str],
    figures: Mapping[str, Figure],
) -> None:
    lines: dict[tuple[object, ...], list[Group]] = {}
    for group in groups:
        lines.setdefault(group.key[1:], []).append(group)
    names = list(dict.fromkeys(str(group.key[0]) for group in groups)) if by else [""]
    numeric = bool(by) and all(_is_number(group.key[0]) for group in groups)
    values: list[float] = []
    for number, (rest, line) in enumerate(lines.items()):
        x = [
            group.key[0] if numeric else names.index(str(group.key[0])) if by else 0
            for group in line
        ]
        label = ", ".join(f"{_short(k)} {v}" for k, v in zip(by[1:], rest, strict=True))
        colour = COLOURS[number % len(COLOURS)]
        values += _points(axes, x, line, name, "o-" if numeric else "o", colour, label)
        for other, figure in figures.items():
            if figure.beside == name:
                y = [group.estimates[other].value for group in line]
                axes.plot(x, y, "--", color=colour, linewidth=1.0)
                note = f"dashed: {other.replace('_', ' ')}"
                axes.annotate(note, (0.02, 0.97), xycoords="axes fraction", va="top", fontsize=8)
    positive = [value for value in values if value > 0.0]
    is_rate = figures[name].over_runs in ("proportion", "rate")
    if is_rate and positive and max(positive) > _DECADES * min(positive):
        axes.set_yscale("log")
    if by and not numeric:
        axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
    how = figures[name].over_runs
    axes.set_title(name.replace("_", " ") + ("" if how == "mean" else f" ({how})"))
    axes.set_xlabel(_short(by[0]).replace("_", " ") if by else "")


def _points(
    axes: Any,
    x: Sequence[Any],
    line: Sequence[Group],
    name: str,
    style: str,
    colour: str,
    label: str,
) -> list[float]:
    """Draw values and intervals; returns the values."""
    estimates = [group.estimates[name] for group in line]
    reach = [
        [0.0 if math.isnan(e.half_width) else max(0.0, e.value - e.low) for e in estimates],
        [0.0 if math.isnan(e.half_width) else max(0.0, e.high - e.value) for e in estimates],
    ]
    values = [e.value for e in estimates]
    axes.errorbar(
        x, values, yerr=reach, fmt=style, ms=3.5, capsize=2, color=colour, label=label or name
    )
    return values


def _differs(name: str, groups: Sequence[Group]) -> bool:
    values = {group.estimates[name].value for group in groups}
    return len({value for value in values if not math.isnan(value)}) > 1


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _short(name: str) -> str:
    return name.rpartition(".")[2]
