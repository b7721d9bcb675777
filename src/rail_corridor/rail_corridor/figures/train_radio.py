"""Figure 3 of An, Kim and Jeong (Alamouti's code for train control), and what a train feels."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.figure import Figure

from rail_corridor.plotting import COLOURS, FigureSpec
from rail_signals.train_radio.ber.closed_form import SCHEMES, error_rate
from rail_signals.train_radio.ber.link import DiversityLink
from rail_signals.train_radio.ber.monte_carlo import Result, until
from rail_signals.train_radio.space_time_block import Scheme

LABELS: Final = {
    "siso": ("SISO", "o", "-"),
    "mrc": ("MRC 1×2", "s", "--"),
    "alamouti_2x1": ("Alamouti 2×1", "^", "-."),
    "alamouti_2x2": ("Alamouti 2×2", "D", "-"),
}
_LEVELS_DB: Final = np.arange(0.0, 21.0, 2.5)
_LEAST_RATE: Final = 3e-6
_SEED: Final = 43


def counted(scheme: Scheme, eb_n0_db: float) -> Result:
    """Wrong bits of BPSK, counted until the rate is known to 20 %."""
    link = DiversityLink(scheme, 10.0 ** (eb_n0_db / 10.0), bits_per_symbol=1)
    seed = [_SEED, list(SCHEMES).index(scheme.name), round(10.0 * eb_n0_db)]
    return until(link, np.random.SFC64(seed), half_width=0.2, max_bits=6e7)


def _error_rates(figure: Figure) -> None:
    figure.set_size_inches(8.0, 5.2)
    axes = figure.subplots()
    fine_db = np.linspace(0.0, 20.0, 101)
    for (name, scheme), colour in zip(SCHEMES.items(), COLOURS, strict=False):
        label, marker, dashes = LABELS[name]
        axes.plot(fine_db, error_rate(scheme, 10.0 ** (fine_db / 10.0), 1), dashes, color=colour)
        there = error_rate(scheme, 10.0 ** (_LEVELS_DB / 10.0), 1) >= _LEAST_RATE
        counts = [counted(scheme, level) for level in _LEVELS_DB[there].tolist()]
        rates = np.array([each.rate for each in counts])
        bars = np.abs(np.array([each.interval for each in counts]).T - rates)
        axes.errorbar(
            _LEVELS_DB[there],
            rates,
            bars,
            fmt=marker,
            color=colour,
            ms=5,
            capsize=2.0,
            lw=1.0,
            label=label,
        )
    axes.set(
        title="Bit error rate of BPSK in Rayleigh fading: lines closed form, points counted",
        xlabel="Eb/N0 at each receive antenna, total transmit power fixed [dB]",
        ylabel="bit error rate",
        yscale="log",
        ylim=(1e-7, 0.5),
    )
    axes.legend()


def _gain(figure: Figure) -> None:
    from rail_signals.train_radio.ber.closed_form import ALAMOUTI_2X2, MRC_1X2, eb_n0_of_error_rate

    rates = np.logspace(-1.5, -6.0, 46)
    levels_db = {
        scheme.name: 10.0 * np.log10([eb_n0_of_error_rate(scheme, rate, 1) for rate in rates])
        for scheme in (MRC_1X2, ALAMOUTI_2X2)
    }
    gains_db = levels_db["mrc"] - levels_db["alamouti_2x2"]
    axes = figure.subplots()
    axes.plot(rates, gains_db)
    for rate in (1e-3, 1e-4, 1e-5):
        gain_db = float(np.interp(np.log(rate), np.log(rates[::-1]), gains_db[::-1]))
        axes.plot(rate, gain_db, "o", color=COLOURS[0])
        axes.annotate(f"{gain_db:.2f} dB", (rate, gain_db), (10, 0), textcoords="offset points")
    axes.set(
        title="Power that Alamouti 2×2 saves against MRC 1×2 at the same bit error rate",
        xlabel="bit error rate",
        ylabel="gain [dB]",
        xscale="log",
    )
    axes.invert_xaxis()


def _brakings(figure: Figure) -> None:
    from rail_corridor.studies.link_margin.curve import rate_curve

    axes = figure.subplots()
    for (name, (label, _, dashes)), colour in zip(LABELS.items(), COLOURS, strict=False):
        levels_db, rates = rate_curve(name)
        axes.plot(levels_db, rates, dashes, color=colour, label=label)
    axes.set(
        title="Brakings of a train at 80 km/h for loss of its authority, by theory",
        xlabel="median Es/N0 at each receive antenna [dB]",
        ylabel="per hour",
        yscale="log",
        ylim=(1e-4, 1500.0),
    )
    axes.axhline(1.0 / 24.0, color="black", ls=":", lw=1.0)
    axes.text(33.9, 1.15 / 24.0, "once a day", ha="right")
    axes.legend()


FIGURES: Final[dict[str, FigureSpec]] = {
    "train_radio_fig03_error_rates": FigureSpec(
        _error_rates,
        "Fig 3 and two more schemes: bit error rates in Rayleigh fading. Two antennas at either "
        "end fall with the fourth power of the signal; the counts (95 % intervals) lie on the "
        "closed forms. Nothing is counted below 3e-6.",
    ),
    "train_radio_gain": FigureSpec(
        _gain,
        "What Alamouti 2x2 gains on MRC 1x2: 4 dB at 1e-3, 8 dB at 1e-5, and ever more.",
    ),
    "train_radio_brakings": FigureSpec(
        _brakings,
        "What the link margin means to a train: brakings an hour because no authority came in "
        "time, by theory. 'rail study link_margin' sets runs of the corridor beside it.",
    ),
}
