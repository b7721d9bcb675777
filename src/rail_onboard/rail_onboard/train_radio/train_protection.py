"""Automatic train protection: what a train does with the frames that reach it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf, nan

from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.train_radio.movement_authority import MovementAuthority
from rail_msgs_py.train_radio.safe_frame import FrameKind
from rail_msgs_py.train_radio.train_channel import CountedChannel, FrameEnd
from rail_msgs_py.train_radio.train_report import FASTEST_MPS, WIDEST_M, LocationReport
from rail_onboard.track_code.supervision import SupervisionOutput

from .supervision import ReceivedAuthority
from .train_location import NOWHERE, Location, TrainLocation
from .train_modes import ModeSupervision, TrainMode


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


@dataclass(frozen=True)
class LocalizerView:
    """What a localizer says: where the front is, the speed that it believes, and the fastest."""

    location: Location
    believed_mps: float
    fastest_mps: float


class TrainProtection:
    """Takes frames and the odometer, gives the train's own frame and what it may do.

    Where the front is it works out itself, from what it is told and from the odometer, or takes
    from a localizer as long as that knows. What it was told when it was put into service counts
    only if it is on from the start of the run, stamp 0: switched on later it has to be located.

    Parameters
    ----------
    identity : TrainIdentity
    channel : FrameEnd
        To the zone controller.
    location : TrainLocation
    supervision : ModeSupervision
    """

    def __init__(
        self,
        identity: TrainIdentity,
        channel: FrameEnd,
        location: TrainLocation,
        supervision: ModeSupervision,
    ) -> None:
        self._identity, self._channel = identity, CountedChannel(channel)
        self._location, self._supervision = location, supervision
        self._begun = self._braked = False
        self._here, self._fastest_mps = NOWHERE, 0.0
        #: Whether the train is confirmed to be whole; of a fixed formation it always is.
        self.whole = True
        #: Ranged positions told in the tick: when sealed [s], position, half-width [m].
        self.relayed: list[tuple[float, float, float]] = []

    @property
    def mode(self) -> TrainMode:
        """Mode of the train."""
        return self._supervision.mode

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
        localizer: LocalizerView | None = None,
    ) -> SupervisionOutput:
        """One tick.

        Parameters
        ----------
        time_ns : int
        distance_m, speed_mps : float
            Of the odometer.
        frames : iterable of bytes
            Received in the tick.
        localizer : LocalizerView, optional
            What a localizer says, if it knows where the train is.
        """
        time_s = time_ns / NANOSECONDS
        self.relayed = []
        self._location.update(time_s, distance_m, speed_mps, braked=self._braked)
        if not self._begun:
            self._begun, train = True, self._identity
            if time_ns == 0:
                self._location.place(time_s, train.start_m, train.placed_m)
        known_mps = self._location.fastest_mps if localizer is None else localizer.fastest_mps
        newest: ReceivedAuthority | None = None
        for frame in frames:
            authority = self._read(frame, time_ns, max(abs(speed_mps), known_mps))
            if authority is not None and (newest is None or authority.sealed_s > newest.sealed_s):
                newest = authority
        doubted = localizer is None and self._location.odometer_doubted
        if localizer is None:
            here, fastest_mps = self._location.location(time_s), self._location.fastest_mps
            localizer = LocalizerView(here, speed_mps, fastest_mps)
        self._here, self._fastest_mps = localizer.location, localizer.fastest_mps
        out = self._supervision.update(
            time_s,
            localizer.location,
            localizer.believed_mps,
            authority=newest,
            fastest_mps=localizer.fastest_mps,
            odometer_doubted=doubted,
        )
        self._braked = out.service_brake or out.emergency_brake
        return out

    def _read(self, frame: bytes, time_ns: int, fastest_mps: float) -> ReceivedAuthority | None:
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
            at_m, half_m = telegram.located
            # It may have been sealed later than it seems, when the train was farther on.
            located = at_m, half_m + fastest_mps * opened.doubt_s
            self._location.fix(sealed_s, *located)
            self.relayed.append((sealed_s, *located))
        return ReceivedAuthority(
            sealed_s,
            telegram.end_of_authority_m,
            telegram.limit_mps,
            tuple((step.from_m, step.limit_mps) for step in telegram.steps),
            telegram.validity_s,
            telegram.emergency_stop,
            telegram.overlap_m,
            telegram.release,
        )

    def frame(self, time_ns: int) -> bytes:
        """The train's own frame, which tells where it is in this tick."""
        train, here = self._identity, self._here
        valid = here.valid and here.uncertainty_m <= WIDEST_M
        report = LocationReport(
            train.number,
            train.segment,
            here.position_m if valid else 0.0,
            train.direction,
            min(self._fastest_mps, FASTEST_MPS),
            here.uncertainty_m if valid else WIDEST_M,
            train.length_m,
            self.whole,
            valid,
            self._supervision.released,
        )
        return self._channel.channel.seal(FrameKind.LOCATION_REPORT, report.to_bytes(), time_ns)

    def state_values(self, time_ns: int) -> tuple[float, ...]:
        """Values as ``ATP_STATE.columns``; NaN where there is none."""
        time_s = time_ns / NANOSECONDS
        here, held = self._here, self._supervision.authority
        if held is not None and held.validity_s <= 0.0:
            held = None  # it is told that there is none
        return (
            *self.counts,
            here.position_m if here.valid else nan,
            here.uncertainty_m if here.valid else inf,
            nan if held is None else held.end_m,
            inf if held is None else time_s - held.sealed_s,
            float(self.mode),
            float(self._location.odometer_doubted),
        )
