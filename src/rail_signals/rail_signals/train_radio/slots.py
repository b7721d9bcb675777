"""Time slots of the train radio: bursts one after the other within a block.

Slot 0 is the base station's beacon, by which trains choose their base station; slot n is that of
train n, on the way down and on the way up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import BoolArray, ComplexArray
from rail_signals.compiled import compiled

from .burst import RadioBurstFormat
from .symbol_mapping import BitArray

BEACON_SLOT = 0
_AT_ONCE, _SIGN = 256, np.uint64(1)


@dataclass(frozen=True)
class RadioSlots:
    """Where bursts lie in a block.

    Parameters
    ----------
    burst
        Format of every burst.
    trains
        Slots for trains, after that of the beacon.
    """

    burst: RadioBurstFormat
    trains: int

    def __post_init__(self) -> None:
        """Validate."""
        if self.trains < 1:
            raise ValueError(f"trains must be 1 or more, got {self.trains!r}")
        if self.burst.data_bits % 8:
            raise ValueError(f"data_bits must be whole bytes, got {self.burst.data_bits!r}")

    @property
    def count(self) -> int:
        """Slots of a block, that of the beacon included."""
        return 1 + self.trains

    @property
    def samples(self) -> int:
        """Samples of a block."""
        return self.count * self.burst.samples

    @property
    def duration_s(self) -> float:
        """Length of a block [s]."""
        return self.samples / self.burst.sample_rate_hz

    def span(self, slot: int) -> tuple[int, int]:
        """First sample of a slot, and the first one after it."""
        if not 0 <= slot < self.count:
            raise ValueError(f"slot must be from 0 to {self.count - 1}, got {slot!r}")
        return slot * self.burst.samples, (slot + 1) * self.burst.samples

    def bursts(self, frames: Sequence[bytes]) -> ComplexArray:
        """Waves of unit energy per symbol that carry frames, complex128 [frame, tx, sample]."""
        if not frames:
            return np.zeros(
                (0, self.burst.scheme.transmit, self.burst.samples), dtype=np.complex128
            )
        return self.burst.transmit(bits_of(frames))

    def block(self, frames: Mapping[int, bytes], amplitude: float = 1.0) -> ComplexArray:
        """Block with a frame in each slot named, zero elsewhere; complex128 [tx, samples]."""
        # Of a block for many trains most is zero: memory that is not touched costs nothing.
        wave = np.zeros((self.burst.scheme.transmit, self.samples), dtype=np.complex128)
        bursts = self.bursts(list(frames.values()))
        bursts *= amplitude
        for slot, burst in zip(frames, bursts, strict=True):
            first, end = self.span(slot)
            wave[:, first:end] = burst
        return wave

    def cut(self, samples: ComplexArray) -> ComplexArray:
        """Slots of received samples [rx, slots * burst], as a view [slot, rx, burst]."""
        parts = samples.reshape(samples.shape[0], -1, self.burst.samples)
        return np.asarray(parts.transpose(1, 0, 2))


def used_slots(samples: ComplexArray, length: int) -> list[int]:
    """Whole slots of a length in a block [antenna, sample] that are not zero altogether.

    Examples
    --------
    >>> used_slots(np.array([[0, 0, 0, 1j, 0, 0, 1], [0, 1, 0, 0, 0, 0, 0]]), 2)
    [0, 1]
    """
    words = np.ascontiguousarray(samples, dtype=np.complex128).view(np.uint64)
    used = np.empty(samples.shape[1] // length, dtype=np.bool_)
    _look_for_signals(words, 2 * length, used)
    return [slot for slot, some in enumerate(used.tolist()) if some]


@compiled
def _look_for_signals(words: NDArray[np.uint64], length: int, used: BoolArray) -> None:
    """Whether stretches of numbers, as they are kept [antenna, number], hold anything but zeros.

    ``used`` is the result.
    """
    for slot in range(len(used)):
        used[slot] = False
        for antenna in range(len(words)):
            # By the hundred: a loop that may end at every step looks at one after the other.
            for start in range(slot * length, (slot + 1) * length, _AT_ONCE):
                some = np.uint64(0)
                for word in words[antenna, start : min(start + _AT_ONCE, (slot + 1) * length)]:
                    some |= word << _SIGN  # zero has two signs
                if some != 0:
                    used[slot] = True
                    break
            if used[slot]:
                break


def bits_of(frames: Sequence[bytes]) -> BitArray:
    """Bits of frames of equal length, uint8 [frame, bit].

    Examples
    --------
    >>> bits_of([bytes([0x81])]).tolist()
    [[1, 0, 0, 0, 0, 0, 0, 1]]
    """
    octets = np.frombuffer(b"".join(frames), dtype=np.uint8).reshape(len(frames), -1)
    return np.unpackbits(octets, axis=1)


def frame_of(bits: NDArray[np.uint8]) -> bytes:
    """Bytes of one frame's bits [bit]."""
    return np.packbits(bits).tobytes()
