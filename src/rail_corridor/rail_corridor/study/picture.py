"""The picture of a study: every figure over the first varied field, with its intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure as Canvas

from rail_corridor.plotting import STYLE

from .figures import Figure
from .summary import Group

_WIDE = 3


def draw_study(
    path: Path,
    title: str,
    groups: Sequence[Group],
    by: Sequence[str],
    figures: Mapping[str, Figure],
) -> None:
    """Draw one small diagram for each figure."""
    wide = min(_WIDE, len(figures))
    high = math.ceil(len(figures) / wide)
    with mpl.rc_context(STYLE):
        canvas = Canvas(figsize=(4.6 * wide, 3.2 * high + 0.4))
        canvas.suptitle(title)
        for axes, name in zip(
            canvas.subplots(high, wide, squeeze=False).flat, figures, strict=False
        ):
            _draw(axes, name, groups, by)
        for axes in canvas.axes[len(figures) :]:
            axes.set_visible(False)
        canvas.savefig(path)


def _draw(axes: object, name: str, groups: Sequence[Group], by: Sequence[str]) -> None:
    lines: dict[tuple[object, ...], list[Group]] = {}
    for group in groups:
        lines.setdefault(group.key[1:], []).append(group)
    for rest, line in lines.items():
        x = [group.key[0] if by else group.runs for group in line]
        numeric = all(isinstance(each, int | float) and not isinstance(each, bool) for each in x)
        places = x if numeric else list(range(len(x)))
        estimates = [group.estimates[name] for group in line]
        reach = [
            [0.0 if math.isnan(e.half_width) else e.value - e.low for e in estimates],
            [0.0 if math.isnan(e.half_width) else e.high - e.value for e in estimates],
        ]
        label = ", ".join(f"{k} {v}" for k, v in zip(by[1:], rest, strict=True)) or None
        axes.errorbar(  # type: ignore[attr-defined]
            places,
            [e.value for e in estimates],
            yerr=reach,
            fmt="o-",
            ms=3.5,
            capsize=2,
            label=label,
        )
        if not numeric:
            axes.set_xticks(places, [str(each) for each in x], rotation=30, ha="right")  # type: ignore[attr-defined]
    axes.set_title(name)  # type: ignore[attr-defined]
    axes.set_xlabel(by[0] if by else "runs")  # type: ignore[attr-defined]
    if len(lines) > 1:
        axes.legend()  # type: ignore[attr-defined]
