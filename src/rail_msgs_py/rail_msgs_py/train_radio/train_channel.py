"""The two ends of the safe channel between the zone controller and a train."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np

from .safe_channel import SafeChannel
from .safe_frame import SHORTEST_KEY_BYTES, FrameKind
from .safe_result import Accepted, Opened, Rejected, RejectionReason
from .unit_clock import UnitClock

CONTROLLER_IDENTITY: Final = 0xF000
"""Of the zone controller; trains have their numbers."""
#: Stream of the seed that nonces are drawn from.
_NONCES = 5


@dataclass(frozen=True)
class EndSettings:
    """What both ends of a channel to a train are made with.

    Parameters
    ----------
    authentication_key : str
        Of this train and its controller, hexadecimal digits.
    seed : int
        Of the nonces.
    train : int
        Number of the train.
    tick_s : float
        Time of a tick [s]: frames may be three of them old, or a second. A frame that is sealed in
        one tick is sent, and opened, in the next at the earliest.
    clock : UnitClock
        Of the unit.
    """

    authentication_key: str
    seed: int
    train: int
    tick_s: float
    clock: UnitClock = field(default_factory=UnitClock)


class UnitChannel:
    """An end of a safe channel in a unit with a clock of its own.

    Its nonces are drawn from the seed, the unit and the simulated time of its first tick. No two
    starts of a unit have the same one, so none repeats nonces of before, in whichever process it
    starts; and the run is repeatable. Whoever has the seed, and so the recording of another run of
    the same scenario, has its nonces too: a simulation cannot have both.

    Parameters
    ----------
    settings : EndSettings
    own, peer : int
        Identities.
    accepts : FrameKind
    """

    def __init__(self, settings: EndSettings, own: int, peer: int, accepts: FrameKind) -> None:
        self._settings, self._own, self._peer, self._accepts = settings, own, peer, accepts
        key_of(settings.authentication_key)
        self._channel: SafeChannel | None = None

    @property
    def established(self) -> bool:
        """Whether there is a session."""
        return self._channel is not None and self._channel.established

    def _at(self, stamp_ns: int) -> tuple[SafeChannel, int]:
        """The channel, and what the unit's clock shows."""
        settings = self._settings
        if self._channel is None:
            self._channel = SafeChannel(
                key_of(settings.authentication_key),
                self._own,
                self._peer,
                (self._accepts,),
                nonces(settings.seed, self._own, self._peer, stamp_ns),
                max_age_s=max(1.0, 3.0 * settings.tick_s),
                least_delay_s=settings.tick_s,
                session_timeout_s=max(5.0, 10.0 * settings.tick_s),
            )
        return self._channel, settings.clock.read_ns(stamp_ns)

    def open(self, frame: bytes, stamp_ns: int) -> Opened:
        """As of `SafeChannel.open`, at a simulated time."""
        channel, time_ns = self._at(stamp_ns)
        return channel.open(frame, time_ns)

    def seal(self, kind: FrameKind, payload: bytes, stamp_ns: int) -> bytes:
        """As of `SafeChannel.seal`, at a simulated time."""
        channel, time_ns = self._at(stamp_ns)
        return channel.seal(kind, payload, time_ns)

    def silence_s(self, stamp_ns: int) -> float:
        """As of `SafeChannel.silence_s`, at a simulated time."""
        channel, time_ns = self._at(stamp_ns)
        return channel.silence_s(time_ns)


def nonces(seed: int, own: int, peer: int, stamp_ns: int) -> Callable[[int], bytes]:
    """Source of the nonces of an end whose first tick after its start has this stamp [ns]."""
    entropy = np.random.SeedSequence([seed, _NONCES, own, peer, stamp_ns])
    return np.random.Generator(np.random.Philox(entropy)).bytes


def key_of(digits: str) -> bytes:
    """Key of hexadecimal digits.

    Raises
    ------
    ValueError
        If it is none, or too short.
    """
    try:
        key = bytes.fromhex(digits)
    except ValueError:
        raise ValueError("secret: must be hexadecimal digits") from None
    if len(key) < SHORTEST_KEY_BYTES:
        raise ValueError(f"secret: must have {SHORTEST_KEY_BYTES} bytes or more, got {len(key)}")
    return key


def controller_end(settings: EndSettings) -> UnitChannel:
    """The zone controller's end: takes location reports of a train.

    Raises
    ------
    ValueError
        If the key is no key.
    """
    train = settings.train
    return UnitChannel(settings, CONTROLLER_IDENTITY, train, FrameKind.LOCATION_REPORT)


def train_end(settings: EndSettings) -> UnitChannel:
    """The train's end: takes movement authorities; see `controller_end`."""
    train = settings.train
    return UnitChannel(settings, train, CONTROLLER_IDENTITY, FrameKind.MOVEMENT_AUTHORITY)


class FrameEnd(Protocol):
    """What is asked of an end of a channel: `SafeChannel` by its clock, `UnitChannel` by ticks."""

    @property
    def established(self) -> bool:
        """Whether there is a session."""

    def open(self, frame: bytes, time_ns: int, /) -> Opened:
        """What to make of a frame."""

    def seal(self, kind: FrameKind, payload: bytes, time_ns: int, /) -> bytes:
        """Frame to send."""

    def silence_s(self, time_ns: int, /) -> float:
        """Age of the newest accepted data [s]."""


class CountedChannel:
    """A safe channel that counts what it makes of frames.

    Parameters
    ----------
    channel : FrameEnd

    Attributes
    ----------
    accepted, lost, rejected : int
        Frames taken as data, missing between them, and refused. One that came through two base
        stations is no attack and not counted.
    """

    def __init__(self, channel: FrameEnd) -> None:
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
