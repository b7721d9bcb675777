"""The demodulator's chain for long inputs, as matrix products.

`rail_signals.track_code.demodulator` filters every input sample by an elliptic band-pass.
Here that filter's response, phase included, is that of two short ones with complex taps:

1. A low-pass about the carrier, evaluated at the discriminator's rate only: one product of
   the input, cut into rows of 1/128 s, with a matrix of the taps.
2. At that rate, what is missing to the elliptic band-pass and the analytic filter.

So neither levels nor the times at which they settle differ. The discriminator works in
single precision on real and imaginary parts; the filters after it are those of the chain.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from rail_signals.arrays import ComplexArray, FloatArray

from .demodulator import STOP_HZ, DemodulatorChain
from .filters import DEMODULATED_RATE_HZ, SectionFilter, dc_rejecter, response

SingleArray: TypeAlias = NDArray[np.float32]

# Of the first filter. Its ripple is made good by the second.
_FRONT_DB = 55.0
_FRONT_RIPPLE_DB = 2.0
_BAND_TAPS_S = 0.1
# Of the low-pass after the discriminator, as a part of its whole response.
_IMPULSE_REST = 1e-4


class RowFilter:
    """FIR filter, decimating or not, as one matrix product over rows of samples.

    ``P = X A`` with the rows of X following each other in time. A column of P is what a row
    adds to one output, its own or one of the rows after it, so that no sample is read twice.

    Parameters
    ----------
    taps : complex or real [n]
        Impulse response at the input rate; real ones are for real input.
    decimation
        Input samples per output; an output is of the time of the last of them.
    outputs
        Outputs per row.
    real
        Whether the input is real; else real and imaginary parts alternate.
    """

    def __init__(
        self, taps: ComplexArray | FloatArray, decimation: int, outputs: int, real: bool
    ) -> None:
        inputs = outputs * decimation
        span = outputs + math.ceil((taps.size - 1) / decimation)
        index = (np.arange(span)[None, :] + 1) * decimation - 1 - np.arange(inputs)[:, None]
        inside = (index >= 0) & (index < taps.size)
        tap = np.where(inside, taps[np.clip(index, 0, taps.size - 1)], 0)
        each = 2 if np.iscomplexobj(taps) else 1
        parts = np.stack([tap.real, tap.imag][:each], axis=-1).reshape(inputs, each * span)
        if not real:
            turned = np.stack([-tap.imag, tap.real], axis=-1).reshape(inputs, 2 * span)
            parts = np.stack([parts, turned], axis=1).reshape(2 * inputs, 2 * span)
        self._matrix = np.ascontiguousarray(parts, dtype=np.float32)
        self._width = each * outputs
        self._spill = math.ceil(span / outputs) - 1
        self.row = self._matrix.shape[0]
        self.reset()

    def reset(self) -> None:
        """Forget what was filtered so far."""
        self._before = np.zeros((self._spill, self._matrix.shape[1]), dtype=np.float32)

    def filter(self, samples: SingleArray) -> SingleArray:
        """Outputs of whole rows of samples; of complex taps real and imaginary parts alternate."""
        rows = samples.reshape(-1, self.row)
        spill, width = self._spill, self._width
        product = np.empty((spill + len(rows), self._matrix.shape[1]), dtype=np.float32)
        product[:spill] = self._before
        np.matmul(rows, self._matrix, out=product[spill:])
        out = product[spill:, :width].copy()
        for late in range(1, spill + 1):
            part = product[spill - late : spill - late + len(rows), late * width :][:, :width]
            out[:, : part.shape[1]] += part
        self._before = product[len(rows) :].copy()
        return np.asarray(out.reshape(-1))


class BlockDemodulator:
    """The chain of `Demodulator` in two steps, each for any number of hops.

    Parameters
    ----------
    chain
        Design.
    hop_samples
        Samples at 64 Hz of a hop; input comes in whole hops.
    """

    def __init__(self, chain: DemodulatorChain, hop_samples: int) -> None:
        rate = chain.discriminator_rate_hz
        self._every = round(rate / DEMODULATED_RATE_HZ)
        front, band = equivalent_taps(chain)
        self._front = RowFilter(front, chain.decimation, self._every, real=True)
        # Whole rows in a hop. Four hundredths of a second hold the least products.
        per_row = next(k for k in (4, 2, 1) if hop_samples % k == 0)
        self._band = RowFilter(band, 1, 2 * per_row * self._every, real=False)
        step = 2 * math.pi * chain.carrier_hz / rate
        self._cos, self._sin = np.float32(math.cos(step)), np.float32(math.sin(step))
        impulse = impulse_response(chain.low_pass, _IMPULSE_REST) * rate / (2 * math.pi)
        self._low_pass = RowFilter(impulse, self._every, 2 * hop_samples, real=True)
        self._chain = chain
        self.reset()

    def reset(self) -> None:
        """Forget what was received so far."""
        self._front.reset()
        self._band.reset()
        self._low_pass.reset()
        self._after = SectionFilter(np.concatenate([dc_rejecter(), self._chain.compressor]))
        self._last = np.zeros(2, dtype=np.float32)

    def decimate(self, samples: SingleArray) -> SingleArray:
        """First filter: passband wave, whole hops, to the discriminator's rate.

        Returns
        -------
        float32 [2 n / decimation]
            Real and imaginary parts alternating.
        """
        return self._front.filter(samples)

    def demodulate(self, decimated: SingleArray, hops: int) -> tuple[FloatArray, FloatArray]:
        """All that follows.

        Parameters
        ----------
        decimated : float32 [2 m]
            What `decimate` made of `hops` hops.

        Returns
        -------
        demodulated : float64 [hops, samples at 64 Hz]
            Instantaneous frequency about its mean, filtered [Hz].
        amplitude : float64 [hops]
            Root mean square amplitude of the carrier in its band.
        """
        parts = np.concatenate([self._last, self._band.filter(decimated)])
        self._last = parts[-2:].copy()
        row = parts[2:].reshape(hops, -1)
        amplitude = np.sqrt(np.vecdot(row, row) * (2.0 / row.shape[1]))
        real, imag = parts[0::2].copy(), parts[1::2].copy()
        along = real[1:] * real[:-1] + imag[1:] * imag[:-1]
        across = imag[1:] * real[:-1] - real[1:] * imag[:-1]
        # The carrier's own turn from sample to sample is taken out.
        angle = np.arctan2(
            across * self._cos - along * self._sin, along * self._cos + across * self._sin
        )
        low = self._low_pass.filter(angle)
        compressed = self._after.filter(low.astype(np.float64))[1::2]
        return compressed.reshape(hops, -1), np.asarray(amplitude, dtype=np.float64)


def impulse_response(sections: FloatArray, rest: float) -> FloatArray:
    """Impulse response of second-order sections, float64 [n], until only `rest` of it is left.

    The rest is counted in magnitudes, as a part of all: no bounded input can make more of it.
    """
    longest = 64
    while True:
        longest *= 2
        impulse = signal.sosfilt(sections, np.eye(1, longest)[0])
        left = np.cumsum(np.abs(impulse)[::-1])[::-1]
        length = int(np.count_nonzero(left > rest * left[0]))
        if length <= longest // 2:  # the half cut off holds next to nothing
            return np.asarray(impulse[:length])


def equivalent_taps(chain: DemodulatorChain) -> tuple[ComplexArray, ComplexArray]:
    """Taps of both filters that stand for the band-pass and the analytic filter.

    The first has minimum phase: it delays little, and the second, found by least squares
    on the frequency axis, is causal.

    Returns
    -------
    front : complex [n]
        At the input rate, evaluated at the discriminator's.
    band : complex [m]
        At the discriminator's rate.
    """
    rate, low_rate = chain.sample_rate_hz, chain.discriminator_rate_hz
    turn = 2j * math.pi * chain.carrier_hz
    if chain.decimation == 1:
        front = np.ones(1, dtype=np.complex128)
    else:
        edges = (STOP_HZ, low_rate - STOP_HZ)
        ripple = 10 ** (_FRONT_RIPPLE_DB / 20) - 1
        floor = 10 ** (-_FRONT_DB / 20)
        # A row of 1/128 s and one sample: the rows of the product reach into the next one only.
        taps = round(rate / DEMODULATED_RATE_HZ) // 2 * 2 + 1
        low = signal.remez(
            taps, [0, *edges, rate / 2], [1, 0], weight=[1 / ripple, 1 / floor], fs=rate
        )
        low = signal.minimum_phase(low, half=False, n_fft=1 << 16)
        front = low * np.exp(turn / rate * np.arange(low.size))
    offset = np.linspace(-low_rate / 2, low_rate / 2, 1024, endpoint=False)
    frequency = chain.carrier_hz + offset
    wanted = response(chain.band_pass, np.mod(frequency, rate), rate)
    wanted = wanted * _fir_response(chain.analytic_taps, frequency, rate)
    is_real_band = (frequency > 0) & (frequency < rate / 2)
    wanted = np.where(is_real_band, wanted, 0)
    have = _fir_response(front, frequency, rate)
    taps_low = round(_BAND_TAPS_S * low_rate)
    waves = np.exp(-2j * math.pi * np.outer(frequency / low_rate, np.arange(taps_low)))
    band = np.linalg.lstsq(have[:, None] * waves, wanted, rcond=1e-6)[0]
    return front, np.asarray(band)


def _fir_response(taps: ComplexArray, frequency_hz: FloatArray, rate_hz: float) -> ComplexArray:
    turn = -2j * math.pi * np.outer(frequency_hz / rate_hz, np.arange(taps.size))
    return np.asarray(np.exp(turn) @ taps)
