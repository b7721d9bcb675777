"""The position functions of KR 10-1835432 (Doppler shifts), and what geometry allows."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from rail_corridor.loading.loader import load_scenario
from rail_corridor.plotting import COLOURS, FigureSpec
from rail_corridor.studies.accuracy import accuracy_of, draw_line
from rail_signals.arrays import FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.doppler.patent_functions import CircularSection, MixedSection, StraightSection

CARRIER_HZ: Final = 2.6e9
SPEED_MPS: Final = 300.0 / 3.6
#: Shift straight ahead of a station: 722.7 Hz.
AHEAD_HZ: Final = SPEED_MPS * CARRIER_HZ / SPEED_OF_LIGHT_M_PER_S

STRAIGHT: Final = StraightSection(500.0, (50.0, 50.0), -700.0, 700.0)
ARC: Final = CircularSection(
    600.0, ((620.0 * cos(-0.6), 620.0 * sin(-0.6)), (575.0 * cos(0.7), 575.0 * sin(0.7))), -0.9, 0.9
)
#: A straight of 600 m, then an arc to the left of 600 m; stations 200 m to either side of the end.
MIXED: Final = MixedSection(
    StraightSection(200.0, (40.0, -20.0), -600.0, 0.0),
    CircularSection(600.0, ((-200.0, -560.0), (200.0, -620.0)), -pi / 2, -pi / 2 + 0.8),
)


def shifts_hz(section: StraightSection | CircularSection, place: float) -> tuple[float, float]:
    """Shifts of both stations for a train at 300 km/h."""
    one, two = section.cosines(place)
    return AHEAD_HZ * float(one), AHEAD_HZ * float(two)


def _root(values: FloatArray) -> FloatArray:
    """Square root of a position function [Hz], not below a hundredth: what a log axis shows."""
    return np.maximum(np.sqrt(values), 1e-2)


def _straight(figure: Figure) -> None:
    axes = figure.subplots()
    x = np.linspace(STRAIGHT.from_m, STRAIGHT.to_m, 1401)
    both = shifts_hz(STRAIGHT, 200.0)
    offset = (both[0] + 260.0, both[1] + 260.0)
    axes.plot(x, _root(STRAIGHT.function(x, both)), label="shifts as they are")
    label = "receiver off by 0.1 ppm (260 Hz), not taken off"
    axes.plot(x, _root(STRAIGHT.function(x, offset)), "--", label=label)
    axes.axvline(200.0, color="black", ls=":", label="train at 200 m")
    axes.plot([-500.0, 500.0], [2e-2] * 2, "^", color="black", ms=9, label="stations, 50 m aside")
    axes.set(
        title="Position function on a straight: least where the train is, if the offset is known",
        xlabel="x along the track [m]",
        ylabel="square root of f(x) [Hz]",
        yscale="log",
        ylim=(1e-2, 3e4),
    )
    axes.legend(loc="upper center", ncols=2)


def _arc(figure: Figure) -> None:
    axes = figure.subplots()
    theta = np.linspace(ARC.from_rad, ARC.to_rad, 1401)
    for degrees, dashes in ((-15.0, "-"), (37.2, "--")):
        values = ARC.function(theta, shifts_hz(ARC, float(np.radians(degrees))))
        (line,) = axes.plot(
            np.degrees(theta), _root(values), dashes, label=f"train at {degrees:g}°"
        )
        axes.axvline(degrees, color=line.get_color(), ls=":", lw=1.2)
    stations = [float(np.degrees(np.arctan2(y, x))) for x, y in ARC.stations_m]
    axes.plot(stations, [2e-2] * 2, "^", color="black", ms=9, label="stations")
    axes.set(
        title="Position function on an arc of 600 m: a second zero may fit as well as the true one",
        xlabel="θ at the centre of the arc [°]",
        ylabel="square root of f(θ) [Hz]",
        yscale="log",
        ylim=(1e-2, 1e4),
    )
    axes.legend(loc="upper center", ncols=3)


def _mixed(figure: Figure) -> None:
    axes = figure.subplots()
    straight, arc = MIXED.straight, MIXED.arc
    x = np.linspace(straight.from_m, 0.0, 701)
    theta = np.linspace(arc.from_rad, arc.to_rad, 701)
    along = 600.0 * (theta - arc.from_rad)
    for colour, dashes, section, place in (
        (COLOURS[0], "-", straight, -350.0),
        (COLOURS[1], "--", arc, arc.from_rad + 0.5),
    ):
        both = shifts_hz(section, place)
        chosen = MIXED.position(both, 1.01 * AHEAD_HZ)
        assert chosen is not None
        estimated_m = chosen[1] if chosen[0] == "straight" else 600.0 * (chosen[1] - arc.from_rad)
        label = f"train at {estimated_m:.0f} m: {chosen[0]} chosen"
        axes.plot(x, _root(straight.function(x, both)), dashes, color=colour, label=label)
        axes.plot(along, _root(arc.function(theta, both)), dashes, color=colour)
        axes.plot(estimated_m, 1.5e-2, "o", color=colour, ms=8)
    axes.axvline(0.0, color="black", lw=0.8)
    axes.text(-10.0, 3e3, "straight  ", ha="right")
    axes.text(10.0, 3e3, "  arc of 600 m", ha="left")
    axes.set(
        title="A straight and the arc behind it: both functions, and the answer that is chosen",
        xlabel="way along the track from the joint [m]",
        ylabel="square root of f [Hz]",
        yscale="log",
        ylim=(1e-2, 1e4),
    )
    axes.legend(loc="lower center")


def _bound(figure: Figure) -> None:
    figure.set_size_inches(9.5, 4.5)
    draw_line(
        figure.subplots(), accuracy_of(load_scenario("sensors"), "main", (30.0, 120.0, 300.0))
    )


FIGURES: Final[dict[str, FigureSpec]] = {
    "doppler_straight": FigureSpec(
        _straight,
        "Claims 4 and 11: the position function of two stations on a straight. Its zero is where "
        "the train is; an offset of 0.1 ppm that nobody takes off moves it by hundreds of metres.",
    ),
    "doppler_arc": FigureSpec(
        _arc,
        "Claims 5 and 12: the same on an arc, for two places of the train. For the second there "
        "are two zeros: two stations leave it open, which the positioner calls ambiguous.",
    ),
    "doppler_mixed": FigureSpec(
        _mixed,
        "Claims 6 and 13: a straight with an arc behind it. Dots: the place chosen, once on the "
        "straight and once on the arc.",
    ),
    "doppler_bound_along_line": FigureSpec(
        _bound,
        "Least standard deviation of a position from one block along the line of the scenario "
        "'sensors' at three speeds. It is best where a train passes a station, since the shift "
        "changes there, and worst midway; it is better the faster the train runs.",
    ),
}
