"""Frames of the train bus: bits, check, Manchester waveform, and what noise does to them.

The bus of IEC 61375 carries 1 Mbit/s in Manchester code (Choi, Lee and Lim, S2, section 3.1).
The frame is ours, in the manner of that standard, not its own:

=============  ==========  ==============================================================
preamble       16 bits     1010...: wakes the receiver
delimiter      8 bits      with violations of the code, so that no data look like it
payload        8 n bits    most significant bit of each byte first
check          32 bits     CRC of IEEE 802.3 over the payload, most significant bit first
=============  ==========  ==============================================================

A 1 is high, then low; a 0 low, then high. The driver's edges are Gaussian; between them the
line is driven at +1 or -1.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import erf, erfc

from rail_signals.arrays import BoolArray, FloatArray

PREAMBLE_BITS: Final = 16
DELIMITER_HALVES: Final = (-1, 1, 1, -1, -1, -1, 1, -1, 1, 1, -1, 1, -1, -1, 1, 1)
"""Half bits of the delimiter: balanced, four violations, no level longer than three halves.

Found by search: shifted against itself, preamble and delimiter agree on 20 of 48 halves at most.
"""
CHECK_BITS: Final = 32

# 10 to 90 % of a Gaussian edge over its standard deviation.
_RISE_PER_SIGMA: Final = 2.5631031310892007


@dataclass(frozen=True)
class BusFrameFormat:
    """What frames of a bus look like.

    Parameters
    ----------
    payload_bytes
        Bytes that a frame carries.
    bit_rate_hz
        Bits per second.
    samples_per_bit
        Samples of a bit; an even number, 4 or more.
    rise_time_s
        Rise time of the driver's edges, 10 to 90 % [s]; 0 is at once.

    Raises
    ------
    ValueError
        If a value is out of range; the message names and quotes it.
    """

    payload_bytes: int = 32
    bit_rate_hz: float = 1e6
    samples_per_bit: int = 8
    rise_time_s: float = 150e-9

    def __post_init__(self) -> None:
        """Validate every field."""
        if not 1 <= self.payload_bytes <= 1024:
            raise ValueError(f"payload_bytes must be from 1 to 1024, got {self.payload_bytes!r}")
        if not (math.isfinite(self.bit_rate_hz) and self.bit_rate_hz > 0.0):
            raise ValueError(f"bit_rate_hz must be above 0, got {self.bit_rate_hz!r}")
        if self.samples_per_bit < 4 or self.samples_per_bit % 2:
            raise ValueError(
                f"samples_per_bit must be even and 4 or more, got {self.samples_per_bit!r}"
            )
        if not 0.0 <= self.rise_time_s <= 0.5 / self.bit_rate_hz:
            raise ValueError(f"rise_time_s must be from 0 to half a bit, got {self.rise_time_s!r}")

    @property
    def sample_rate_hz(self) -> float:
        """Samples per second."""
        return self.bit_rate_hz * self.samples_per_bit

    @property
    def data_bits(self) -> int:
        """Bits of payload and check."""
        return 8 * self.payload_bytes + CHECK_BITS

    @property
    def bits(self) -> int:
        """Bits of a frame, its delimiter counted as eight."""
        return PREAMBLE_BITS + len(DELIMITER_HALVES) // 2 + self.data_bits

    @property
    def samples(self) -> int:
        """Samples of a frame."""
        return self.bits * self.samples_per_bit

    @property
    def duration_s(self) -> float:
        """Time a frame takes [s]."""
        return self.bits / self.bit_rate_hz

    @cached_property
    def start_halves(self) -> FloatArray:
        """Levels of preamble and delimiter: [half bits]."""
        preamble = manchester(np.arange(PREAMBLE_BITS) % 2 == 0)
        return np.concatenate((preamble, np.array(DELIMITER_HALVES, dtype=np.float64)))

    def waveform(self, payload: bytes) -> FloatArray:
        """Samples of the frame that carries a payload, at levels of 1: float64 [samples].

        Each stands in the middle of its interval. What the last edge has behind the frame is
        left out.

        Raises
        ------
        ValueError
            If the payload has another length.
        """
        if len(payload) != self.payload_bytes:
            raise ValueError(f"payload must have {self.payload_bytes} bytes, got {len(payload)}")
        sealed = payload + zlib.crc32(payload).to_bytes(CHECK_BITS // 8, "big")
        bits = np.unpackbits(np.frombuffer(sealed, dtype=np.uint8)).astype(np.bool_)
        halves = np.concatenate((self.start_halves, manchester(bits)))
        # The line rests before and after. An edge reaches no further than half a bit.
        around = np.concatenate(([0.0], halves, [0.0]))
        here, rise = halves[:, None], self._rise
        samples: FloatArray = here + (around[:-2, None] - here) * rise[::-1]
        samples += (around[2:, None] - here) * rise
        return samples.reshape(self.samples)

    def shaped(self, halves: ArrayLike, places: ArrayLike) -> FloatArray:
        """A few half bits, the line at rest before and after, at any places.

        Parameters
        ----------
        halves : [half bits]
            Levels.
        places : [...]
            Where to sample [samples from the begin of the first].
        """
        each = self.samples_per_bit // 2
        steps = np.diff(np.asarray(halves, dtype=np.float64), prepend=0.0, append=0.0)
        edges = self.edge(np.asarray(places)[..., None] - each * np.arange(len(steps)))
        shape: FloatArray = edges @ steps
        return shape

    def edge(self, places: ArrayLike) -> FloatArray:
        """A step from 0 to 1, its middle at 0 [...]; places in samples."""
        if self.rise_time_s == 0.0:
            return np.asarray(np.heaviside(places, 0.5))
        sigma = self.rise_time_s / _RISE_PER_SIGMA * self.sample_rate_hz
        return np.asarray(0.5 * (1.0 + erf(np.asarray(places) / (math.sqrt(2.0) * sigma))))

    @cached_property
    def _rise(self) -> FloatArray:
        """Fraction of a step that lies before its middle: [samples of a half bit]."""
        each = self.samples_per_bit // 2
        return self.edge(np.arange(each) - each + 0.5)


def manchester(bits: BoolArray) -> FloatArray:
    """Half bits of bits: +1 -1 for a 1, -1 +1 for a 0; float64 [2 * bits].

    >>> manchester(np.array([True, False])).tolist()
    [1.0, -1.0, -1.0, 1.0]
    """
    first = np.where(bits, 1.0, -1.0)
    return np.stack((first, -first), axis=1).reshape(2 * len(first))


def checked_payload(bits: BoolArray) -> bytes | None:
    """Payload of the bits of payload and check, None if they do not agree.

    Parameters
    ----------
    bits : bool [data bits]
    """
    if len(bits) % 8 or len(bits) <= CHECK_BITS:
        return None
    sealed = np.packbits(bits).tobytes()
    payload, check = sealed[: -CHECK_BITS // 8], sealed[-CHECK_BITS // 8 :]
    return payload if zlib.crc32(payload).to_bytes(CHECK_BITS // 8, "big") == check else None


def bit_error_rate(ebn0: ArrayLike) -> FloatArray:
    """Fraction of wrong bits of an antipodal signal in white noise, ``Q(sqrt(2 Eb/N0))`` [...].

    A Manchester bit and its opposite are antipodal, so that the matched filter over the bit
    reaches this.

    Parameters
    ----------
    ebn0 : [...]
        Energy of a bit over the noise density (a ratio, not decibels).

    Examples
    --------
    >>> f"{float(bit_error_rate(10.0)):.3e}"
    '3.872e-06'
    """
    ratio = np.asarray(ebn0, dtype=np.float64)
    if np.isnan(ratio).any() or (ratio < 0.0).any():
        raise ValueError(f"ebn0 must be 0 or more, got {ebn0!r}")
    return np.asarray(0.5 * erfc(np.sqrt(ratio)))


def frame_loss_rate(ebn0: ArrayLike, bits: int) -> FloatArray:
    """Fraction of frames with a wrong bit among `bits`, errors independent [...]."""
    return np.asarray(-np.expm1(bits * np.log1p(-bit_error_rate(ebn0))))
