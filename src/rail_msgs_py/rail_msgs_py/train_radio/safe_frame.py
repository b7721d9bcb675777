"""Frames between two ends that must trust each other over open radio: layout, keys, safety code.

EN 50159:2010 category 3: anyone may hear, send and alter. Layout, 64 bytes (a burst of 512 bits),
big endian:

====== ===== ======================================================================
offset bytes field
====== ===== ======================================================================
0      1     protocol version (high half), kind (low half)
1      1     bytes of the payload in use, 0 to 32
2      2     source
4      2     destination
6      4     number among the data of the session, or among the greetings, from 1
10     6     time-stamp by the sender's clock, 1 us, rounded down
16     4     feedback: number of the newest data taken from the destination; before any,
             of the newest greeting that showed its nonce, with the highest bit set
20     4     session mark; 0 in a greeting
24     32    payload, filled up with zeros
56     8     safety code over all that precedes
====== ===== ======================================================================

The safety code is AES-128-CMAC (NIST SP 800-38B, RFC 4493) cut to its first 64 bits. Whoever
does not know the key, noise included, passes with 2^-64 = 5.4e-20 per frame: a link that is
filled with forged bursts, one every 10 ms, sees one pass in 2^64 x 10 ms = 5.8e9 years
(2e-14 per hour, where the tolerable hazard rate of SIL 4 is 1e-9). SP 800-38B, annex A, asks for
64 bits or more; the whole 128 would not fit into a burst beside a movement authority, and buy
nothing. One key makes at most 2^31 codes, far from the 2^48 that the same annex recommends.

Keys come from the secret of a pair of ends by HKDF-SHA256 (RFC 5869). Each direction has its own,
so a frame that is read by another end, or thrown back to its sender, does not verify. Each session
has its own, made from a nonce of either end: see `safe_channel`.
"""

from __future__ import annotations

import hmac
import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple

from cryptography.hazmat.primitives.ciphers.algorithms import AES
from cryptography.hazmat.primitives.cmac import CMAC
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF

VERSION: Final = 2
FRAME_BYTES: Final = 64
PAYLOAD_BYTES: Final = 32
CODE_BYTES: Final = 8
NONCE_BYTES: Final = 16
SHORTEST_KEY_BYTES: Final = 16
LAST_SEQUENCE: Final = 2**31 - 1
#: In the feedback: it is the number of a greeting.
GREETING_BIT: Final = 2**31
NS_PER_TICK: Final = 1000
LAST_TIME_NS: Final = 2**48 * NS_PER_TICK - 1

_HEADER = struct.Struct(">BBHHIHIII")
HEADER_BYTES: Final = _HEADER.size
_CODE_AT = HEADER_BYTES + PAYLOAD_BYTES
_KEY_BYTES = 16
_MARK_BYTES = 4


class FrameKind(IntEnum):
    """What a frame carries."""

    GREETING = 0
    LOCATION_REPORT = 1
    MOVEMENT_AUTHORITY = 2


class Header(NamedTuple):
    """Fields of the layout before the payload; `kind` is a number, known or not."""

    version: int
    kind: int
    length: int
    source: int
    destination: int
    sequence: int
    time_ns: int
    feedback: int
    mark: int


def read_header(frame: bytes) -> Header:
    """Header of a frame of the right length, whatever stands in it."""
    first, length, source, to, sequence, high, low, feedback, mark = _HEADER.unpack_from(frame)
    time_ns = (high << 32 | low) * NS_PER_TICK
    return Header(first >> 4, first & 0xF, length, source, to, sequence, time_ns, feedback, mark)


def write_header(header: Header) -> bytes:
    """Bytes of a header; the time is rounded down."""
    version, kind, length, source, to, sequence, time_ns, feedback, mark = header
    ticks = time_ns // NS_PER_TICK
    return _HEADER.pack(
        version << 4 | kind,
        *(length, source, to, sequence),
        *(ticks >> 32, ticks & 0xFFFFFFFF),
        *(feedback, mark),
    )


def payload_of(frame: bytes, length: int = PAYLOAD_BYTES) -> bytes:
    """Payload of a frame of the right length."""
    return frame[HEADER_BYTES : HEADER_BYTES + length]


class SafetyCode:
    """AES-128-CMAC of one key, cut to 64 bits.

    >>> code = SafetyCode(bytes.fromhex("2b7e151628aed2a6abf7158809cf4f3c"))
    >>> code.of(b"").hex()  # RFC 4493, section 4, example 1
    'bb1d6929e9593728'
    """

    def __init__(self, key: bytes) -> None:
        self._blank = CMAC(AES(key))

    def of(self, body: bytes) -> bytes:
        """Code of the bytes."""
        mac = self._blank.copy()  # a third of the cost of setting the key again
        mac.update(body)
        return mac.finalize()[:CODE_BYTES]

    def seal(self, header: Header, payload: bytes) -> bytes:
        """Frame of a header and at most 32 bytes of payload."""
        body = write_header(header) + payload.ljust(PAYLOAD_BYTES, b"\0")
        return body + self.of(body)

    def matches(self, frame: bytes) -> bool:
        """Whether a frame of the right length ends in its code; takes the same time always."""
        return hmac.compare_digest(self.of(frame[:_CODE_AT]), frame[_CODE_AT:])


def _derive(authentication_key: bytes, label: bytes, length: int) -> bytes:
    salt = b"rail corridor safe frame %d" % VERSION
    return HKDF(SHA256(), length, salt, label).derive(authentication_key)


@dataclass(frozen=True, slots=True)
class SessionKey:
    """Key of one direction in one session, and the mark that says which session it is.

    The mark only spares the receiver from trying keys; it proves nothing.
    """

    mark: int
    code: SafetyCode


class DirectionKeys:
    """Keys of the frames from one end to another.

    Parameters
    ----------
    authentication_key : bytes
        Of the pair, 16 bytes at least.
    source, destination : int
        Identities of the two ends, 0 to 65535.
    """

    def __init__(self, authentication_key: bytes, source: int, destination: int) -> None:
        if len(authentication_key) < SHORTEST_KEY_BYTES:
            raise ValueError(
                f"secret must have {SHORTEST_KEY_BYTES} bytes or more,"
                f" got {len(authentication_key)}"
            )
        pair = struct.pack(">HH", source, destination)
        self._root = _derive(authentication_key, b"direction" + pair, 32)
        self.greeting = SafetyCode(_derive(self._root, b"greeting", _KEY_BYTES))

    def session(self, source_nonce: bytes, destination_nonce: bytes) -> SessionKey:
        """Key of the session of two nonces."""
        label = b"session" + source_nonce + destination_nonce
        derived = _derive(self._root, label, _KEY_BYTES + _MARK_BYTES)
        return SessionKey(
            int.from_bytes(derived[_KEY_BYTES:], "big"), SafetyCode(derived[:_KEY_BYTES])
        )
