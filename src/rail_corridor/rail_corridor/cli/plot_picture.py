"""The picture of ``rail plot``: one panel for each unit, over one axis of time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from rail_corridor.plotting import STYLE

from .series import Series, panels_of


def draw_series(series: Sequence[Series], title: str, path: Path) -> None:
    """Draw series into a file; its ending says in which format."""
    with mpl.rc_context(STYLE):
        figure = Figure()
        draw(figure, series, title)
        metadata = {"Software": None} if path.suffix.lower() == ".png" else None
        figure.savefig(path, metadata=metadata)


def draw(figure: Figure, series: Sequence[Series], title: str) -> None:
    """Draw series into a figure."""
    panels = panels_of(series)
    figure.set_size_inches(9.0, 1.6 + 2.4 * len(panels))
    rows = np.atleast_1d(np.asarray(figure.subplots(len(panels), 1, sharex=True)))
    for axes, (unit, members) in zip(rows, panels.items(), strict=True):
        for each in members:
            axes.plot(each.times_s, each.values, label=each.label)
        axes.set_ylabel(f"[{unit}]" if unit else "")
        axes.legend(loc="best")
    rows[0].set_title(title)
    rows[-1].set_xlabel("simulated time [s]")
