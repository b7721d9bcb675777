"""The two ends of the safe channel between the zone controller and a train."""

from __future__ import annotations

from typing import Final

import numpy as np

from .safe_channel import SafeChannel
from .safe_frame import FrameKind
from .safe_result import Accepted, Rejected, RejectionReason

CONTROLLER_IDENTITY: Final = 0xF000
"""Of the zone controller; trains have their numbers."""
# Streams of the seed that nonces are drawn from.
_TRAIN_NONCES, _CONTROLLER_NONCES = 5, 6


def controller_end(authentication_key: str, seed: int, train: int, tick_s: float) -> SafeChannel:
    """The zone controller's end: takes location reports of a train.

    Parameters
    ----------
    authentication_key : str
        Hexadecimal digits.
    seed : int
        Of the nonces.
    train : int
        Number of the train.
    tick_s : float
        Time of a tick [s]: frames may be three of them old, or a second.

    Raises
    ------
    ValueError
        If the secret is no secret.
    """
    ends = (CONTROLLER_IDENTITY, train)
    return _end(
        authentication_key, seed, _CONTROLLER_NONCES, train, ends, FrameKind.LOCATION_REPORT, tick_s
    )


def train_end(
    authentication_key: str, seed: int, train: int, tick_s: float, restarts: int = 0
) -> SafeChannel:
    """The train's end: takes movement authorities. Parameters as of `controller_end`.

    ``restarts`` counts how often it was switched on anew: an end that drew the nonces of before
    would take what was recorded before, and the peer would take its greetings for old ones.
    """
    ends = (train, CONTROLLER_IDENTITY)
    kind = FrameKind.MOVEMENT_AUTHORITY
    return _end(authentication_key, seed, _TRAIN_NONCES, train, ends, kind, tick_s, restarts)


def _end(
    authentication_key: str,
    seed: int,
    stream: int,
    train: int,
    ends: tuple[int, int],
    accepts: FrameKind,
    tick_s: float,
    restarts: int = 0,
) -> SafeChannel:
    key = [seed, stream, train, *([restarts] if restarts else [])]
    bits = np.random.Philox(np.random.SeedSequence(key))
    draw = np.random.Generator(bits).bytes
    max_age_s = max(1.0, 3.0 * tick_s)
    return SafeChannel(
        bytes.fromhex(authentication_key), *ends, (accepts,), draw, max_age_s=max_age_s
    )


class CountedChannel:
    """A safe channel that counts what it makes of frames.

    Parameters
    ----------
    channel : SafeChannel

    Attributes
    ----------
    accepted, lost, rejected : int
        Frames taken as data, missing between them, and refused. One that came through two base
        stations is no attack and not counted.
    """

    def __init__(self, channel: SafeChannel) -> None:
        self.channel = channel
        self.accepted = self.lost = self.rejected = 0

    @property
    def counts(self) -> tuple[int, int, int]:
        """Accepted, lost, rejected."""
        return self.accepted, self.lost, self.rejected

    def open(self, frame: bytes, time_ns: int) -> tuple[bool, Accepted | None]:
        """Whether a frame is genuine, and its data if it carries any."""
        opened = self.channel.open(frame, time_ns)
        if isinstance(opened, Rejected):
            self.rejected += opened.reason is not RejectionReason.REPEATED
            return False, None
        if not isinstance(opened, Accepted):
            return True, None
        self.accepted += 1
        self.lost += opened.lost
        return True, opened

    def refuse(self) -> None:
        """Count data that are genuine and yet make no sense."""
        self.rejected += 1
