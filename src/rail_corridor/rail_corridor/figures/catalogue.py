"""Figures of the source documents and of the project's own results, drawn from its code."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from rail_corridor.plotting import STYLE, FigureSpec

from . import doppler as doppler_figures
from . import ranging as ranging_figures
from . import track_code as track_code_figures
from . import train_bus as train_bus_figures
from . import train_radio as train_radio_figures

#: Name of a figure -> what draws it, and what to see.
FIGURES: dict[str, FigureSpec] = {
    **ranging_figures.FIGURES,
    **doppler_figures.FIGURES,
    **train_bus_figures.FIGURES,
    **track_code_figures.FIGURES,
    **train_radio_figures.FIGURES,
}

#: What takes longer than a figure may, and how to get it.
ELSEWHERE = {
    "headway over the margin of the train radio": "rail study link_margin",
    "limits of detection on the bus": "rail study train_bus_limits",
    "bound of Doppler positions along a line of your own": "rail accuracy SCENARIO",
}


def draw(directory: Path, specs: Mapping[str, FigureSpec]) -> Iterator[Path]:
    """Draw figures into a directory; yield the file of each.

    Parameters
    ----------
    directory : Path
        Made if it is not there.
    specs : mapping of str to FigureSpec
        By name, as `FIGURES`.
    """
    directory.mkdir(parents=True, exist_ok=True)
    for name, spec in specs.items():
        with mpl.rc_context(STYLE):
            figure = Figure()
            spec.draw(figure)
            path = directory / f"{name}.png"
            figure.savefig(path, metadata={"Software": None})
        yield path


def write_index(directory: Path, specs: Mapping[str, FigureSpec]) -> Path:
    """Write a page of all figures with their captions; returns its file."""
    parts = [
        f'<figure id="{name}">\n<img src="{name}.png" alt="{name}">\n'
        f"<figcaption><b>{name}</b>: {html.escape(spec.caption)}</figcaption>\n</figure>"
        for name, spec in specs.items()
    ]
    path = directory / "index.html"
    path.write_text(_PAGE.format(figures="\n".join(parts)), encoding="utf-8")
    return path


_PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>Rail corridor: figures</title>
<style>
body {{ font: 16px/1.5 sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }}
figure {{ margin: 0 0 3rem; }}
img {{ max-width: 100%; }}
</style>
<h1>Rail corridor: figures</h1>
{figures}
</html>
"""
