"""The accuracy that geometry allows: the bound of Doppler positions along a line, as a figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from rail_corridor.equipment.doppler.reference_coverage import ReferencedTrack
from rail_corridor.equipment.doppler.section import REFERENCES
from rail_corridor.errors import InputError
from rail_corridor.plotting import COLOURS, STYLE
from rail_corridor.scenario.model import Scenario
from rail_signals.arrays import FloatArray

#: Worse than this is drawn at the upper edge [m].
_WORST_M = 100.0
_LEAST_M = 1e-3
_GOOD_M = (1.0, 10.0)


@dataclass(frozen=True)
class Accuracy:
    """Bounds along one track.

    ``bound_m`` [speed, chainage] of a single block, without knowledge of the receiver's offset
    but that it is within the plan's; infinite where there is none.
    """

    track: str
    chainage_m: FloatArray
    speeds_kmh: tuple[float, ...]
    bound_m: FloatArray
    feet_m: FloatArray
    sides: FloatArray


def accuracy_of(scenario: Scenario, track: str, speeds_kmh: Sequence[float]) -> Accuracy:
    """Bounds along a track of a scenario, with its reference stations."""
    here = ReferencedTrack.of(scenario, track)
    s = here.line.chainage_m
    bounds = [here.bound_m(s, speed / 3.6) for speed in speeds_kmh]
    feet = np.array([station.chainage_m for station in here.stations])
    foot = scenario.network.tracks[track].pose(feet)
    left = -np.sin(foot.heading_rad) * (here.places_m[:, 0] - foot.x_m)
    left += np.cos(foot.heading_rad) * (here.places_m[:, 1] - foot.y_m)
    return Accuracy(track, s, tuple(speeds_kmh), np.array(bounds), feet, np.sign(left))


def run_accuracy(
    scenario: Scenario, speeds_kmh: Sequence[float], path: Path, console: Console
) -> None:
    """Draw the bound along every track, and show a table of it.

    Raises
    ------
    InputError
        If the scenario has no reference stations.
    """
    if REFERENCES.of(scenario) is None:
        raise InputError("has no reference stations", field="references", value=None)
    bounds = [accuracy_of(scenario, track, speeds_kmh) for track in scenario.tracks]
    table = Table(
        title="what geometry allows: bound of a Doppler position, one block",
        title_justify="left",
        title_style="bold",
    )
    for heading in ("track", "km", "stations", "km/h", "median m", "95 % m", "< 1 m", "< 10 m"):
        left = heading == "track"
        table.add_column(heading, justify="left" if left else "right", no_wrap=True)
    for line in bounds:
        for speed, bound in zip(line.speeds_kmh, line.bound_m, strict=True):
            shares = [f"{100.0 * np.mean(bound < good):.0f} %" for good in _GOOD_M]
            quantiles = np.quantile(bound, (0.5, 0.95), method="higher")
            table.add_row(
                line.track,
                f"{line.chainage_m[-1] / 1000.0:.2f}",
                str(line.feet_m.size),
                f"{speed:g}",
                *("none" if np.isinf(q) else f"{q:.2f}" for q in quantiles),
                *shares,
            )
    console.print(table)
    draw_accuracy(bounds, path)
    console.print(f"figure written to {path}", soft_wrap=True)


def draw_accuracy(lines: Sequence[Accuracy], path: Path) -> None:
    """Draw the bounds of all tracks, one below the other."""
    style: Any = STYLE
    with mpl.rc_context(style):
        figure = Figure(figsize=(12.0, 3.6 * len(lines) + 0.6), layout="constrained")
        for axes, line in zip(np.atleast_1d(figure.subplots(len(lines), 1)), lines, strict=True):
            draw_line(axes, line)
        figure.savefig(path)


def draw_line(axes: Any, line: Accuracy) -> None:
    """Draw the bounds of one track."""
    km = line.chainage_m / 1000.0
    for speed, bound, colour in zip(line.speeds_kmh, line.bound_m, COLOURS, strict=False):
        shown = np.clip(bound, _LEAST_M, _WORST_M)
        axes.plot(km, shown, color=colour, lw=1.0, label=f"{speed:g} km/h")
    for side, marker in ((1.0, "^"), (-1.0, "v")):
        here = line.feet_m[line.sides == side] / 1000.0
        label = f"station to the {'left' if side > 0 else 'right'}"
        axes.plot(here, np.full(here.size, _WORST_M), marker, color="black", ms=5, label=label)
    axes.set(
        title=f"{line.track}: least standard deviation of a position from one block",
        xlabel="chainage [km]",
        ylabel="bound [m]",
        yscale="log",
        xlim=(km[0], km[-1]),
        ylim=(max(_LEAST_M, 0.5 * float(line.bound_m.min())), 1.5 * _WORST_M),
    )
    axes.grid(visible=True, which="major", alpha=0.4)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=9)
