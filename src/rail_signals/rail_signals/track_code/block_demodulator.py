"""The demodulator's chain for long inputs.

`rail_signals.track_code.demodulator` filters every input sample by an elliptic band-pass.
Here that filter's response, phase included, is that of two short ones with complex taps:

1. A low-pass about the carrier, evaluated at the discriminator's rate only.
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

from rail_signals.arrays import BoolArray, ComplexArray, FloatArray

from .demodulator import STOP_HZ, DemodulatorChain
from .filters import DEMODULATED_RATE_HZ, dc_rejecter, response
from .hop_kernel import BAND_STEP, WINDOW_STEP, SingleArray, demodulate_hops
from .profile import SLOT_RATE_HZ
from .reference_receiver import LOUDEST, MOST_AT_PEAK

RealArray: TypeAlias = NDArray[np.floating]

_STORED_AS: dict[np.dtype[np.floating], type[np.signedinteger]] = {
    np.dtype(np.float32): np.int32,
    np.dtype(np.float64): np.int64,
}

# Of the first filter. Its ripple is made good by the second.
_FRONT_DB = 55.0
_FRONT_RIPPLE_DB = 2.0
_BAND_TAPS_S = 0.1
# Of the low-pass after the discriminator, as a part of its whole response.
_IMPULSE_REST = 1e-4


class BlockDemodulator:
    """The chain of `Demodulator` for any number of hops at once (`demodulate_hops`).

    The result of a hop does not depend, to the last bit, on how many come in a batch.

    Parameters
    ----------
    chain
        Design.
    hop_samples
        Samples at 64 Hz of a hop; input comes in whole hops.
    """

    def __init__(self, chain: DemodulatorChain, hop_samples: int) -> None:
        rate = chain.discriminator_rate_hz
        front, band = equivalent_taps(chain)
        low_pass = impulse_response(chain.low_pass, _IMPULSE_REST) * rate / (2 * math.pi)
        step = 2 * math.pi * chain.carrier_hz / rate
        self._tables = (
            _latest_last(front, WINDOW_STEP),
            _latest_last(band, BAND_STEP),
            _latest_last(low_pass, WINDOW_STEP)[0],
            np.concatenate([dc_rejecter(), chain.compressor]),
            np.array([math.cos(step), math.sin(step)], dtype=np.float32),
        )
        self.hop_samples = hop_samples
        self.frame = round(chain.sample_rate_hz / SLOT_RATE_HZ) * hop_samples
        self._fast = self.frame // chain.decimation
        self._decimation, self._every = chain.decimation, round(rate / DEMODULATED_RATE_HZ)
        self.reset()

    def reset(self) -> None:
        """Forget what was received so far."""
        front, band, low_pass, sections, _ = self._tables
        self._state = (
            np.zeros(front.shape[1] - self._decimation + self.frame, dtype=np.float32),
            np.zeros((2, band.shape[1] - 1 + self._fast), dtype=np.float32),
            np.zeros((2, 1 + self._fast), dtype=np.float32),
            np.zeros(low_pass.size - self._every + self._fast, dtype=np.float32),
            np.zeros((len(sections), 2)),
        )

    def demodulate(self, frames: RealArray) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Demodulate the next hops.

        Parameters
        ----------
        frames : float [hops, frame]
            Passband wave.

        Returns
        -------
        demodulated : float64 [hops, samples at 64 Hz]
            Instantaneous frequency about its mean, filtered [Hz].
        amplitude : float64 [hops]
            Root mean square amplitude of the carrier in its band.
        faulty : bool [hops]
            Which hops hold samples at fault, and were taken for zeros; what fault is said by
            `input_fault`.
        """
        kind: type[np.signedinteger] | None = _STORED_AS.get(frames.dtype)
        if kind is None:
            frames, kind = frames.astype(np.float64), np.int64
        frames = np.ascontiguousarray(frames)
        most = int(MOST_AT_PEAK * frames.shape[1])
        loudest = int(np.array(LOUDEST, frames.dtype).view(kind))
        marks = np.array([np.iinfo(kind).max, loudest, most], dtype=kind)
        hops = len(frames)
        demodulated = np.empty((hops, self.hop_samples))
        amplitude, faulty = np.empty(hops), np.empty(hops, dtype=np.bool_)
        demodulate_hops(
            frames,
            frames.view(kind),
            marks,
            *self._tables,
            *self._state,
            demodulated,
            amplitude,
            faulty,
        )
        return demodulated, amplitude, faulty


def _latest_last(taps: ComplexArray | FloatArray, step: int) -> SingleArray:
    """Real and imaginary parts [2, n] backwards in time, after zeros to a multiple of `step`."""
    spare = np.zeros(-taps.size % step)
    rows = [np.concatenate([spare, part[::-1]]) for part in (taps.real, taps.imag)]
    return np.array(rows, dtype=np.float32)


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
        # Of 1/128 s, as the outputs at that rate are apart.
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
