"""Filters of the track-code receiver: design as second-order sections, and streaming.

Kim et al. use elliptic filters in cascade form (equation 4) before and after the
demodulator and a Butterworth DC rejecter (equation 10), then halve the rate from 128 to
64 Hz. Their rate compressor has no filter of its own; here it has.

==========================  ====================================================
`carrier_band_pass`         elliptic, before the demodulator
`post_demodulation_filter`  elliptic, protects the sampling at 128 Hz
`dc_rejecter`               Butterworth, second order, unit gain at high frequency
`compressor_filter`         elliptic, protects the tones at 64 Hz
==========================  ====================================================
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy import signal

from rail_signals.arrays import ComplexArray, FloatArray

DEMODULATED_RATE_HZ = 128.0
"""Rate at which the DC rejecter works [Hz]."""

DC_PRINTED_DENOMINATOR = (1.0, -1.9564, 0.9573)
"""Denominator of equation 10 as printed: Butterworth, cut-off 0.00491 of the rate (0.63 Hz)."""

PASS_RIPPLE_DB = 0.1
STOP_DB = 60.0


def dc_rejecter(rate_hz: float = DEMODULATED_RATE_HZ) -> FloatArray:
    """High-pass of equation 10, with its pass-band gain of 1.0221 taken out.

    At 128 Hz the coefficients are those printed, the numerator ``(1, -2, 1)`` times 0.97842;
    at any other rate the bilinear transform of the same analogue filter.

    Returns
    -------
    float64 [1, 6]
        One second-order section.

    Examples
    --------
    >>> dc_rejecter()[0].round(5).tolist()
    [0.97842, -1.95685, 0.97842, 1.0, -1.9564, 0.9573]
    """
    if not (math.isfinite(rate_hz) and rate_hz >= 4):
        raise ValueError(f"rate_hz must be finite and 4 Hz or more, got {rate_hz!r}")
    _, a1, a2 = DC_PRINTED_DENOMINATOR
    # Denominator over s = (1 - 1/z) / (1 + 1/z) at 128 Hz; the rate scales s.
    scale = rate_hz / DEMODULATED_RATE_HZ
    square, linear, constant = (1 - a1 + a2) * scale**2, 2 * (1 - a2) * scale, 1 + a1 + a2
    lead = square + linear + constant
    gain = square / lead
    middle, last = 2 * (constant - square) / lead, (square - linear + constant) / lead
    return np.array([[gain, -2 * gain, gain, 1.0, middle, last]])


def carrier_band_pass(
    carrier_hz: float, pass_hz: float, stop_hz: float, rate_hz: float
) -> FloatArray:
    """Elliptic band-pass around a carrier.

    Parameters
    ----------
    carrier_hz
        Centre [Hz].
    pass_hz, stop_hz
        Half widths [Hz] of the band that passes (0.1 dB) and of the one outside which
        60 dB are taken.
    rate_hz
        Sample rate [Hz].
    """
    edges = [carrier_hz - pass_hz, carrier_hz + pass_hz]
    stops = [carrier_hz - stop_hz, carrier_hz + stop_hz]
    order, _ = signal.ellipord(edges, stops, PASS_RIPPLE_DB, STOP_DB, fs=rate_hz)
    return np.asarray(
        signal.ellip(order, PASS_RIPPLE_DB, STOP_DB, edges, "bandpass", fs=rate_hz, output="sos")
    )


def post_demodulation_filter(rate_hz: float) -> FloatArray:
    """Elliptic low-pass that keeps 32 Hz and stops what folds onto it at 128 Hz."""
    pass_hz = DEMODULATED_RATE_HZ / 4
    return _low_pass(pass_hz, DEMODULATED_RATE_HZ - pass_hz, rate_hz)


def compressor_filter(top_hz: float, rate_hz: float = DEMODULATED_RATE_HZ) -> FloatArray:
    """Elliptic low-pass before every other sample is dropped.

    The source names none. Tones pass up to `top_hz`; what would fold onto them, from
    ``rate / 2 - top_hz``, is stopped by 60 dB. Between the two lies half of the slot rate,
    and what folds there hits no tone.
    """
    return _low_pass(top_hz, rate_hz / 2 - top_hz, rate_hz)


def _low_pass(pass_hz: float, stop_hz: float, rate_hz: float) -> FloatArray:
    """Elliptic low-pass of the least order, 0.1 dB of ripple and 60 dB of stop band."""
    order, _ = signal.ellipord(pass_hz, stop_hz, PASS_RIPPLE_DB, STOP_DB, fs=rate_hz)
    return np.asarray(
        signal.ellip(order, PASS_RIPPLE_DB, STOP_DB, pass_hz, fs=rate_hz, output="sos")
    )


def response(sections: FloatArray, frequency_hz: ArrayLike, rate_hz: float) -> ComplexArray:
    """Frequency response of second-order sections, complex128 [frequencies]."""
    frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    return np.asarray(signal.sosfreqz(sections, frequency, fs=rate_hz)[1], dtype=np.complex128)


def settling_s(sections: FloatArray, rate_hz: float, remainder: float) -> float:
    """Time after which an input that has ended moves the output by `remainder` at most [s].

    The bound is the sum of the magnitudes of the impulse response from then on, over the
    sum of all: no input of constant magnitude can do more.

    Examples
    --------
    >>> round(settling_s(dc_rejecter(), 128.0, 0.01), 2)
    1.37
    """
    slowest = float(np.abs(signal.sos2zpk(sections)[1]).max())
    # Far past the wanted time: the slowest mode alone has decayed to 1e-3 of the remainder.
    length = math.ceil(math.log(1e-3 * remainder) / math.log(slowest)) + 1
    impulse = np.zeros(length)
    impulse[0] = 1.0
    tail = np.cumsum(np.abs(signal.sosfilt(sections, impulse))[::-1])[::-1]
    return float(np.count_nonzero(tail > remainder * tail[0]) / rate_hz)


class SectionFilter:
    """Second-order sections that carry their state from block to block.

    Examples
    --------
    >>> stage = SectionFilter(dc_rejecter())
    >>> both = np.concatenate([stage.filter(np.ones(3)), stage.filter(np.ones(4))])
    >>> bool(np.array_equal(both, SectionFilter(dc_rejecter()).filter(np.ones(7))))
    True
    """

    def __init__(self, sections: FloatArray) -> None:
        self._sections = sections
        self.reset()

    def reset(self) -> None:
        """Forget what was filtered so far."""
        self._state = np.zeros((self._sections.shape[0], 2))

    def filter(self, block: FloatArray) -> FloatArray:
        """Filter the next block, float64 [samples]."""
        out, self._state = signal.sosfilt(self._sections, block, zi=self._state)
        return np.asarray(out, dtype=np.float64)
