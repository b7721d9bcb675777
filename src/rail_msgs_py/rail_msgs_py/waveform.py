"""Sampled complex waveforms as ``std_msgs/Float64MultiArray``.

Layout on the wire: dimensions ``antenna``, ``sample``, ``iq``; ``data_offset`` 4; the four
leading values are stamp [s], sample rate [Hz], carrier [Hz] and channel number (0 = not a
radio channel). A block without samples means silence.

Waveforms are most of what the corridor sends, so beside the message form there is a direct
one to and from the serialised bytes (CDR). It is the same wire format, one copy instead of
four; any ROS 2 tool reads it.
"""

from __future__ import annotations

import array
import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from .delivery import ViewDecoder
from .stamps import CDR_LITTLE_ENDIAN, NANOSECONDS, seconds_to_ns

HEADER_VALUES: Final = 4
LABELS: Final = ("antenna", "sample", "iq")

# CDR of the layout above: three labelled dimensions, the data offset, the element count.
_PREFIX = struct.Struct("<4sI I8sII I7sxII I3sxII II4x")
_HEADER = struct.Struct("<4d")
_STAMP = struct.Struct("<d")
_DATA_AT = _PREFIX.size + _HEADER.size
#: Where the stamp stands in the serialised form, a double: all that changes in a repeated block.
STAMP_AT: Final = _PREFIX.size


@dataclass(frozen=True, eq=False)
class Waveform:
    """One block of one port.

    Parameters
    ----------
    stamp_ns : int
        Simulated time of the tick; the middle of the block.
    sample_rate_hz, carrier_hz : float
        Of the complex envelope.
    channel : int
        Radio channel number, 0 where there is none.
    samples : complex array [antenna, sample]
        In volts over 1 ohm scaled so that ``|s|^2`` is the power in mW; no sample = silence.
    """

    stamp_ns: int
    sample_rate_hz: float
    carrier_hz: float
    channel: int
    samples: NDArray[np.complex128]

    @property
    def first(self) -> Waveform:
        """The block itself; see `RepeatedWaveform`."""
        return self

    @cached_property
    def silent(self) -> bool:
        """Whether the block carries no sample."""
        return self.samples.size == 0

    @cached_property
    def row(self) -> NDArray[np.complex128]:
        """Samples of the first antenna; the same array each time it is asked for."""
        first: NDArray[np.complex128] = self.samples[0]
        return first

    @property
    def power_dbm(self) -> float:
        """Mean power of the block, -inf for silence."""
        if self.silent:
            return -np.inf
        power_mw = float(np.mean(np.abs(self.samples) ** 2))
        return float(10.0 * np.log10(power_mw)) if power_mw > 0.0 else -np.inf

    def to_msg(self) -> Float64MultiArray:
        """Message form."""
        antennas, count = self.samples.shape
        message = Float64MultiArray()
        sizes = (antennas, count, 2)
        strides = (antennas * count * 2, count * 2, 2)
        message.layout.dim = [
            MultiArrayDimension(label=label, size=size, stride=stride)
            for label, size, stride in zip(LABELS, sizes, strides, strict=True)
        ]
        message.layout.data_offset = HEADER_VALUES
        data = array.array("d")
        data.frombytes(self._header() + _sample_bytes(self.samples))
        message.data = data
        return message

    def to_cdr(self) -> bytes:
        """Serialised form."""
        antennas, count = self.samples.shape
        return (
            _PREFIX.pack(
                CDR_LITTLE_ENDIAN,
                3,
                *(8, b"antenna\0", antennas, antennas * count * 2),
                *(7, b"sample\0", count, count * 2),
                *(3, b"iq\0", 2, 2),
                HEADER_VALUES,
                HEADER_VALUES + 2 * antennas * count,
            )
            + self._header()
            + _sample_bytes(self.samples)
        )

    def _header(self) -> bytes:
        return _HEADER.pack(
            self.stamp_ns / NANOSECONDS, self.sample_rate_hz, self.carrier_hz, float(self.channel)
        )

    @classmethod
    def from_msg(cls, message: Any) -> Waveform:
        """View of a message.

        Raises
        ------
        ValueError
            If the layout is not that of a waveform.
        """
        labels = tuple(dim.label for dim in message.layout.dim)
        if labels != LABELS or message.layout.data_offset != HEADER_VALUES:
            raise ValueError(f"not a waveform: dimensions {labels}")
        antennas, count, parts = (int(dim.size) for dim in message.layout.dim)
        data = np.frombuffer(message.data, dtype=np.float64)
        if parts != 2 or data.size != HEADER_VALUES + 2 * antennas * count:
            raise ValueError(f"not a waveform: {data.size} values for {antennas} x {count} samples")
        samples = data[HEADER_VALUES:].view(np.complex128)
        return cls._of(data[:HEADER_VALUES].tolist(), samples.reshape(antennas, count))

    @classmethod
    def _of(cls, header: Sequence[float], samples: NDArray[np.complex128]) -> Waveform:
        stamp_s, sample_rate_hz, carrier_hz, channel = header
        if not (math.isfinite(stamp_s) and math.isfinite(channel)):
            raise ValueError(f"not a waveform: stamp {stamp_s} s, channel {channel}")
        return cls(seconds_to_ns(stamp_s), sample_rate_hz, carrier_hz, int(channel), samples)

    @classmethod
    def from_cdr(cls, raw: bytes) -> Waveform:
        """View of a serialised message; the samples share its memory and are read-only.

        Raises
        ------
        ValueError
            If the layout is not that of a waveform.
        """
        if len(raw) < _DATA_AT:
            return cls.from_msg(deserialize_message(raw, Float64MultiArray))
        fields = _PREFIX.unpack_from(raw)
        antennas, count = fields[4], fields[8]
        if (
            fields[15] != HEADER_VALUES + 2 * antennas * count
            or (*fields[:4], *fields[6:8], *fields[10:13], fields[14]) != _LAYOUT
        ):
            return cls.from_msg(deserialize_message(raw, Float64MultiArray))
        samples = np.frombuffer(raw, np.complex128, antennas * count, _DATA_AT)
        header = _HEADER.unpack_from(raw, _PREFIX.size)
        return cls._of(header, samples.reshape(antennas, count))


# What of the prefix is the same for every waveform.
_LAYOUT = (CDR_LITTLE_ENDIAN, 3, 8, b"antenna\0", 7, b"sample\0", 3, b"iq\0", 2, HEADER_VALUES)


def _sample_bytes(samples: NDArray[np.complex128]) -> bytes:
    return np.ascontiguousarray(samples, dtype=np.complex128).tobytes()


def silence(stamp_ns: int, sample_rate_hz: float, carrier_hz: float, channel: int) -> Waveform:
    """Block of a port that does not transmit, or hears nothing."""
    return Waveform(
        stamp_ns, sample_rate_hz, carrier_hz, channel, np.empty((1, 0), dtype=np.complex128)
    )


def silent_stamp_ns(raw: bytes) -> int | None:
    """Stamp of a serialised block without samples, None for one with samples.

    Most blocks of a long line are silent; this tells them by their length alone.
    """
    if len(raw) != _DATA_AT:
        return None
    return seconds_to_ns(_STAMP.unpack_from(raw, _PREFIX.size)[0])


class BlockReader:
    """Decoder of the blocks of one port; one that is sent again is the very same object.

    So that a reader can tell by identity that it need not do its work again. The view is as from
    `Waveform.from_cdr`, with the stamp of when it was first sent.
    """

    def __init__(self) -> None:
        self._layout = self._rest = b""
        self._length = -1
        self._last: Waveform | None = None

    def decoder(self) -> ViewDecoder[Waveform]:
        """Stamp [ns] and block of a message."""
        return ViewDecoder(self.read, lambda view: (view.stamp_ns, view.first))

    def read(self, raw: bytes) -> tuple[int, Waveform]:
        """Stamp [ns] and view of a serialised block.

        The view is as from `Waveform.from_cdr`, with the stamp of when it was first sent.
        """
        if (
            self._last is not None
            and len(raw) == self._length
            and raw.endswith(self._rest)
            and raw.startswith(self._layout)
        ):
            stamp_s: float = _STAMP.unpack_from(raw, _PREFIX.size)[0]
            return seconds_to_ns(stamp_s), self._last
        self._last = Waveform.from_cdr(raw)
        self._length = len(raw)
        self._layout, self._rest = raw[: _PREFIX.size], raw[_PREFIX.size + _STAMP.size :]
        return self._last.stamp_ns, self._last


class RepeatedWaveform(NamedTuple):
    """A block that is sent again: nothing but its stamp is new.

    Parameters
    ----------
    stamp_ns : int
        Simulated time of the tick.
    first : Waveform
        The block, with the stamp of when it was first sent.
    before, after : bytes
        Of its serialised form, what stands around the stamp.
    """

    stamp_ns: int
    first: Waveform
    before: bytes
    after: bytes

    def to_cdr(self) -> bytes:
        """Serialised form."""
        return b"".join((self.before, _STAMP.pack(self.stamp_ns / NANOSECONDS), self.after))


#: A block as it is sent, for the first time or again.
WaveformView = Waveform | RepeatedWaveform


class RepeatedBlock:
    """A block that a transmitter sends again every tick with nothing new but its stamp."""

    def __init__(self, block: Waveform) -> None:
        raw = block.to_cdr()
        before, after = raw[: _PREFIX.size], raw[_PREFIX.size + _STAMP.size :]
        self._last = RepeatedWaveform(block.stamp_ns, block, before, after)

    def at(self, stamp_ns: int) -> RepeatedWaveform:
        """Block of the tick at ``stamp_ns``."""
        if self._last.stamp_ns != stamp_ns:
            self._last = RepeatedWaveform(stamp_ns, *self._last[1:])
        return self._last
