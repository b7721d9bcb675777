"""Figures of the source documents and of the project's own results, drawn from its code."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

from matplotlib.figure import Figure

from . import track_code_figures

#: Colours that people with any colour vision tell apart (Okabe and Ito, 2008).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")

STYLE: dict[str, Any] = {
    "axes.prop_cycle": mpl.cycler(color=COLOURS),
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.dpi": 110,
    "figure.figsize": (8.0, 4.5),
    "figure.constrained_layout.use": True,
    "font.size": 11,
    "grid.alpha": 0.3,
    "lines.linewidth": 1.6,
    "svg.hashsalt": "rail corridor",
}

#: Name of a figure -> what draws it.
FIGURES: dict[str, Callable[[Figure], None]] = {**track_code_figures.FIGURES}


def draw(directory: Path, names: tuple[str, ...] = ()) -> Iterator[Path]:
    """Draw figures into a directory; yield the file of each.

    Parameters
    ----------
    directory : Path
        Made if it is not there.
    names : tuple of str
        Figures wanted; all if empty.
    """
    directory.mkdir(parents=True, exist_ok=True)
    for name in names or tuple(FIGURES):
        with mpl.rc_context(STYLE):
            figure = Figure()
            FIGURES[name](figure)
            path = directory / f"{name}.png"
            figure.savefig(path, metadata={"Software": None})
        yield path
