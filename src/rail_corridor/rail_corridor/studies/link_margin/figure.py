"""The figure of the link-margin sweep: headway and spurious brakings against link SNR."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from rail_corridor.equipment.train_radio.section import CBTC
from rail_corridor.loading.schema import parse_scenario
from rail_corridor.plotting import COLOURS, STYLE

from .theory import brakings_per_hour, line_es_n0_db

if TYPE_CHECKING:
    from .points import LinkMarginRow

_LABELS = {
    "siso": ("SISO", "o"),
    "mrc": ("MRC 1×2", "s"),
    "alamouti_2x1": ("Alamouti 2×1", "^"),
    "alamouti_2x2": ("Alamouti 2×2", "D"),
}
_LEVELS_DB = np.arange(4.0, 34.1, 0.5)
_RATES = (1e-4, 1500.0)


def draw_link_margin(rows: Sequence[LinkMarginRow], path: Path) -> None:
    """Draw measured points and the curves of theory into a file."""
    style_of_figures: Any = STYLE
    with mpl.rc_context(style_of_figures):
        figure = Figure(figsize=(12.0, 5.2))
        left, right = figure.subplots(1, 2)
        for (scheme, (label, marker)), colour in zip(_LABELS.items(), COLOURS, strict=False):
            mine = [row for row in rows if row.scheme == scheme]
            style = {"color": colour, "marker": marker, "label": label}
            _headway(left, mine, style)
            _brakings(right, scheme, mine, style)
        left.set(
            title="Headway on the weak stretch",
            xlabel="median Es/N0 per receive antenna [dB]",
            ylabel="mean time from train to train [s]",
        )
        left.legend(title="open: a train had not passed when the run ended", title_fontsize=9)
        right.set(
            title="Spurious brakings",
            xlabel="median Es/N0 per receive antenna [dB]",
            ylabel="per hour of a train in the stretch",
            yscale="log",
            ylim=_RATES,
        )
        right.text(
            0.98,
            0.97,
            "points: waveform runs, 95 % interval\n(arrow: none seen, upper limit)\ncurves: theory",
            transform=right.transAxes,
            ha="right",
            va="top",
            fontsize=9,
        )
        figure.savefig(path, metadata={"Software": None})


def _headway(axes: Any, rows: Sequence[LinkMarginRow], style: dict[str, Any]) -> None:
    """Draw mean headways; open markers where some train did not pass within the run."""
    known = [(row.es_n0_db, row.headway_s, row.unpassed) for row in rows if row.headway_s]
    axes.plot([x for x, _, _ in known], [y for _, y, _ in known], **style)
    late = [(x, y) for x, y, unpassed in known if unpassed]
    axes.plot(
        [x for x, _ in late],
        [y for _, y in late],
        linestyle="none",
        marker=style["marker"],
        color=style["color"],
        markerfacecolor="white",
    )


def _brakings(axes: Any, scheme: str, rows: Sequence[LinkMarginRow], style: dict[str, Any]) -> None:
    """Draw rates with their Poisson intervals, and the curve of theory."""
    from .points import TICK_S, Point, rate_interval, scenario_data

    levels_db, rates = rate_curve(scenario_data(Point(scheme, 30.0)), TICK_S)
    axes.plot(levels_db, rates, color=style["color"])
    for row in rows:
        if row.train_hours <= 0.0:
            continue
        low, high = rate_interval(row.brakings, row.train_hours)
        rate = row.brakings / row.train_hours
        if row.brakings:
            bars = [[rate - low], [high - rate]]
            axes.errorbar(
                row.es_n0_db,
                rate,
                bars,
                color=style["color"],
                marker=style["marker"],
                capsize=2.5,
                linewidth=1.0,
            )
        else:
            axes.plot(row.es_n0_db, high, color=style["color"], marker="v", fillstyle="none")


def rate_curve(data: dict[str, Any], tick_s: float) -> tuple[Any, Any]:
    """Median Es/N0 [dB] and brakings per hour that theory gives on the line of a scenario."""
    from rail_corridor.equipment.train_radio.nodes import burst_format

    from .points import STRETCH_FROM

    scenario = parse_scenario(data)
    plan = CBTC.of(scenario)
    assert plan is not None
    line_db = line_es_n0_db(scenario, STRETCH_FROM)
    line_db = line_db - np.median(line_db)
    losses = int(plan.timeout_s / tick_s + 1e-9)
    rates = [
        brakings_per_hour(plan.scheme, line_db + level, burst_format(plan), losses, tick_s)
        for level in _LEVELS_DB
    ]
    return _LEVELS_DB, np.array(rates)
