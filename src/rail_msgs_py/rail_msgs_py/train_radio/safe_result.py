"""What one end of a safe channel makes of the bytes that arrive."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

from .safe_frame import FrameKind


class RejectionReason(Enum):
    """Why a frame was rejected; the first that applies, in this order."""

    MALFORMED = "malformed"
    UNEXPECTED_KIND = "unexpected_kind"
    WRONG_ADDRESS = "wrong_address"
    UNKNOWN_SESSION = "unknown_session"
    SAFETY_CODE = "safety_code"
    FROM_THE_FUTURE = "from_the_future"
    TOO_OLD = "too_old"
    REPEATED = "repeated"
    OUT_OF_ORDER = "out_of_order"
    CLOCK_JUMPED = "clock_jumped"


@dataclass(frozen=True, slots=True)
class Accepted:
    """Data to rely on.

    Parameters
    ----------
    kind : FrameKind
    payload : bytes
    age_s : float
        Time since it was sealed, at most, whatever the clocks of the two ends.
    doubt_s : float
        How much younger it may be.
    sequence : int
    lost : int
        Frames of this session missing between the one accepted before and this one.
    feedback : int
        Newest of my sequence numbers that the peer had accepted.
    """

    kind: FrameKind
    payload: bytes
    age_s: float
    doubt_s: float
    sequence: int
    lost: int
    feedback: int


@dataclass(frozen=True, slots=True)
class Greeted:
    """A genuine greeting: no data. `established` when it made a session."""

    established: bool


@dataclass(frozen=True, slots=True)
class Rejected:
    """A frame to forget."""

    reason: RejectionReason


Opened: TypeAlias = Accepted | Greeted | Rejected
