"""Bare headers: the stamp of a finished tick."""

from __future__ import annotations

import struct

from .stamps import CDR_LITTLE_ENDIAN, NANOSECONDS

# Stamp, then an empty frame name: length 1 with its terminating NUL.
_HEADER = struct.Struct("<4siIIc")


def header_to_cdr(stamp_ns: int) -> bytes:
    """Serialised ``std_msgs/Header`` with an empty frame name."""
    sec, nanosec = divmod(stamp_ns, NANOSECONDS)
    return _HEADER.pack(CDR_LITTLE_ENDIAN, sec, nanosec, 1, b"\0")
