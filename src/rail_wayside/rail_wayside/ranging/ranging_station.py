"""What a wayside station makes of a received burst: a range, or the reason why there is none."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rail_signals.ranging.comparators import and_comparator
from rail_signals.ranging.interference import CHI_SQUARE_LIMIT, JAMMING_LIMIT_DB, second_signal
from rail_signals.ranging.phase_range import (
    phase_to_range_m,
    range_per_radian_m,
    two_tone_range_m,
    unambiguous_range_m,
)
from rail_signals.ranging.receiver import FmToneReceiver, ToneEstimate
from rail_signals.ranging.signal import RangingSignal, discriminate, tone_of

Comparator = Literal["and", "quadrature", "two_tone"]

#: Where the noise is that of a jammer, or of a signal whose carrier lies far off, a smaller reduced
#: chi-square is enough to tell a second signal.
JAMMED_CHI_SQUARE_LIMIT = 2.5

_GRID = 64  # samples per tone period in front of the AND gate


@dataclass(frozen=True)
class BurstReading:
    """One range with its variance; infinite or NaN as in ``rail_msgs_py.ranging.range_reading``."""

    range_m: float
    variance_m2: float
    disturbance: str = ""


NO_SIGNAL = BurstReading(math.inf, math.inf)


class RangingStation:
    """Compares the phase of the returned tone with the reference.

    Parameters
    ----------
    signal : RangingSignal
    comparator : 'and', 'quadrature' or 'two_tone'
    delay_s : float
        Calibrated delay of the transponder and the equipment.
    downlink_noise : float
        Variance of the phase that the train re-transmits over that measured here. With equal
        powers and noise figures the two legs are equal (reciprocity), and this is 1.
    noise_mw : float
        Receiver noise expected in a burst, against which jamming shows.
    """

    def __init__(
        self,
        signal: RangingSignal,
        comparator: Comparator,
        delay_s: float,
        *,
        downlink_noise: float = 1.0,
        noise_mw: float = math.inf,
    ) -> None:
        self.signal = signal
        self.comparator = comparator
        self._delay_s = delay_s
        self._receiver = FmToneReceiver(signal)
        self._per_radian_m = range_per_radian_m(signal.tones_hz[0])
        self._noise_factor = 1.0 + downlink_noise
        self._jamming_mw = noise_mw * 10.0 ** (JAMMING_LIMIT_DB / 10.0)
        lag = 2.0 * math.pi * np.arange(_GRID) / _GRID
        self._reference_angle = lag

    @property
    def interval_m(self) -> tuple[float, float]:
        """Unambiguous interval of the ranges."""
        if self.comparator == "and":
            return 0.0, unambiguous_range_m(self.signal.tones_hz[0], "and")
        span_m = unambiguous_range_m(self.signal.tones_hz[-1], "quadrature")
        return -0.05 * span_m, 0.95 * span_m

    def read(self, burst: NDArray[np.complex128]) -> BurstReading:
        """Range of one burst [samples], sqrt(mW)."""
        estimate = self._receiver.estimate(burst)
        if not estimate.detected:
            noise_mw = float(np.vdot(burst, burst).real) / burst.size
            if noise_mw > self._jamming_mw:
                return BurstReading(math.nan, math.inf, _jammed(noise_mw))
            return NO_SIGNAL
        amplitude = float(estimate.amplitude)
        noise_mw = amplitude**2 / float(estimate.snr)
        jammed = noise_mw > self._jamming_mw
        limit = JAMMED_CHI_SQUARE_LIMIT if jammed else CHI_SQUARE_LIMIT
        if second_signal(
            float(estimate.reduced_chi_square), float(estimate.snr), burst.size, limit
        ):
            return BurstReading(math.nan, math.inf, "more than one signal in the zone")
        range_m, variance_m2 = self._compare(estimate, burst)
        if math.isnan(range_m):
            return BurstReading(math.nan, math.inf, "too weak to tell the cycle of the tone")
        if jammed:
            # The variance says what the jammer costs; that there is one is said as well.
            return BurstReading(range_m, variance_m2, _jammed(noise_mw))
        return BurstReading(range_m, variance_m2)

    def _compare(
        self, estimate: ToneEstimate, burst: NDArray[np.complex128]
    ) -> tuple[float, float]:
        variance_rad2 = estimate.variance_rad2 * self._noise_factor
        tones_hz = self.signal.tones_hz
        if self.comparator == "two_tone":
            ranges_m, variances_m2, resolved = two_tone_range_m(
                estimate.phase_lag_rad, variance_rad2, tones_hz, delay_s=self._delay_s
            )
            if not resolved:
                return math.nan, math.inf
            return float(ranges_m), float(variances_m2)
        variance_m2 = float(variance_rad2[0]) * self._per_radian_m**2
        if self.comparator == "and":
            return self._and_range_m(burst), variance_m2
        range_m = phase_to_range_m(estimate.phase_lag_rad[0], tones_hz[0], delay_s=self._delay_s)
        return float(range_m), variance_m2

    def _and_range_m(self, burst: NDArray[np.complex128]) -> float:
        """The document's way: FM demodulator, narrow filter, limiter, AND gate (Figs 4-6)."""
        tone_hz = self.signal.tones_hz[0]
        lag_rad = float(tone_of(self.signal, discriminate(self.signal, burst)))
        delayed = 2.0 * math.pi * tone_hz * self._delay_s
        reference = np.sin(self._reference_angle - delayed)
        received = np.sin(self._reference_angle - lag_rad)
        phase_rad = and_comparator(reference, received, _GRID * tone_hz, tone_hz)
        return float(phase_rad) * self._per_radian_m


def _jammed(noise_mw: float) -> str:
    return f"channel jammed: noise of {10.0 * math.log10(noise_mw):.0f} dBm"
