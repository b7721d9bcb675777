"""Receiver of the train bus: finds the start of a frame, filters bit by bit, checks.

With r the block received, s preamble and delimiter, and g the pulse of a 1,

    tau = argmax of  rho(tau) = <r(t + tau), s(t)> / (|s| |r|)         the start
    z_b = <r(t + tau + b T), g(t)>,   bit b = (z_b > 0)                 the matched filter

rho is a cosine, so it knows no level: a frame is found if it is above a threshold, whatever the
cable has taken from it. tau is resolved to a fraction of a sample, and s and g are sampled where
the samples of the block stand. The mean of ``|z|`` over its spread gives
``Eb/N0 = mean^2 / (2 var)``, intersymbol interference counted as noise.

Nothing that arrives can make it raise: what is too short or not finite is a frame not found,
and what fails the check has no payload.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from rail_signals.arrays import BoolArray, FloatArray

from .frame import BusFrameFormat, checked_payload

# Places between two samples at which the start is looked for, and samples by which a bit that
# begins between two of them is longer.
_FINE, _SKIRT = 8, 1
_LARGEST = 1e150


@dataclass(frozen=True)
class ReceivedFrame:
    """What was made of a block.

    Parameters
    ----------
    payload
        Bytes of a frame whose check agrees, None else.
    detected
        Whether the start of a frame was found.
    delay_s
        When it begins within the block [s]; NaN if not found.
    level
        Amplitude of the bits, of the unit of the samples; NaN if not found.
    ebn0
        Energy of a bit over the noise density, as measured on the bits; NaN if not found.
    bits : bool [data bits]
        Decisions on payload and check; empty if not found.
    """

    payload: bytes | None
    detected: bool
    delay_s: float
    level: float
    ebn0: float
    bits: BoolArray


NOT_DETECTED = ReceivedFrame(None, False, math.nan, math.nan, math.nan, np.zeros(0, dtype=np.bool_))
"""No frame."""


class BusFrameReceiver:
    """Receives one frame from each block.

    Parameters
    ----------
    frame
        What frames look like.
    longest_delay_s
        Latest start of a frame in a block [s].
    least_correlation
        Cosine between block and start word from which a frame is found.

    Raises
    ------
    ValueError
        If a value is out of range.
    """

    def __init__(
        self,
        frame: BusFrameFormat,
        longest_delay_s: float = 10e-6,
        least_correlation: float = 0.35,
    ) -> None:
        if not (math.isfinite(longest_delay_s) and longest_delay_s >= 0.0):
            raise ValueError(f"longest_delay_s must be 0 or more, got {longest_delay_s!r}")
        if not 0.0 < least_correlation < 1.0:
            raise ValueError(
                f"least_correlation must be between 0 and 1, got {least_correlation!r}"
            )
        self.frame = frame
        self.longest_delay_s = longest_delay_s
        self._least = least_correlation
        self._latest = math.ceil(longest_delay_s * frame.sample_rate_hz)
        each, word = frame.samples_per_bit, frame.start_halves
        length = len(word) * each // 2
        self._start = frame.shaped(word, np.arange(length) + 0.5)
        self._start_norm = float(np.linalg.norm(self._start))
        # A frame that begins d samples late has at sample n what stands at n + 0.5 - d in it.
        self._steps = np.arange(-_FINE // 2, _FINE // 2 + 1) / _FINE
        inside = np.arange(-1, length + 1) + 0.5
        self._fine = frame.shaped(word, inside - self._steps[:, None])

    def receive(self, samples: ArrayLike) -> ReceivedFrame:
        """Make out the frame in a block.

        Parameters
        ----------
        samples : float64 [samples]
            The block, long enough for a frame at its latest start; what is shorter can hold
            earlier ones only.
        """
        block = np.asarray(samples, dtype=np.float64)
        frame = self.frame
        if block.ndim != 1 or len(block) < frame.samples:
            return NOT_DETECTED
        largest = float(np.abs(block).max())
        if not 0.0 < largest < _LARGEST:  # NaN compares false
            return NOT_DETECTED
        padded = np.zeros(len(block) + 2 * _SKIRT)
        np.divide(block, largest, out=padded[_SKIRT:-_SKIRT])
        place = self._find(padded)
        if place is None:
            return NOT_DETECTED
        whole = round(place)
        pulse = self._pulse(place - whole)
        first = whole + frame.samples - frame.data_bits * frame.samples_per_bit
        windows = sliding_window_view(padded[first:], len(pulse))[:: frame.samples_per_bit]
        z = windows[: frame.data_bits] @ pulse
        bits: BoolArray = z > 0.0
        size = np.abs(z)
        mean, spread = float(size.mean()), float(size.var())
        return ReceivedFrame(
            checked_payload(bits),
            True,
            max(0.0, place) / frame.sample_rate_hz,
            largest * mean / float(pulse @ pulse),
            mean * mean / (2.0 * spread) if spread > 0.0 else math.inf,
            bits,
        )

    def _find(self, padded: FloatArray) -> float | None:
        """Where a frame begins [samples], None if there is none."""
        block = padded[_SKIRT:-_SKIRT]
        last = min(self._latest, len(block) - self.frame.samples)
        length = len(self._start)
        near = block[: last + length]
        match = np.correlate(near, self._start)
        energy = np.concatenate(([0.0], np.cumsum(np.square(near))))
        window = np.sqrt(np.maximum(energy[length:] - energy[: last + 1], 1e-300))
        rho = match / (window * self._start_norm)
        best = int(rho.argmax())
        if rho[best] < self._least:
            return None
        at = best + _SKIRT - 1
        fine = self._fine @ padded[at : at + self._fine.shape[1]]
        peak = int(np.argmax(fine))
        step = float(self._steps[peak])
        if 0 < peak < len(fine) - 1:
            before, here, after = fine[peak - 1 : peak + 2].tolist()
            bend = before - 2.0 * here + after
            step += 0.5 * (before - after) / bend / _FINE if bend < 0.0 else 0.0
        # Not before the block, nor so late that the frame would reach out of it.
        return min(max(best + step, -0.5), len(block) - self.frame.samples + 0.49)

    def _pulse(self, late: float) -> FloatArray:
        """A 1 as a frame that much late has it: [samples].

        Only within the bit: the skirts of its edges would let in more of the neighbours than
        they are worth.
        """
        each = self.frame.samples_per_bit
        places = np.arange(-_SKIRT, each + _SKIRT) + 0.5 - late
        shape = self.frame.shaped(np.array([1.0, -1.0]), places)
        return np.where((places >= 0.0) & (places <= each), shape, 0.0)
