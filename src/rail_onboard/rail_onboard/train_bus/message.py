"""What head and tail of a train tell each other over the bus, as a payload of 32 bytes.

=======  =====================================================================
0        end that speaks: 1 head, 2 tail
1        1 if it has heard the other end, else 0
2-5      tick in which it was sent
6-9      tick of the newest frame heard from the other end, 2^32 - 1 for none
10-13    frames it has lost so far
14-15    zero
16-31    a pattern that the receiver knows: wrong bits in it are counted
=======  =====================================================================

All numbers are little endian. The tail answers what the head has said: an answer that is young
enough shows the head that the end of the train is still there.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

End = Literal["head", "tail"]

PAYLOAD_BYTES: Final = 32
NONE: Final = 0xFFFFFFFF
#: The first of the maximal-length sequence of x^7 + x^6 + 1, most significant bit first.
PATTERN: Final = bytes.fromhex("fe041851e459d4fa1c49b5bd8d2ee655")

_FIXED = struct.Struct("<BBIIIH")
_ENDS: Final = {"head": 1, "tail": 2}
_HAS_RECEIVED = 1
_PATTERN_BITS = np.unpackbits(np.frombuffer(PATTERN, dtype=np.uint8)).astype(np.bool_)


@dataclass(frozen=True)
class BusMessage:
    """One message.

    Parameters
    ----------
    end
        Who speaks.
    tick
        When.
    received_tick
        Tick of the newest message of the other end that came through, None if none did.
    lost
        Messages of the other end that did not come through so far.
    """

    end: End
    tick: int
    received_tick: int | None
    lost: int

    def to_bytes(self) -> bytes:
        """Payload of a frame."""
        received = NONE if self.received_tick is None else self.received_tick
        flags = 0 if self.received_tick is None else _HAS_RECEIVED
        fixed = _FIXED.pack(_ENDS[self.end], flags, self.tick % NONE, received, self.lost % NONE, 0)
        return fixed + PATTERN

    @classmethod
    def from_bytes(cls, payload: bytes) -> BusMessage:
        """Message of a payload.

        Raises
        ------
        ValueError
            If it is not a message.
        """
        if len(payload) != PAYLOAD_BYTES or payload[_FIXED.size :] != PATTERN:
            raise ValueError(f"not a message of the bus: {payload.hex()}")
        end, flags, tick, received, lost, rest = _FIXED.unpack_from(payload)
        ends = {number: name for name, number in _ENDS.items()}
        if end not in ends or flags != (received != NONE) * _HAS_RECEIVED or rest or tick == NONE:
            raise ValueError(f"not a message of the bus: {payload.hex()}")
        return cls(ends[end], tick, None if received == NONE else received, lost)  # type: ignore[arg-type]


def pattern_errors(bits: NDArray[np.bool_]) -> tuple[int, int]:
    """Wrong bits among those of the pattern, and how many that are.

    Parameters
    ----------
    bits : bool [data bits]
        Decisions on payload and check, the frame valid or not.
    """
    pattern = bits[8 * _FIXED.size : 8 * PAYLOAD_BYTES]
    return int(np.count_nonzero(pattern != _PATTERN_BITS)), len(_PATTERN_BITS)
