"""Figures 2 to 6 of Choi, Lee and Lim (the bus cable of a train), and what a reflectogram tells."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from rail_corridor.plotting import COLOURS, FigureSpec
from rail_signals.arrays import FloatArray
from rail_signals.train_bus.bus_line import BusLine, CableSection, Termination
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.cable_constants import longest_stub_m, velocity_from_impedance
from rail_signals.train_bus.consist import Deviations
from rail_signals.train_bus.faults import (
    BadSplice,
    BusFault,
    LooseConnector,
    OpenCircuit,
    ShortCircuit,
    WaterIngress,
)
from rail_signals.train_bus.profile import load_bus_profile
from rail_signals.train_bus.study.campaign import Case
from rail_signals.train_bus.study.detection_limits import detectable_size
from rail_signals.train_bus.tdr.reflectometer import Reflectometer
from rail_signals.train_bus.tdr.response import TimeGrid, lead_in_s, reflected_wave
from rail_signals.train_bus.train import train_consist
from rail_signals.train_bus.transmitter import Transmitter

RISE_S: Final = 10e-9
IMPEDANCE_OHM: Final = 120.0
#: Velocity factors of polyethylene and of the document's example, 120 ohm and 65 pF/m.
FACTORS: Final = {"polyethylene, 0.66 c": 0.66, "the document's example, 0.428 c": 0.42765}
CARS: Final = ("CM2", "CM3", "CM4")
_BITS: Final = (1, 0, 0, 1, 1)
_SEED: Final = 53
_PLACES: Final = 4


def wave(
    bus_line: BusLine, duration_s: float, reference_ohm: float
) -> tuple[FloatArray, FloatArray]:
    """Time [s] and reflectogram of a step at the head of a line."""
    start_s = -lead_in_s(RISE_S)
    grid = TimeGrid(int((duration_s - start_s) / (RISE_S / 5)), RISE_S / 5, start_s)
    return grid.time_s, reflected_wave(bus_line, grid, reference_ohm, RISE_S)


def _plain_ticks(axes: Any, values: tuple[float, ...]) -> None:
    axes.set_yticks(values, [f"{value:g}" for value in values])
    axes.yaxis.set_minor_formatter(NullFormatter())


def _stub(figure: Figure) -> None:
    axes = figure.subplots()
    edge_s = np.logspace(-9, -6.5, 60)
    for (label, factor), dashes in zip(FACTORS.items(), ("--", "-"), strict=True):
        cable = Cable.from_impedance(IMPEDANCE_OHM, factor)
        axes.plot(1e9 * edge_s, longest_stub_m(edge_s, cable.velocity_m_per_s), dashes, label=label)
    example = velocity_from_impedance(IMPEDANCE_OHM, 65e-12)
    for here_s in (13e-9, 78e-9):
        stub_m = float(longest_stub_m(here_s, example))
        axes.plot(1e9 * here_s, stub_m, "o", color="black")
        text = f"{1e9 * here_s:.0f} ns: {1e3 * stub_m:.1f} mm"
        axes.annotate(text, (1e9 * here_s, stub_m), (10, -12), textcoords="offset points")
    axes.set(
        title="Longest stub: what an edge runs through in a tenth of its transition",
        xlabel="transition time [ns]",
        ylabel="length of the stub [m]",
        xscale="log",
        yscale="log",
    )
    axes.legend()


def _mismatches(figure: Figure) -> None:
    axes = figure.subplots()
    cable = Cable.from_impedance(IMPEDANCE_OHM, 0.66)
    loads = {"open: +1": np.inf, "240 Ω": 240.0, "120 Ω: nothing": 120.0, "60 Ω": 60.0}
    for index, (label, load_ohm) in enumerate({**loads, "short: −1": 0.0}.items()):
        bus_line = BusLine((CableSection(cable, 47.0),), Termination(load_ohm))
        time_s, reflected = wave(bus_line, 700e-9, IMPEDANCE_OHM)
        dashes = ("-", "--", "-", "-.", "-")[index]
        axes.plot(1e9 * time_s, reflected, dashes, color=COLOURS[index], label=label)
    axes.set(
        title="A step into 47 m of 120 Ω: too high an impedance sends it back up, too low down",
        xlabel="time [ns]",
        ylabel="reflected wave over incident",
    )
    axes.legend(title="at the end", loc="upper left")


def _loads(figure: Figure) -> None:
    axes = figure.subplots()
    sender = Transmitter()
    for name, label, dashes in (
        ("open", "open circuit: Rt", "-"),
        ("resistive", "resistive: 0.42 Rt", "--"),
        ("idle", "idle: 27 Ω and 1.3 nF", "-"),
    ):
        time_s, voltage_v = sender.output_wave(_BITS, name)
        axes.plot(1e6 * time_s, voltage_v, dashes, label=label)
    axes.plot([], [], " ", label=f"short: {1e3 * sender.short_circuit_a:.0f} mA")
    axes.axhline(3.0, color="black", ls=":", lw=1.0, label="3 V, least on heavy load (from memory)")
    axes.axhline(-3.0, color="black", ls=":", lw=1.0)
    axes.set(
        title=f"Manchester pulses at 1 Mbit/s of the bits {''.join(map(str, _BITS))} on test loads",
        xlabel="time [µs]",
        ylabel="output [V]",
        ylim=(-6.0, 8.5),
        xlim=(0.0, 6.0),
    )
    axes.legend(ncols=2, loc="upper right")


def echo_s(length_m: float, factor: float) -> float:
    """Time [s] at which the step from the open end of a cable comes back to half its height."""
    cable = Cable.from_impedance(IMPEDANCE_OHM, factor)
    time_s, reflected = wave(BusLine((CableSection(cable, length_m),)), 900e-9, IMPEDANCE_OHM)
    return float(np.interp(0.5, reflected, time_s))


def _cars(figure: Figure) -> None:
    rows: Any = figure.subplots(2, 1, sharex=True, sharey=True)
    for axes, (label, factor) in zip(rows, FACTORS.items(), strict=True):
        cable = Cable.from_impedance(IMPEDANCE_OHM, factor)
        for length_m, colour, dashes in ((27.0, COLOURS[1], "--"), (47.0, COLOURS[0], "-")):
            time_s, reflected = wave(
                BusLine((CableSection(cable, length_m),)), 900e-9, IMPEDANCE_OHM
            )
            when_ns = 1e9 * echo_s(length_m, factor)
            axes.plot(1e9 * time_s, reflected, dashes, color=colour, label=f"{length_m:.0f} m")
            axes.annotate(
                f"{when_ns:.1f} ns", (when_ns, 0.5), (6, 0), textcoords="offset points", va="center"
            )
        axes.set(ylabel="reflected", title=label)
        axes.legend(loc="upper left")
    rows[-1].set_xlabel("time [ns]")
    figure.suptitle("Echoes from the open ends of the cars of 47 m and 27 m", fontsize=12)


def _reflectograms(figure: Figure) -> None:
    figure.set_size_inches(8.0, 6.0)
    consist = train_consist(CARS)
    healthy, cable = consist.bus_line(), consist.runs[0].cable
    duration_s = 2.0 * 140.0 / cable.velocity_m_per_s
    time_s, sound = wave(healthy, duration_s, cable.impedance_ohm)
    place_m = 0.5 * time_s * cable.velocity_m_per_s
    above, below = figure.subplots(2, 1, sharex=True)
    above.plot(place_m, sound, color="black", label="healthy")
    gross: dict[str, BusFault] = {"cut at 80 m": OpenCircuit(80.0), "short": ShortCircuit(80.0)}
    for (label, fault), colour, dashes in zip(gross.items(), COLOURS, ("--", "-."), strict=False):
        _, reflected = wave(fault.apply(healthy), duration_s, cable.impedance_ohm)
        above.plot(place_m, reflected, dashes, color=colour, label=label)
    slight: dict[str, BusFault] = {
        "5 m wet at 20 m: 10 % more capacitance": WaterIngress(20.0, 5.0, 0.1),
        "splice of 5 Ω at 60 m": BadSplice(60.0, 5.0),
        "loose coupler at 94 m: 5 Ω": LooseConnector(1, 5.0),
    }
    for (label, fault), colour, dashes in zip(
        slight.items(), COLOURS, ("-", "--", "-."), strict=False
    ):
        _, reflected = wave(fault.apply(healthy), duration_s, cable.impedance_ohm)
        below.plot(place_m, 100.0 * (reflected - sound), dashes, color=colour, label=label)
    for axes in (above, below):
        for border_m in consist.starts_m[1:]:
            axes.axvline(border_m, color="black", ls=":", lw=0.8)
    above.set(
        title=f"Reflectograms of a train of {', '.join(CARS)}: couplers and end are dotted",
        ylabel="reflected over incident",
        ylim=(-1.1, 1.1),
    )
    below.set(
        ylabel="difference from healthy [%]",
        xlabel="distance from the head, half the way of the wave [m]",
        xlim=(-3.0, 140.0),
        ylim=(-4.0, 9.5),
    )
    above.legend(loc="upper left")
    below.legend(loc="upper left")


def _attenuation(figure: Figure) -> None:
    axes = figure.subplots()
    frequency_hz = np.logspace(4, 7.5, 120)
    for name, label, dashes in (
        ("wtb", "train bus, 120 Ω", "-"),
        ("CM2", "CM2, 105 Ω", "--"),
    ):
        cable = load_bus_profile(name).cable
        loss = 1e3 * cable.attenuation_db_per_m(frequency_hz)
        axes.plot(1e-6 * frequency_hz, loss, dashes, label=label)
    axes.plot([1.0, 2.0], [10.0, 14.0], "v", color="black", ms=8, label="most by IEC 61375")
    axes.set(
        title="Attenuation of bus cables: resistance first, then the skin effect",
        xlabel="frequency [MHz]",
        ylabel="attenuation [dB/km]",
        xscale="log",
        yscale="log",
    )
    _plain_ticks(axes, (2, 5, 10, 20, 50))
    axes.legend()


def _limits(figure: Figure) -> None:
    axes = figure.subplots()
    levels_db = (40.0, 50.0, 60.0, 70.0)
    for kind, label, dashes, places in (
        ("bad_splice", f"splice, median of {_PLACES} places", "o-", _PLACES),
        ("loose_connector", "a coupler", "s--", 1),
    ):
        sizes = [
            [smallest_ohm(kind, level, place) for place in range(places)] for level in levels_db
        ]
        axes.plot(levels_db, np.median(sizes, axis=1), dashes, label=label)
        axes.fill_between(levels_db, np.min(sizes, axis=1), np.max(sizes, axis=1), alpha=0.15)
    axes.set(
        title=f"Resistance that has an even chance to be found in a train of {', '.join(CARS)}",
        xlabel="signal to noise of one of four traces [dB]",
        ylabel="resistance [Ω]",
        yscale="log",
    )
    _plain_ticks(axes, (0.5, 1, 2, 5))
    axes.legend()


def smallest_ohm(kind: str, level_db: float, place: int) -> float:
    """Resistance that has an even chance to be found, by theory, at one of many drawn places."""
    consist = train_consist(CARS)
    instrument = Reflectometer.with_snr(level_db, consist.runs[0].cable.impedance_ohm)
    case = Case(kind, consist, Deviations.none(len(CARS)), instrument, None)
    return detectable_size(case, np.random.default_rng([_SEED, place]), 0.5)


FIGURES: Final[dict[str, FigureSpec]] = {
    "train_bus_fig02_stub": FigureSpec(
        _stub,
        "Fig 2 and equation 22: the longest stub over the transition time. 13 ns allow 166.7 mm; "
        "the 1 m that is usual needs 78 ns.",
    ),
    "train_bus_fig03_mismatches": FigureSpec(
        _mismatches,
        "Fig 3: what a wrong impedance at the end of the cable sends back: up if it is too high, "
        "down if it is too low, nothing if it fits.",
    ),
    "train_bus_fig05_pulses": FigureSpec(
        _loads,
        "Figs 4 and 5: pulses of a good transmitter on the test loads. On the heavy load it has "
        "to keep 3 V; on the idle load a capacitor rounds the pulse.",
    ),
    "train_bus_fig06_echoes": FigureSpec(
        _cars,
        "Fig 6: steps from the open ends of 47 m and 27 m of cable: 475.1 and 272.9 ns in "
        "polyethylene, 733.2 and 421.2 ns in the cable of the document's example.",
    ),
    "train_bus_reflectograms": FigureSpec(
        _reflectograms,
        "Reflectograms of a healthy and of faulty trains. A cut and a short are seen at once; "
        "slight faults stand out where the trace of the healthy train is taken off.",
    ),
    "train_bus_attenuation": FigureSpec(
        _attenuation,
        "Attenuation over frequency of two cable profiles, with the most that IEC 61375 allows.",
    ),
    "train_bus_limits": FigureSpec(
        _limits,
        "Limits of detection: resistances that have an even chance to be found, median and range "
        "over places. The document's 15 dB would let 970 Ω pass.",
    ),
}
