"""The picture of a study: figures over the first column of its summary, with their intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
from matplotlib.figure import Figure as Canvas

from rail_corridor.plotting import COLOURS, STYLE

from .figures import Figure
from .intervals import Estimate
from .model import Study
from .summary import Group, is_theory_alone

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
    low = _least(name, groups, figures[name])
    beside = [other for other, figure in figures.items() if figure.beside == name]
    for number, (rest, line) in enumerate(lines.items()):
        x = [
            group.key[0] if numeric else names.index(str(group.key[0])) if by else 0
            for group in line
        ]
        label = ", ".join(f"{_short(k)} {v}" for k, v in zip(by[1:], rest, strict=True)) or name
        colour = COLOURS[number % len(COLOURS)]
        style = {"color": colour, "label": label, "fmt": "o-" if numeric else "o"}
        _points(axes, x, [group.estimates[name] for group in line], low, style)
        for other in beside:
            _theory(axes, x, line, other, figures[other], colour)
    for place, other in enumerate(beside):
        note = f"dashed: {other.replace('_', ' ')}, theory"
        if any(is_theory_alone(group, figures[other]) for group in groups):
            note += "; dotted: where the runs saw none"
        where = (0.98, 0.97 - 0.07 * place)
        axes.annotate(note, where, xycoords="axes fraction", ha="right", va="top", fontsize=8)
    if low is not None:
        axes.set_yscale("log")
        axes.set_ylim(bottom=low)
    if by and not numeric:
        axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
    how = figures[name].over_runs
    axes.set_title(name.replace("_", " ") + ("" if how == "mean" else f" ({how})"))
    axes.set_xlabel(_short(by[0]).replace("_", " ") if by else "")


def _theory(
    axes: Any, x: Sequence[Any], line: Sequence[Group], name: str, figure: Figure, colour: str
) -> None:
    """Draw a figure of theory, dotted towards where the runs saw nothing of it."""
    points = [(at, group.estimates[name].value) for at, group in zip(x, line, strict=True)]
    alone = [is_theory_alone(group, figure) for group in line]
    for index, ends in enumerate(pairwise(points)):
        style = ":" if alone[index] or alone[index + 1] else "--"
        axes.plot(*zip(*ends, strict=True), style, color=colour, linewidth=1.0)


def _least(name: str, groups: Sequence[Group], figure: Figure) -> float | None:
    """Lower end of a logarithmic axis; None where rates do not differ by so much."""
    estimates = [group.estimates[name] for group in groups]
    positive = [e.value for e in estimates if e.value > 0.0]
    if figure.over_runs not in ("proportion", "rate") or not positive:
        return None
    if max(positive) <= _DECADES * min(positive):
        return None
    lows = [e.low for e in estimates if e.low > 0.0]
    return 0.5 * min([*positive, *lows, *(e.high for e in estimates if e.high > 0.0)])


def _points(
    axes: Any,
    x: Sequence[Any],
    estimates: Sequence[Estimate],
    low: float | None,
    style: Mapping[str, Any],
) -> None:
    """Draw values and intervals; on a logarithmic axis of zero the upper end alone."""
    shown = [(at, e) for at, e in zip(x, estimates, strict=True) if low is None or e.value > 0.0]
    reach = [
        [0.0 if math.isnan(e.half_width) else max(0.0, e.value - e.low) for _, e in shown],
        [0.0 if math.isnan(e.half_width) else max(0.0, e.high - e.value) for _, e in shown],
    ]
    places, values = [at for at, _ in shown], [e.value for _, e in shown]
    axes.errorbar(places, values, yerr=reach, ms=3.5, capsize=2, **style)
    if low is not None:
        none = [(at, e.high) for at, e in zip(x, estimates, strict=True) if e.value == 0.0]
        places, ends = [at for at, _ in none], [end for _, end in none]
        axes.plot(places, ends, "v", ms=4.5, color=style["color"], fillstyle="none")


def _differs(name: str, groups: Sequence[Group]) -> bool:
    values = {group.estimates[name].value for group in groups}
    return len({value for value in values if not math.isnan(value)}) > 1


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _short(name: str) -> str:
    return name.rpartition(".")[2]
