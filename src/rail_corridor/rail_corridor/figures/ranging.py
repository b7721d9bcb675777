"""Figures 3 to 8 of Jeong et al. (position by phase difference), and the receiver's own."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from rail_corridor.equipment.ranging.layout import Zone, layout_of
from rail_corridor.equipment.ranging.run_figures import pair_colour
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plotting import COLOURS, FigureSpec
from rail_corridor.scenario.model import Scenario
from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.ranging.bounds import two_way_range_variance_bound
from rail_signals.ranging.comparators import (
    and_comparator,
    and_pulse_width_s,
    quadrature_comparator,
)
from rail_signals.ranging.phase_range import (
    phase_to_range_m,
    range_per_radian_m,
    range_to_phase_rad,
)
from rail_signals.ranging.receiver import FmToneReceiver
from rail_signals.ranging.signal import RangingSignal, discriminate, modulate, tone_of
from rail_signals.ranging.transponder import reply_lag_rad

TONE_HZ: Final = 375e3
_RATE_HZ: Final = 75e6  # 200 samples in a period
_DELAY_S: Final = 1e-6  # of the transponder: 135 degrees, 150 m
_DISTANCE_M: Final = 123.0
_SEED: Final = 41


def tones(lag_deg: float, periods: int = 2) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time [s], reference and a tone that lags (Figs 4 to 6)."""
    time_s = np.arange(periods * 200) / _RATE_HZ
    turn = 2 * np.pi * TONE_HZ * time_s
    return time_s, np.sin(turn), np.sin(turn - np.radians(lag_deg))


def range_errors(
    snr: float, bursts: int, rng: np.random.Generator, signal: RangingSignal
) -> tuple[FloatArray, FloatArray]:
    """Errors [bursts] [m] of two-way ranges, by spectral lines and by discriminators.

    Both ends of the link receive in noise of the same ratio; the transponder answers with the
    phase it understood, a microsecond later, which the station takes off.
    """
    receiver = FmToneReceiver(signal)

    def lines(waves: ComplexArray) -> FloatArray:
        return np.asarray(receiver.estimate(waves).phase_lag_rad)

    def discriminator(waves: ComplexArray) -> FloatArray:
        return tone_of(signal, discriminate(signal, waves))[..., None]

    one_way = range_to_phase_rad(0.5 * _DISTANCE_M, TONE_HZ)
    errors = []
    for receive in (lines, discriminator):
        down = receive(_noisy(modulate(signal, np.full((bursts, 1), one_way)), snr, rng))
        reply = np.nan_to_num(reply_lag_rad(down, signal, _DELAY_S)) + one_way
        up = receive(_noisy(modulate(signal, reply), snr, rng))[:, 0]
        estimated_m = phase_to_range_m(up, TONE_HZ, delay_s=_DELAY_S)
        errors.append(estimated_m - _DISTANCE_M)
    return errors[0], errors[1]


def _noisy(waves: ComplexArray, snr: float, rng: np.random.Generator) -> ComplexArray:
    noise = rng.standard_normal((*waves.shape, 2)).view(np.complex128)[..., 0]
    return np.asarray(waves + noise * np.sqrt(0.5 / snr))


def _moving_wave(figure: Figure) -> None:
    axes = figure.subplots()
    place_m = np.linspace(0.0, 1600.0, 801)
    wave_number = 2 * np.pi * TONE_HZ / SPEED_OF_LIGHT_M_PER_S
    for eighth, dashes in enumerate(("-", "--", "-.", ":")):
        time_s = eighth / 8.0 / TONE_HZ
        moved = place_m - SPEED_OF_LIGHT_M_PER_S * time_s
        label = f"t = {1e6 * time_s:.2f} µs"
        axes.plot(place_m, np.sin(wave_number * moved), dashes, label=label)
    axes.set(
        title="A tone of 375 kHz in space: in an eighth of a period it moves by 100 m",
        xlabel="distance from the station [m]",
        ylabel="amplitude",
        ylim=(-1.1, 1.45),
    )
    axes.legend(ncols=4, loc="upper center")


def _fig4(figure: Figure) -> None:
    axes = figure.subplots()
    time_s, reference, lagging = tones(45.0)
    _, _, leading = tones(315.0)
    axes.plot(1e6 * time_s, reference, color="black", label="reference")
    axes.plot(1e6 * time_s, lagging, "--", color=COLOURS[0], label="45° behind: train at 50 m")
    axes.plot(1e6 * time_s, leading, "-.", color=COLOURS[1], label="315° behind: train at 350 m")
    axes.set(
        title="What comes back from a train, beside the reference of 375 kHz",
        xlabel="time [µs]",
        ylabel="amplitude",
        ylim=(-1.1, 1.5),
    )
    axes.legend(ncols=3, loc="upper center")


def _gate(figure: Figure, lag_deg: float) -> None:
    time_s, reference, received = tones(lag_deg)
    width_s = float(and_pulse_width_s(reference, received, _RATE_HZ))
    high = {
        "reference": reference > 0,
        f"{lag_deg:.0f}° behind": received > 0,
        "AND": (reference > 0) & (received > 0),
    }
    rows: Any = figure.subplots(3, 1, sharex=True)
    for axes, (label, wave), colour in zip(
        rows, high.items(), ("black", COLOURS[0], COLOURS[1]), strict=True
    ):
        axes.fill_between(1e6 * time_s, wave, step="post", color=colour, alpha=0.25)
        axes.plot(1e6 * time_s, wave, color=colour, drawstyle="steps-post", label=label)
        axes.set(ylabel=label, ylim=(-0.1, 1.25), yticks=(0, 1))
    begins = 1e6 * time_s[np.flatnonzero(np.diff(high["AND"].astype(int)) == 1)[-1] + 1]
    rows[-1].annotate(
        f"{1e6 * width_s:.3f} µs",
        (begins + 0.5e6 * width_s, 0.5),
        ha="center",
        va="center",
        fontweight="bold",
    )
    rows[0].set_title(
        f"{lag_deg:.0f}° behind: both are high for T/2 − T/8 = {1e6 * width_s:.3f} µs a period, "
        "read as 50 m"
    )
    rows[-1].set_xlabel("time [µs]")


def comparator_ranges(range_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Ranges [m] that the AND gate and the quadrature comparator tell for true ones."""
    time_s = np.arange(200) / _RATE_HZ
    turn = 2 * np.pi * TONE_HZ * time_s
    received = np.sin(turn - range_to_phase_rad(range_m, TONE_HZ)[:, None])
    reference = np.broadcast_to(np.sin(turn), received.shape)
    per_radian_m = range_per_radian_m(TONE_HZ)
    gate = and_comparator(reference, received, _RATE_HZ, TONE_HZ)
    full = quadrature_comparator(reference, received, _RATE_HZ, TONE_HZ)
    return per_radian_m * gate, per_radian_m * full


def _comparators(figure: Figure) -> None:
    true_m = np.linspace(1.0, 599.0, 300)
    gate_m, full_m = comparator_ranges(true_m)
    axes = figure.subplots()
    axes.plot(true_m, gate_m, color=COLOURS[1], label="AND gate: unambiguous to 199.86 m")
    jumps = np.insert(full_m, np.flatnonzero(np.diff(full_m) < 0) + 1, np.nan)
    places = np.insert(true_m, np.flatnonzero(np.diff(full_m) < 0) + 1, np.nan)
    axes.plot(places, jumps, "--", color=COLOURS[0], label="quadrature (I/Q): to 399.72 m")
    axes.set(
        title="An AND gate cannot tell 50 m from 350 m; a quadrature comparator can",
        xlabel="true distance [m]",
        ylabel="measured distance [m]",
        ylim=(0.0, 480.0),
    )
    axes.legend(loc="upper left")


def _pair(zone: Zone) -> str:
    return f"CH{zone.downlink_channel}/{zone.uplink_channel}"


def _fig7(figure: Figure) -> None:
    layout = layout_of(load_scenario("plain_line"))
    axes = figure.subplots()
    for zone in layout.zones:
        span, colour = (zone.start_m, zone.end_m), pair_colour(zone)
        axes.broken_barh([(span[0], zone.length_m)], (0.0, 0.5), facecolor=colour, alpha=0.35)
        middle = 0.5 * sum(span)
        axes.text(middle, 0.25, zone.name, ha="center", va="center")
        axes.plot(span, [1.0 + 0.45 * (zone.downlink_channel > 2)] * 2, color=colour, lw=4.0)
        axes.text(middle, 1.07 + 0.45 * (zone.downlink_channel > 2), _pair(zone), ha="center")
        station = layout.station(zone.station)
        axes.plot(station.at_m, 0.62, "v", color="black", ms=8)
        axes.text(station.at_m, 0.7, station.name.upper(), ha="center", fontsize=10)
        axes.axvline(station.at_m, color="black", ls=":", lw=0.8)
    axes.set(
        title="Zones without a branch: the train changes its channels where it passes a station",
        xlabel="chainage [m]",
        ylim=(-0.1, 1.8),
        yticks=(0.25, 1.2),
        yticklabels=("zones", "channels\nof the train"),
    )
    axes.grid(visible=False)


def _fig8(figure: Figure) -> None:
    figure.set_size_inches(9.5, 4.6)
    axes = figure.subplots()
    scenario = load_scenario("branch")
    layout = layout_of(scenario)
    for zone in layout.zones:
        pose = scenario.network.tracks[zone.track].pose(np.linspace(zone.start_m, zone.end_m, 60))
        axes.plot(pose.x_m, pose.y_m, color=pair_colour(zone), lw=6.0, solid_capstyle="butt")
        on_main = zone.track == "main"
        _label(
            axes,
            f"{zone.name}\n{_pair(zone)}",
            (float(pose.x_m[30]), float(pose.y_m[30])),
            (0.0, 12.0) if on_main else (-30.0, -26.0),
        )
    for station in layout.stations:
        x_m, y_m, _ = station.position_m
        axes.plot(x_m, y_m, "o", color="black", ms=5, zorder=3)
        on_main = station.track == "main"
        weight = "bold" if len(station.zones) > 1 else "normal"
        aside = (0.0, -18.0) if on_main else (26.0, 4.0)
        _label(axes, station.name.upper(), (x_m, y_m), aside, weight)
    _antennas(axes, scenario)
    axes.set(
        title="A branch at WRS5, whose two antennas watch zones 5 and 7 at once",
        xlabel="x [m]",
        ylabel="y [m]",
        ylim=(-260.0, 45.0),
    )
    axes.grid(visible=False)


def _label(
    axes: Any,
    text: str,
    at: tuple[float, float],
    aside: tuple[float, float],
    weight: str = "normal",
) -> None:
    axes.annotate(
        text, at, aside, textcoords="offset points", ha="center", fontsize=9.5, fontweight=weight
    )


def _antennas(axes: Any, scenario: Scenario) -> None:
    layout = layout_of(scenario)
    for station in layout.stations:
        for name in station.zones if len(station.zones) > 1 else ():
            x_m, y_m, _ = station.position_m
            ahead_x, ahead_y, _ = layout.zone(name).boresight
            tip = (x_m + 110.0 * ahead_x, y_m + 110.0 * ahead_y)
            arrow = {"arrowstyle": "-|>", "color": "black", "lw": 1.6}
            axes.annotate("", tip, (x_m, y_m), arrowprops=arrow, zorder=4)


def _range_error(figure: Figure) -> None:
    signal = RangingSignal()
    rng = np.random.default_rng(_SEED)
    levels_db = np.arange(-16.0, 41.0, 4.0)
    errors = [range_errors(10.0 ** (level / 10.0), 400, rng, signal) for level in levels_db]
    rms = np.sqrt(np.nanmean(np.square(errors), axis=2)).T
    snr = 10.0 ** (levels_db / 10.0)
    bound = two_way_range_variance_bound(snr, snr, signal.samples, signal.indices[0], TONE_HZ)
    axes = figure.subplots()
    axes.plot(levels_db, np.sqrt(bound), color="black", label="Cramér-Rao bound")
    axes.plot(levels_db, rms[0], "o", color=COLOURS[0], label="spectral lines (this project)")
    axes.plot(levels_db, rms[1], "^", color=COLOURS[1], label="discriminator (the paper)")
    axes.set(
        title="Error of a two-way range from one burst of 0.24 ms, 400 bursts a point",
        xlabel="carrier-to-noise ratio per sample, both ways [dB]",
        ylabel="RMS error [m]",
        yscale="log",
    )
    axes.legend()


FIGURES: Final[dict[str, FigureSpec]] = {
    "ranging_fig03_moving_wave": FigureSpec(
        _moving_wave,
        "Fig 3: the tone of 375 kHz at four moments. Its shape moves on with the speed of light, "
        "so that a phase is a distance: one wavelength is 800 m.",
    ),
    "ranging_fig04_phase_lags": FigureSpec(
        _fig4,
        "Fig 4: the reference and tones that come back 45° and 315° behind it. The second is as "
        "far ahead as the first is behind.",
    ),
    "ranging_fig05_and_45": FigureSpec(
        lambda figure: _gate(figure, 45.0),
        "Fig 5: reference AND tone, 45° behind: a pulse of 1.000 µs (the document prints 1.04).",
    ),
    "ranging_fig06_and_315": FigureSpec(
        lambda figure: _gate(figure, 315.0),
        "Fig 6: the same, 315° behind: again 1.000 µs. An AND gate cannot tell it from 45°.",
    ),
    "ranging_comparators": FigureSpec(
        _comparators,
        "What two comparators tell of distances up to 600 m: the AND gate folds back at 200 m, "
        "the quadrature comparator begins anew at 400 m.",
    ),
    "ranging_fig07_zones": FigureSpec(
        _fig7,
        "Fig 7: zones take the channel pairs 1/2 and 3/4 in turn; the train changes channels at "
        "the station where a zone begins.",
    ),
    "ranging_fig08_branch": FigureSpec(
        _fig8,
        "Fig 8: a line with a branch. WRS5 has two antennas (arrows) and watches zone 5 on the "
        "main track and zone 7 on the branch; the branch uses channels 5 to 8.",
    ),
    "ranging_error_over_snr": FigureSpec(
        _range_error,
        "Error of ranges against the Cramér-Rao bound: the receiver of spectral lines stays on "
        "the bound to -12 dB, the discriminator leaves it below 10 dB.",
    ),
}
