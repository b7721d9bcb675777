"""From the wave in the rails to the modulating wave: band-pass, discriminator, rates.

The chain of Kim et al., figures 2 and 3, in software: elliptic band-pass around the
carrier, quadrature discriminator, elliptic low-pass to 128 Hz, DC rejecter, compressor to
64 Hz. The discriminator works at the lowest multiple of 128 Hz, from 640 Hz, that divides
the input rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy import signal

from rail_signals.arrays import ComplexArray, FloatArray

from .filters import (
    DEMODULATED_RATE_HZ,
    SectionFilter,
    carrier_band_pass,
    compressor_filter,
    dc_rejecter,
    post_demodulation_filter,
    response,
    settling_s,
)
from .profile import SLOT_RATE_HZ, TrackCodeProfile

PASS_HZ = 150.0
"""Half width of the band around the carrier that is let through [Hz]."""

STOP_HZ = 220.0
"""Distance from the carrier beyond which 60 dB are taken [Hz]."""

_LEAST_DISCRIMINATOR_HZ = 640.0
_IMAGE_DB = 70.0
_SETTLED = 0.01
# Phase noise and clicks below the FM threshold are white, unlike FM noise, which grows with f^2.
_WHITE_BELOW_HZ = 3.0
# What the model of the tones cannot explain (FM distortion), over the strongest noise.
_MODEL_FLOOR = 1e-3


@dataclass(frozen=True)
class DemodulatorChain:
    """Design of the chain for one carrier at one rate: filters, gains and noise.

    Parameters
    ----------
    profile
        Tones to be kept.
    carrier_hz
        Carrier frequency [Hz].
    sample_rate_hz
        Input rate [Hz], a multiple of 128 Hz, above twice the carrier by 450 Hz or more.

    Raises
    ------
    ValueError
        If a frequency does not fit; the message names it and quotes the value.
    """

    profile: TrackCodeProfile
    carrier_hz: float
    sample_rate_hz: float

    def __post_init__(self) -> None:
        """Validate both frequencies."""
        if not (math.isfinite(self.carrier_hz) and self.carrier_hz > 2 * STOP_HZ):
            raise ValueError(
                f"carrier_hz must be finite and above {2 * STOP_HZ:g} Hz, got {self.carrier_hz!r}"
            )
        rate = self.sample_rate_hz
        if not (math.isfinite(rate) and rate > 0 and rate % DEMODULATED_RATE_HZ == 0):
            raise ValueError(f"sample_rate_hz must be a multiple of 128 Hz, got {rate!r}")
        if rate < 2 * (self.carrier_hz + STOP_HZ) + 10:
            raise ValueError(
                f"sample_rate_hz must be {2 * (self.carrier_hz + STOP_HZ) + 10:g} Hz or more"
                f" for a carrier of {self.carrier_hz:g} Hz, got {rate!r}"
            )

    @cached_property
    def discriminator_rate_hz(self) -> float:
        """Rate of the discriminator [Hz]."""
        ratio = round(self.sample_rate_hz / DEMODULATED_RATE_HZ)
        least = min(ratio, round(_LEAST_DISCRIMINATOR_HZ / DEMODULATED_RATE_HZ))
        factor = next(k for k in range(least, ratio + 1) if ratio % k == 0)
        return factor * DEMODULATED_RATE_HZ

    @property
    def decimation(self) -> int:
        """Input samples per sample of the discriminator."""
        return round(self.sample_rate_hz / self.discriminator_rate_hz)

    @cached_property
    def band_pass(self) -> FloatArray:
        """Band-pass around the carrier, second-order sections at the input rate."""
        return carrier_band_pass(self.carrier_hz, PASS_HZ, STOP_HZ, self.sample_rate_hz)

    @cached_property
    def analytic_taps(self) -> ComplexArray:
        """FIR filter that keeps the carrier and stops its image at the negative frequency.

        Together with dropping samples it makes the quadrature signal. The band-pass has
        removed everything but the band and its image, so nothing else can fold.
        """
        image_hz = min(2 * self.carrier_hz, self.sample_rate_hz - 2 * self.carrier_hz)
        width = (image_hz - 2 * PASS_HZ) / (self.sample_rate_hz / 2)
        taps, beta = signal.kaiserord(_IMAGE_DB, width)
        low = signal.firwin(taps | 1, image_hz / 2, window=("kaiser", beta), fs=self.sample_rate_hz)
        turn = 2j * math.pi * self.carrier_hz / self.sample_rate_hz
        return np.asarray(2 * low * np.exp(turn * np.arange(low.size)), dtype=np.complex128)

    @cached_property
    def low_pass(self) -> FloatArray:
        """Filter after the discriminator, second-order sections at its rate."""
        return post_demodulation_filter(self.discriminator_rate_hz)

    @cached_property
    def compressor(self) -> FloatArray:
        """Filter before the step from 128 to 64 Hz, second-order sections at 128 Hz."""
        return compressor_filter(self.profile.tones_hz[-1])

    def gain(self, tone_hz: ArrayLike) -> ComplexArray:
        """Gain from a tone's deviation at the transmitter to the wave at 64 Hz.

        The band-pass acts on a tone of small index as the mean of its upper and, conjugated,
        its lower sideband over the carrier.

        Parameters
        ----------
        tone_hz : [tones]
            Frequency [Hz].

        Returns
        -------
        complex128 [tones]
        """
        tone = np.atleast_1d(np.asarray(tone_hz, dtype=np.float64))
        return self._before_rejecter(tone) * self._at_demodulated_rate(tone)

    def noise_spectrum(self, frequency_hz: FloatArray) -> FloatArray:
        """Power density of the noise at 64 Hz, of any scale: float64 [frequencies].

        White noise in the rails makes FM noise that grows with the square of the
        frequency, then passes the filters of the chain and folds once, at 32 Hz.
        """
        folded = np.zeros(np.shape(frequency_hz))
        for frequency in (frequency_hz, SLOT_RATE_HZ - frequency_hz):
            source = frequency**2 + _WHITE_BELOW_HZ**2
            whole = self._before_rejecter(frequency) * self._at_demodulated_rate(frequency)
            folded += source * np.abs(whole) ** 2
        return np.asarray(folded + _MODEL_FLOOR * np.max(folded), dtype=np.float64)

    def rejecter_modes(self, samples: int) -> FloatArray:
        """Natural oscillation of the DC rejecter at 64 Hz, float64 [samples, 2].

        What a step of the carrier frequency before the slot leaves in it.
        """
        pole = complex(signal.sos2zpk(dc_rejecter())[1][0])
        wave = pole ** (np.arange(samples) * (DEMODULATED_RATE_HZ / SLOT_RATE_HZ))
        return np.column_stack([wave.real, wave.imag])

    @cached_property
    def settling_samples(self) -> int:
        """Samples at 64 Hz until every filter but the DC rejecter is settled to 1 %."""
        time_s = (
            settling_s(self.band_pass, self.sample_rate_hz, _SETTLED)
            + settling_s(self.low_pass, self.discriminator_rate_hz, _SETTLED)
            + settling_s(self.compressor, DEMODULATED_RATE_HZ, _SETTLED)
        )
        return math.ceil(time_s * SLOT_RATE_HZ)

    def _before_rejecter(self, tone: FloatArray) -> ComplexArray:
        """Gain of band-pass, discriminator and low-pass."""
        rate = self.sample_rate_hz
        centre = response(self.band_pass, self.carrier_hz, rate)
        upper = response(self.band_pass, self.carrier_hz + tone, rate) / centre
        lower = response(self.band_pass, self.carrier_hz - tone, rate) / centre
        # The discriminator averages the frequency over one of its samples.
        turns = tone / self.discriminator_rate_hz
        average = np.sinc(turns) * np.exp(-1j * math.pi * turns)
        taps_delay = (self.analytic_taps.size - 1) / 2 / rate
        delay = np.exp(-2j * math.pi * tone * taps_delay)
        low = response(self.low_pass, tone, self.discriminator_rate_hz)
        return np.asarray((upper + np.conj(lower)) / 2 * average * delay * low)

    def _at_demodulated_rate(self, tone: FloatArray) -> ComplexArray:
        """Gain of DC rejecter and compressor."""
        return response(dc_rejecter(), tone, DEMODULATED_RATE_HZ) * response(
            self.compressor, tone, DEMODULATED_RATE_HZ
        )


class Demodulator:
    """Runs the chain over frames of whole samples at 64 Hz, carrying its state.

    Parameters
    ----------
    chain
        Design.
    """

    def __init__(self, chain: DemodulatorChain) -> None:
        self._chain = chain
        self._taps = chain.analytic_taps[::-1]
        step = 2j * math.pi * chain.carrier_hz / chain.discriminator_rate_hz
        self._unturn = np.exp(-step)
        self._every = round(chain.discriminator_rate_hz / DEMODULATED_RATE_HZ)
        self.reset()

    def reset(self) -> None:
        """Forget what was received so far."""
        chain = self._chain
        self._band_pass = SectionFilter(chain.band_pass)
        self._low_pass = SectionFilter(chain.low_pass)
        self._rejecter = SectionFilter(dc_rejecter())
        self._compressor = SectionFilter(chain.compressor)
        self._tail = np.zeros(self._taps.size - 1)
        self._last = 0j

    def frame(self, samples: FloatArray) -> tuple[FloatArray, float]:
        """Demodulate the next samples.

        Parameters
        ----------
        samples : float64 [n]
            Passband wave; n must be a multiple of the input rate over 64 Hz.

        Returns
        -------
        demodulated : float64 [n * 64 / rate]
            Instantaneous frequency about its mean, filtered [Hz].
        amplitude
            Root mean square amplitude of the carrier in its band.
        """
        band = np.concatenate([self._tail, self._band_pass.filter(samples)])
        self._tail = band[band.size - self._tail.size :]
        window = np.lib.stride_tricks.sliding_window_view(band, self._taps.size)
        # The last sample of each step: a frame then ends with an output.
        quadrature = window[self._chain.decimation - 1 :: self._chain.decimation] @ self._taps
        before = np.concatenate([[self._last], quadrature[:-1]])
        self._last = complex(quadrature[-1])
        step = quadrature * np.conj(before) * self._unturn
        rate = self._chain.discriminator_rate_hz
        frequency = np.arctan2(step.imag, step.real) * (rate / (2 * math.pi))
        demodulated = self._low_pass.filter(frequency)[self._every - 1 :: self._every]
        compressed = self._compressor.filter(self._rejecter.filter(demodulated))[1::2]
        power = float(np.mean(quadrature.real**2 + quadrature.imag**2))
        return compressed, math.sqrt(power)
