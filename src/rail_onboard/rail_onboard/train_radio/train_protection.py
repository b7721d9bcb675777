"""Automatic train protection: what a train does with the frames that reach it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf, nan

from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.train_radio.movement_authority import MovementAuthority
from rail_msgs_py.train_radio.safe_channel import SafeChannel
from rail_msgs_py.train_radio.safe_frame import FrameKind
from rail_msgs_py.train_radio.train_channel import CountedChannel
from rail_msgs_py.train_radio.train_report import FASTEST_MPS, WIDEST_M, LocationReport
from rail_onboard.track_code.supervision import SupervisionOutput

from .supervision import AuthoritySupervision, ReceivedAuthority
from .train_location import NOWHERE, Location, TrainLocation


@dataclass(frozen=True)
class TrainIdentity:
    """What a train is and where it was put into service.

    ``number`` as in the telegrams, ``segment`` its track, ``start_m`` the chainage of its front
    there, known within ``placed_m``; ``length_m`` over couplers.
    """

    number: int
    segment: int
    start_m: float
    placed_m: float
    length_m: float
    direction: int = 1


class TrainProtection:
    """Takes frames and the odometer, gives the train's own frame and what it may do.

    Where the front is it works out itself, from what it is told and from the odometer, or takes
    from a localizer.

    Parameters
    ----------
    identity : TrainIdentity
    channel : SafeChannel
        To the zone controller.
    location : TrainLocation
    supervision : AuthoritySupervision
    """

    def __init__(
        self,
        identity: TrainIdentity,
        channel: SafeChannel,
        location: TrainLocation,
        supervision: AuthoritySupervision,
    ) -> None:
        self._identity, self._channel = identity, CountedChannel(channel)
        self._location, self._supervision = location, supervision
        self._placed = False
        self._here = NOWHERE
        #: Ranged positions told in the tick: when sealed [s], position, half-width [m].
        self.relayed: list[tuple[float, float, float]] = []

    @property
    def counts(self) -> tuple[int, int, int]:
        """Frames accepted, lost and rejected."""
        return self._channel.counts

    def tick(
        self,
        time_ns: int,
        distance_m: float,
        speed_mps: float,
        frames: Iterable[bytes],
        located: Location | None = None,
        fastest_mps: float | None = None,
    ) -> SupervisionOutput:
        """One tick: odometer and frames received in it, and what a localizer says.

        Parameters
        ----------
        time_ns : int
        distance_m, speed_mps : float
            Of the odometer; with a localizer the speed that it believes.
        frames : iterable of bytes
        located, fastest_mps : optional
            Where a localizer says the front is, and the fastest that the train may run.
        """
        time_s = time_ns / NANOSECONDS
        self.relayed = []
        self._location.update(time_s, distance_m, speed_mps)
        if not self._placed:
            train = self._identity
            self._placed = self._location.fix(time_s, train.start_m, train.placed_m)
        newest: ReceivedAuthority | None = None
        for frame in frames:
            authority = self._read(frame, time_ns)
            if authority is not None and (newest is None or authority.sealed_s > newest.sealed_s):
                newest = authority
        self._here = self._location.location(time_s) if located is None else located
        return self._supervision.update(
            time_s, self._here, speed_mps, authority=newest, fastest_mps=fastest_mps
        )

    def _read(self, frame: bytes, time_ns: int) -> ReceivedAuthority | None:
        _, opened = self._channel.open(frame, time_ns)
        if opened is None:
            return None
        train = self._identity
        try:
            telegram = MovementAuthority.from_bytes(opened.payload)
        except ValueError:
            self._channel.refuse()
            return None
        mine = (train.number, train.segment, train.direction)
        if (telegram.train, telegram.segment, telegram.direction) != mine:
            self._channel.refuse()
            return None
        sealed_s = time_ns / NANOSECONDS - opened.age_s
        if telegram.located is not None:
            self._location.fix(sealed_s, *telegram.located)
            self.relayed.append((sealed_s, *telegram.located))
        return ReceivedAuthority(
            sealed_s,
            telegram.end_of_authority_m,
            telegram.limit_mps,
            tuple((step.from_m, step.limit_mps) for step in telegram.steps),
            telegram.validity_s,
            telegram.emergency_stop,
        )

    def frame(self, time_ns: int, speed_mps: float) -> bytes:
        """The train's own frame, which tells where it is in this tick."""
        train, here = self._identity, self._here
        valid = here.valid and here.uncertainty_m <= WIDEST_M
        report = LocationReport(
            train.number,
            train.segment,
            here.position_m if valid else 0.0,
            train.direction,
            min(abs(speed_mps), FASTEST_MPS),
            here.uncertainty_m if valid else WIDEST_M,
            train.length_m,
            True,
            valid,
        )
        return self._channel.channel.seal(FrameKind.LOCATION_REPORT, report.to_bytes(), time_ns)

    def state_values(self, time_ns: int) -> tuple[float, ...]:
        """Values as ``ATP_STATE.columns``; NaN where there is none."""
        time_s = time_ns / NANOSECONDS
        here, held = self._here, self._supervision.authority
        return (
            *self.counts,
            here.position_m if here.valid else nan,
            here.uncertainty_m if here.valid else inf,
            nan if held is None else held.end_m,
            inf if held is None else time_s - held.sealed_s,
        )
