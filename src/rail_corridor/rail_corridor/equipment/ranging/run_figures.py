"""Phase ranging in the figures of a run: errors of the positions, and changes of channel."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import ClassVar, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from rail_corridor.equipment.run_figures import ErrorPanel, FigureData, RunFigure, RunFigures
from rail_corridor.plotting import COLOURS
from rail_msgs_py.topics.ranging import VRS_CHANNEL

from .layout import Zone, layout_of
from .report import position_errors

#: Of the channel pairs 1/2, 3/4, 5/6 and 7/8.
_PAIR_COLOURS: Final = (COLOURS[0], COLOURS[1], COLOURS[2], COLOURS[3])


class RangingFigures(RunFigures):
    """What phase ranging adds."""

    figures: ClassVar[Mapping[str, RunFigure]] = {
        "run_handovers": RunFigure(
            lambda figure, run: _handovers(figure, run),
            "Channel that the transponder received on (black) over the channels of the zones "
            "(coloured): it has to change where a zone ends.",
            lambda run: VRS_CHANNEL in run.data,
        ),
    }

    def error_panel(self, run: FigureData, train: int) -> ErrorPanel:
        """Positions by ranges against the bound of the links."""
        errors = position_errors(run.scenario, run.data, train)
        bounded = np.isfinite(errors.bound_m2) & errors.usable
        return ErrorPanel(
            "by ranges,\ntold by wayside",
            errors.path_m,
            np.where(errors.usable, errors.error_m, np.nan),
            "Cramér-Rao bound",
            np.sqrt(np.where(bounded, errors.bound_m2, np.nan)),
        )


def pair_colour(zone: Zone) -> str:
    """Colour of the channel pair of a zone."""
    return _PAIR_COLOURS[(zone.downlink_channel - 1) // 2 % len(_PAIR_COLOURS)]


def _handovers(figure: Figure, run: FigureData) -> None:
    figure.set_size_inches(9.5, 4.5)
    train = run.furthest
    axes = figure.subplots()
    path_m = run.state(train, "path_m")
    low_m, high_m = float(np.nanmin(path_m)), float(np.nanmax(path_m))
    for zone, start_m, end_m in _zones(run, train):
        if min(end_m, high_m) <= max(start_m, low_m):
            continue
        span_m = max(start_m, low_m), min(end_m, high_m)
        axes.axvspan(*span_m, color=pair_colour(zone), alpha=0.18, lw=0)
        channels = [zone.downlink_channel] * 2
        axes.plot([start_m, end_m], channels, color=pair_colour(zone), lw=7.0)
        if start_m > low_m:
            axes.axvline(start_m, color="black", ls=":", lw=0.9)
            axes.annotate(
                zone.station.upper(),
                (start_m, 1.0),
                (0, 3),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                ha="center",
                fontsize=9,
            )
    channel = run.data[VRS_CHANNEL].upto(run.data.ticks)[:, train, 0]
    tuned = np.where(channel > 0.0, channel, np.nan)
    axes.plot(path_m, tuned, color="black", lw=1.6, drawstyle="steps-post")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    top = float(np.nanmax(tuned)) if np.isfinite(tuned).any() else 1.0
    axes.set(
        xlabel="way along the route [m]",
        ylabel="channel received",
        xlim=(low_m, high_m),
        ylim=(0.5, top + 0.8),
    )
    axes.grid(visible=False)
    axes.set_title(
        f"{run.scenario.name}: channel of {run.data.trains[train]} (black), channels of the zones",
        pad=20,
    )


def _zones(run: FigureData, train: int) -> Iterator[tuple[Zone, float, float]]:
    """Zones on the path of a train, where they start and end on it [m]."""
    route = run.scenario.trains[train]
    path = run.scenario.network.route(list(route.route), route.direction)
    starts_m = {leg.track.name: leg.path_start_m for leg in path.legs}
    for zone in layout_of(run.scenario).zones:
        if zone.track in starts_m:
            track_m = starts_m[zone.track]
            yield zone, track_m + zone.start_m, track_m + zone.end_m
