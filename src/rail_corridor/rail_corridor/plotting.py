"""What all figures share: colours, style, and that each says what to see in it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import matplotlib as mpl

mpl.use("Agg")

from cycler import cycler
from matplotlib.figure import Figure

#: Colours that people with any colour vision tell apart (Okabe and Ito, 2008).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")

STYLE: Any = {
    "axes.prop_cycle": cycler(color=COLOURS),
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 12,
    "figure.dpi": 110,
    "figure.figsize": (8.0, 4.5),
    "figure.constrained_layout.use": True,
    "font.size": 11,
    "grid.alpha": 0.3,
    "legend.fontsize": 9.5,
    "lines.linewidth": 1.6,
    "savefig.dpi": 110,
    "svg.hashsalt": "rail corridor",
}


class FigureSpec(NamedTuple):
    """What draws a figure, and a sentence that says what to see in it."""

    draw: Callable[[Figure], None]
    caption: str
